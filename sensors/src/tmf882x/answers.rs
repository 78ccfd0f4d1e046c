//! The next state after each answer until the sensor measures.

use super::bootloader::{Answer, MAX_DATA};
use super::config::Zones;
use super::registers::{
    APPLICATION, BOOTLOADER, BootCommand, CHIP_ID, CHIP_ID_BITS, CPU_READY, Command,
    DEFAULT_ADDRESS, FIRST_COMMAND, MODE_8X8, PON,
};
use super::requests::Block;
use super::{BOOT_MS, DeviceError, Error, State, Tmf882xProtocol, Waiting};
use crate::{PhotonSink, Polled};

pub(super) type Next<B, P> = Result<Option<Polled>, Error<B, P>>;

impl<const CHUNK: usize> Tmf882xProtocol<'_, CHUNK> {
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
            // It waits without a request.
            State::Starting => Ok(Some(Polled::Idle)),
            State::Waking => self.wake(answer, now_ms),
            State::SwitchingOn { .. } => {
                self.state = State::Waking;
                Ok(Some(Polled::Idle))
            }
            State::Identifying if answer & CHIP_ID_BITS == CHIP_ID => self.go_on_in(State::Looking),
            State::Identifying => Err(Error::WrongChip { id: answer }),
            State::Looking => match answer {
                // It may be measuring.
                APPLICATION => self.go_on_in(State::Commanding(Command::Stop)),
                BOOTLOADER if self.image.is_empty() => Err(Error::NoImage),
                BOOTLOADER => {
                    self.may_measure = false;
                    self.go_on_in(State::Loading {
                        command: BootCommand::DownloadInit,
                        sent: 0,
                    })
                }
                id => Err(Error::WrongApplication { id }),
            },
            // The bootloader does not answer this command; the application does.
            State::Loading {
                command: BootCommand::RamRemapReset,
                ..
            } => self.wait_in(State::Booting, now_ms),
            State::Loading { command, sent } => {
                let sent = match command {
                    BootCommand::WriteRam => sent.saturating_add(CHUNK.min(MAX_DATA)),
                    _ => sent,
                };
                self.wait_in(State::Loaded { command, sent }, now_ms)
            }
            State::Loaded { command, sent } => self.load_more(command, sent, now_ms),
            State::Booting if answer == APPLICATION => self.show_page(),
            State::Booting => self.wait_on(BOOT_MS, Waiting::Application, now_ms),
            State::Commanding(command) => {
                if command == Command::I2cSlaveAddress {
                    // The status is read at the new address.
                    self.address = self.config.settings().address;
                }
                self.wait_in(State::Commanded(command), now_ms)
            }
            State::Commanded(command) => self.commanded(command, answer, now_ms),
            State::Switched => {
                let is_8x8 = self.config.settings().zones == Zones::SixtyFour;
                if is_8x8 != (answer == MODE_8X8) {
                    return Err(DeviceError::WrongMode { mode: answer }.into());
                }
                self.go_on_in(State::Commanding(Command::LoadConfigPageCommon))
            }
            State::Paging if answer == Command::LoadConfigPageCommon as u8 => {
                self.go_on_in(State::Configuring(Block::Period))
            }
            State::Paging => Err(Error::WrongPage { page: answer }),
            State::Configuring(block) => {
                let moves = self.address != self.config.settings().address;
                self.go_on_in(match block {
                    Block::Period => State::Configuring(Block::Map),
                    Block::Map => State::Configuring(Block::Histograms),
                    Block::Histograms if moves => State::Configuring(Block::Address),
                    Block::Address => State::Configuring(Block::AddressChange),
                    Block::Histograms | Block::AddressChange => {
                        State::Commanding(Command::WriteConfigPage)
                    }
                })
            }
            State::Unmasking { cleared: false } => {
                self.go_on_in(State::Unmasking { cleared: true })
            }
            State::Unmasking { cleared: true } => {
                self.go_on_in(State::Commanding(Command::Measure))
            }
            State::Measuring | State::Asking | State::Clearing { .. } | State::Reading { .. } => {
                self.serve(is_high, now_ms, sink)
            }
        }
    }

    pub(super) fn go_on_in<B, P>(&mut self, state: State) -> Next<B, P> {
        self.state = state;
        Ok(None)
    }

    fn wait_in<B, P>(&mut self, state: State, now_ms: u32) -> Next<B, P> {
        self.state = state;
        self.watch.restart(now_ms);
        Ok(Some(Polled::Working))
    }

    /// Stays idle until the time is over.
    fn wait_on<B, P>(&self, more_ms: u32, waiting: Waiting, now_ms: u32) -> Next<B, P> {
        let limit = self.config.settings().command_timeout_ms;
        let limit = limit.saturating_add(more_ms);
        self.watch.check_time(limit, waiting, now_ms)?;
        Ok(Some(Polled::Idle))
    }

    /// Waits for the processor.
    fn wake<B, P>(&mut self, enable: u8, now_ms: u32) -> Next<B, P> {
        if enable & CPU_READY != 0 {
            return self.go_on_in(State::Identifying);
        }
        let idle = self.wait_on(0, Waiting::PowerUp, now_ms)?;
        if enable & PON != 0 {
            return Ok(idle);
        }
        self.go_on_in(State::SwitchingOn { enable })
    }

    /// Takes the answer of the bootloader to `command` after `sent` bytes of the image.
    fn load_more<B, P>(&mut self, command: BootCommand, sent: usize, now_ms: u32) -> Next<B, P> {
        let [a, b, c, ..] = self.buffer;
        let answer = [a, b, c];
        match Answer::of(answer, command) {
            Answer::Busy => self.wait_on(0, Waiting::Bootloader(command), now_ms),
            Answer::Wrong => Err(DeviceError::Bootloader { command, answer }.into()),
            Answer::Done => {
                let command = match command {
                    BootCommand::DownloadInit => BootCommand::SetRamAddress,
                    _ if sent < self.image.len() => BootCommand::WriteRam,
                    _ => BootCommand::RamRemapReset,
                };
                self.go_on_in(State::Loading { command, sent })
            }
        }
    }

    /// Asks the application for its configuration page for the configured zones.
    fn show_page<B, P>(&mut self) -> Next<B, P> {
        self.go_on_in(State::Commanding(match self.config.settings().zones {
            Zones::Nine(_) => Command::LoadConfigPageCommon,
            Zones::SixtyFour => Command::Switch8x8,
        }))
    }

    fn commanded<B, P>(&mut self, command: Command, status: u8, now_ms: u32) -> Next<B, P> {
        if status != command.done() {
            if status < FIRST_COMMAND {
                return Err(Error::Refused { command, status });
            }
            return self.wait_on(0, Waiting::Command(command), now_ms);
        }
        if command == Command::Stop {
            self.may_measure = false;
        }
        match command {
            // It may still be in the 8×8 mode, which its packets do not show.
            Command::Stop if self.config.settings().zones != Zones::SixtyFour => {
                self.go_on_in(State::Switched)
            }
            Command::Stop => self.show_page(),
            Command::Switch8x8 => self.go_on_in(State::Switched),
            Command::LoadConfigPageCommon => self.go_on_in(State::Paging),
            Command::WriteConfigPage if self.address != self.config.settings().address => {
                self.go_on_in(State::Commanding(Command::I2cSlaveAddress))
            }
            Command::WriteConfigPage | Command::I2cSlaveAddress => {
                self.go_on_in(State::Unmasking { cleared: false })
            }
            Command::Measure => {
                self.assembly.restart();
                self.captures.restart();
                self.watch.clear_stuck();
                self.has_given = false;
                self.wait_in(State::Measuring, now_ms)
            }
        }
    }
}
