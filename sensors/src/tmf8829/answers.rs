//! The next state after each answer.

use super::frame::{Flags, Header, Kind};
use super::registers::{
    APPLICATION, BOOTLOADER, BootCommand, CHIP_ID, CPU_READY, Command, DEFAULT_ADDRESS,
    FIRST_COMMAND, FRAME_INT, POFF, PON, STAT_INCOMPLETE, STAT_OK,
};
use super::requests::{ADDRESS_BLOCK, LAST_BLOCK};
use super::{DeviceError, Error, MAX_IMAGE, State, Tmf8829Protocol, Waiting};
use crate::tmf::count;
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
                self.watch.restart(now_ms);
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
                BOOTLOADER if self.image.len() > MAX_IMAGE => Err(DeviceError::LongImage.into()),
                BOOTLOADER => {
                    self.may_measure = false;
                    let off = self.config.settings().interface.other_off();
                    self.go_on_in(State::BootCommanding(off))
                }
                id => Err(Error::WrongApplication { id }),
            },
            State::BootCommanding(BootCommand::Start) => self.wait_in(State::Booting, now_ms),
            State::BootCommanding(command) => self.wait_in(State::BootCommanded(command), now_ms),
            State::BootCommanded(command) => self.boot_commanded(command, answer, now_ms),
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
                    self.wait_on(Waiting::Bootloader(command), now_ms)
                }
                status => self.boot_commanded(BootCommand::Start, status, now_ms),
            },
            State::Booting if answer == APPLICATION => self.go_on_in(State::Keeping),
            State::Booting => self.wait_on(Waiting::Application, now_ms),
            State::Keeping => self.load_preset(),
            State::Commanding(command) => self.wait_in(State::Commanded(command), now_ms),
            State::Commanded(command) => self.commanded(command, answer, now_ms),
            State::Paging if answer == self.preset() => self.go_on_in(State::Configuring(0)),
            State::Paging => Err(Error::WrongPage { page: answer }),
            State::Configuring(LAST_BLOCK) => {
                // The status is read at the new address.
                self.address = self.config.settings().interface.address();
                self.wait_in(State::Commanded(Command::WritePage), now_ms)
            }
            State::Configuring(block) => {
                let next = block + 1;
                // The preset has the default address, whatever the present one is.
                let keeps = self.config.settings().interface.address() == DEFAULT_ADDRESS;
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
        self.watch.restart(now_ms);
        Ok(Some(Polled::Working))
    }

    /// Stays idle until the time is over.
    fn wait_on<B, P>(&self, waiting: Waiting, now_ms: u32) -> Next<B, P> {
        let limit = self.config.settings().command_timeout_ms;
        self.watch.check_time(limit, waiting, now_ms)?;
        Ok(Some(Polled::Idle))
    }

    fn wake<B, P>(&mut self, enable: u8, now_ms: u32) -> Next<B, P> {
        if enable & CPU_READY != 0 {
            return self.go_on_in(State::Identifying);
        }
        let idle = self.wait_on(Waiting::PowerUp, now_ms)?;
        if enable & (PON | POFF) == PON {
            return Ok(idle);
        }
        self.go_on_in(State::SwitchingOn { enable })
    }

    /// The answer to a command of the bootloader. `Start` stands for a complete upload.
    fn boot_commanded<B, P>(
        &mut self,
        command: BootCommand,
        status: u8,
        now_ms: u32,
    ) -> Next<B, P> {
        if status >= FIRST_COMMAND {
            return self.wait_on(Waiting::Bootloader(command), now_ms);
        }
        if status != STAT_OK {
            return Err(DeviceError::Bootloader { command, status }.into());
        }
        self.go_on_in(match command {
            BootCommand::SpiOff | BootCommand::I2cOff => State::BootCommanding(BootCommand::Upload),
            BootCommand::Upload => State::Uploading { sent: 0 },
            BootCommand::Start => State::BootCommanding(BootCommand::Start),
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
            return self.wait_on(Waiting::Command(command), now_ms);
        }
        match command {
            Command::Stop => {
                self.may_measure = false;
                self.load_preset()
            }
            Command::LoadPreset(_) => self.go_on_in(State::Paging),
            Command::WritePage => self.go_on_in(State::Commanding(Command::Measure)),
            Command::Measure => {
                self.watch.clear_stuck();
                (self.next, self.has_given) = (None, false);
                self.wait_in(State::Measuring, now_ms)
            }
        }
    }

    fn check_silence<B, P>(&self, now_ms: u32) -> Result<(), Error<B, P>> {
        let limit = self.config.settings().data_timeout_ms;
        self.watch.check_time(limit, Waiting::Data, now_ms)
    }

    fn look<B, P>(&mut self, is_high: bool, now_ms: u32) -> Next<B, P> {
        if !is_high {
            return self.go_on_in(State::Asking);
        }
        self.check_silence(now_ms)?;
        self.watch.clear_stuck();
        Ok(Some(Polled::Idle))
    }

    fn ask<B, P>(&mut self, status: u8, now_ms: u32) -> Next<B, P> {
        let reasons = status & FRAME_INT;
        if reasons != 0 {
            return self.go_on_in(State::Clearing { reasons });
        }
        let limit = self.config.settings().stuck_limit;
        self.watch.check_stuck(limit, status)?;
        self.check_silence(now_ms)?;
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
        self.watch.clear_stuck();
        let working = self.wait_in(State::Reading, now_ms)?;
        let found = header.number;
        match self.next.replace(found.wrapping_add(1)) {
            Some(expected) if expected != found => {
                let missed = found.wrapping_sub(expected);
                // A number that goes back does not tell how many are missed.
                let missed = if missed >> 31 == 0 { missed } else { 0 };
                self.counts.missed = self.counts.missed.saturating_add(missed);
                Err(DeviceError::Missed { expected, found }.into())
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
        self.watch.restart(now_ms);
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
