//! What comes of an answer in each state.

use super::frame::{Flags, Header, Kind};
use super::registers::{
    APPLICATION, BOOTLOADER, BootCommand, CHIP_ID, CPU_READY, Command, DEFAULT_ADDRESS,
    FIRST_COMMAND, FRAME_INT, POFF, PON, STAT_INCOMPLETE, STAT_OK,
};
use super::requests::{ADDRESS_BLOCK, LAST_BLOCK};
use super::{Error, MOST_IMAGE, State, Tmf8829Protocol, Waiting, count};
use crate::timer::Since;
use crate::{PhotonSink, Polled};

type Next<B, P> = Result<Option<Polled>, Error<B, P>>;

impl<const CHUNK: usize> Tmf8829Protocol<'_, CHUNK> {
    pub(super) fn take_answer<B, P>(
        &mut self,
        is_high: bool,
        now_ms: u32,
        sink: &mut impl PhotonSink,
    ) -> Next<B, P> {
        let [answer, ..] = self.buffer;
        match self.state {
            State::Off { reset: true } => {
                self.address = DEFAULT_ADDRESS;
                self.wait_in(State::Resetting, now_ms)
            }
            State::Off { reset: false } | State::Resetting => self.wait_in(State::Starting, now_ms),
            State::Starting => {
                self.since = Since::new(now_ms);
                self.state = State::Waking;
                self.wake(answer, now_ms)
            }
            State::Waking => self.wake(answer, now_ms),
            State::SwitchingOn { .. } => {
                self.state = State::Waking;
                Ok(Some(Polled::Idle))
            }
            State::Identifying if answer == CHIP_ID => self.go_on_in(State::Looking),
            State::Identifying => Err(Error::WrongChip { id: answer }),
            State::Looking => match answer {
                // It may be measuring.
                APPLICATION => self.go_on_in(State::Commanding(Command::Stop)),
                BOOTLOADER if self.image.is_empty() => Err(Error::NoImage),
                BOOTLOADER if self.image.len() > MOST_IMAGE => Err(Error::LongImage),
                BOOTLOADER => self.go_on_in(State::Telling(BootCommand::SpiOff)),
                id => Err(Error::WrongApplication { id }),
            },
            State::Telling(BootCommand::Start) => self.wait_in(State::Booting, now_ms),
            State::Telling(command) => self.wait_in(State::Told(command), now_ms),
            State::Told(command) => self.told(command, answer, now_ms),
            State::Uploading { sent } => {
                // At most 16 KiB.
                let sent = sent.saturating_add(u16::try_from(CHUNK).unwrap_or(0));
                if usize::from(sent) < self.image.len() {
                    self.state = State::Uploading { sent };
                    return Ok(Some(Polled::Working));
                }
                self.wait_in(State::Uploaded, now_ms)
            }
            State::Uploaded => match answer {
                STAT_INCOMPLETE => {
                    let command = BootCommand::Upload;
                    self.patience(Waiting::Bootloader(command), now_ms)
                }
                status => self.told(BootCommand::Start, status, now_ms),
            },
            State::Booting if answer == APPLICATION => self.go_on_in(State::Keeping),
            State::Booting => self.patience(Waiting::Application, now_ms),
            State::Keeping => self.load_preset(),
            State::Commanding(command) => self.wait_in(State::Commanded(command), now_ms),
            State::Commanded(command) => self.commanded(command, answer, now_ms),
            State::Paging if answer == self.preset() => self.go_on_in(State::Configuring(0)),
            State::Paging => Err(Error::WrongPage { page: answer }),
            State::Configuring(LAST_BLOCK) => {
                // Its status stands at the new address.
                self.address = self.config.settings().address;
                self.wait_in(State::Commanded(Command::WritePage), now_ms)
            }
            State::Configuring(block) => {
                let next = block + 1;
                // The preset has the default one, whatever it answers at now.
                let keeps = self.config.settings().address == DEFAULT_ADDRESS;
                let skipped = next == ADDRESS_BLOCK && keeps;
                self.go_on_in(State::Configuring(next + u8::from(skipped)))
            }
            State::Measuring => self.look(is_high, now_ms),
            State::Asking => self.ask(answer, now_ms),
            State::Clearing { .. } => self.go_on_in(State::Beginning),
            State::Beginning => self.begin(now_ms, sink),
            State::Reading => self.read_on(now_ms, sink),
        }
    }

    fn go_on_in<B, P>(&mut self, state: State) -> Next<B, P> {
        self.state = state;
        Ok(None)
    }

    fn wait_in<B, P>(&mut self, state: State, now_ms: u32) -> Next<B, P> {
        self.state = state;
        self.since = Since::new(now_ms);
        Ok(Some(Polled::Working))
    }

    /// Nothing yet; an error once it takes too long.
    fn patience<B, P>(&self, waiting: Waiting, now_ms: u32) -> Next<B, P> {
        let limit = self.config.settings().command_timeout_ms;
        if self.since.is_over(limit, now_ms) {
            return Err(Error::Timeout(waiting));
        }
        Ok(Some(Polled::Idle))
    }

    fn wake<B, P>(&mut self, enable: u8, now_ms: u32) -> Next<B, P> {
        if enable & CPU_READY != 0 {
            return self.go_on_in(State::Identifying);
        }
        let idle = self.patience(Waiting::PowerUp, now_ms)?;
        if enable & (PON | POFF) == PON {
            return Ok(idle);
        }
        self.go_on_in(State::SwitchingOn { enable })
    }

    /// The answer to a command of the bootloader; to be started is to have all of the image.
    fn told<B, P>(&mut self, command: BootCommand, status: u8, now_ms: u32) -> Next<B, P> {
        if status >= FIRST_COMMAND {
            return self.patience(Waiting::Bootloader(command), now_ms);
        }
        if status != STAT_OK {
            return Err(Error::Bootloader { command, status });
        }
        self.go_on_in(match command {
            BootCommand::SpiOff => State::Telling(BootCommand::Upload),
            BootCommand::Upload => State::Uploading { sent: 0 },
            BootCommand::Start => State::Telling(BootCommand::Start),
        })
    }

    /// The command that loads the preset; the page that it shows has the same number.
    fn preset(&self) -> u8 {
        let settings = self.config.settings();
        settings.preset.command(settings.zones)
    }

    fn load_preset<B, P>(&mut self) -> Next<B, P> {
        self.go_on_in(State::Commanding(Command::LoadPreset(self.preset())))
    }

    fn commanded<B, P>(&mut self, command: Command, status: u8, now_ms: u32) -> Next<B, P> {
        if status != command.done() {
            if status < FIRST_COMMAND {
                return Err(Error::Refused { command, status });
            }
            return self.patience(Waiting::Command(command), now_ms);
        }
        match command {
            Command::Stop => self.load_preset(),
            Command::LoadPreset(_) => self.go_on_in(State::Paging),
            Command::WritePage => self.go_on_in(State::Commanding(Command::Measure)),
            Command::Measure => {
                (self.stuck, self.next, self.has_given) = (0, None, false);
                self.wait_in(State::Measuring, now_ms)
            }
        }
    }

    fn is_silent(&self, now_ms: u32) -> bool {
        let limit = self.config.settings().data_timeout_ms;
        self.since.is_over(limit, now_ms)
    }

    fn look<B, P>(&mut self, is_high: bool, now_ms: u32) -> Next<B, P> {
        if !is_high {
            return self.go_on_in(State::Asking);
        }
        if self.is_silent(now_ms) {
            return Err(Error::Timeout(Waiting::Frame));
        }
        self.stuck = 0;
        Ok(Some(Polled::Idle))
    }

    fn ask<B, P>(&mut self, status: u8, now_ms: u32) -> Next<B, P> {
        let reasons = status & FRAME_INT;
        if reasons != 0 {
            return self.go_on_in(State::Clearing { reasons });
        }
        self.stuck = self.stuck.saturating_add(1);
        if self.stuck >= self.config.settings().stuck_limit {
            return Err(Error::StuckInterrupt { status });
        }
        if self.is_silent(now_ms) {
            return Err(Error::Timeout(Waiting::Frame));
        }
        self.state = State::Measuring;
        Ok(Some(Polled::Idle))
    }

    fn begin<B, P>(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Next<B, P> {
        let header = Header::of(&self.buffer, &self.config)?;
        self.stream.begin(header);
        count(&mut self.counts.frames);
        if let Kind::Histograms { .. } = header.kind {
            sink.begin_frame(self.config.pulses());
        }
        self.stuck = 0;
        let working = self.wait_in(State::Reading, now_ms)?;
        let found = header.number;
        match self.next.replace(found.wrapping_add(1)) {
            Some(expected) if expected != found => {
                let missed = found.wrapping_sub(expected);
                // A number that goes back says nothing of how many.
                let missed = if missed >> 31 == 0 { missed } else { 0 };
                self.counts.missed = self.counts.missed.saturating_add(missed);
                Err(Error::Missed { expected, found })
            }
            _ => Ok(working),
        }
    }

    fn read_on<B, P>(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Next<B, P> {
        let length = usize::from(self.stream.left()).min(CHUNK);
        let bytes = self.buffer.get(..length).unwrap_or_default();
        let before = self.counts.histograms;
        let counts = &mut self.counts;
        self.stream.take(bytes, &self.config, counts, sink);
        let polled = if self.counts.histograms == before {
            Polled::Working
        } else {
            Polled::Data
        };
        self.since = Since::new(now_ms);
        if self.stream.left() > 0 {
            return Ok(Some(polled));
        }
        let flags = Flags::of(&self.stream.end)?;
        self.state = State::Measuring;
        self.has_given = true;
        if flags.is_limited() {
            count(&mut self.counts.limited);
        }
        flags
            .check()
            .inspect_err(|_| count(&mut self.counts.aborted))?;
        Ok(Some(polled))
    }
}
