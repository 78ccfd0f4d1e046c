//! ams OSRAM TMF8820, TMF8821 and TMF8828: nine zones of raw 128-bin histograms
//! over I²C, at most 1 MHz.
//!
//! The sensor's program is the vendor's and not part of this crate. Pass the bytes of
//! its RAM image to the driver, from RAM address 0x0000 on.
//! It is loaded when the bootloader runs; a sensor that already runs the
//! application is configured anew and not loaded again.
//!
//! # Laser cycles
//!
//! Every laser pulse of a measurement is a laser cycle. So a set of histograms ends
//! `kilo_iterations` × 1,024 of them, 549,888 with [`Settings::new`], all for the same end. They
//! end at the set's packet 0: a set that is damaged behind it has still lasted.
//!
//! The sensor pulses faster while it measures, and rests until the next period. The laser
//! rate of [`About`] is the mean, pulses of a measurement ÷ `period_ms`: 4.166 MHz with
//! [`Settings::new`]. Laser cycle ÷ rate is then a time, if a measurement is over within its
//! period, and the sensor's clock is right. A period of 0 ms has no rate that is known.
//!
//! # Where the numbers come from
//!
//! Register addresses, fields, commands and status values are those of the
//! vendor's published headers (`tmf8x2x_application_registers.h`,
//! `tmf8x2x_config_page_common.h`), generated from the register description that
//! the data sheet DS000693 prints. From the vendor's drivers alone (`tmf8828.c`
//! for Arduino, `tmf8820_21_28_driver_python`), with no table to name:
//!
//! - the bootloader's messages, and the seed 0x29 of `DOWNLOAD_INIT`, which the
//!   newer drivers leave out;
//! - that a raw histogram comes as packets, and which is which;
//! - that an interrupt is cleared before its packet is read, and that the result
//!   interrupt is enabled along with the histogram interrupt;
//! - that the address changes by `I2C_SLAVE_ADDRESS`, `I2C_ADDR_CHANGE` = 0 and
//!   command 0x21, whose status is read at the new address;
//! - the value 0x08 of ID;
//! - the waits of 10 ms after ENABLE and after the start of the image.
//!
//! # Not supported
//!
//! - Time-multiplexed maps (4×4, 3×6, 8×8): their packets come in several
//!   measurements that this driver does not tell apart.
//! - The total size in a packet's header is not checked; how it counts down is
//!   not documented precisely enough.
//!
//! # Several sensors on a bus
//!
//! After power-up each answers at 0x41. Give each an address of its own and its
//! own ENABLE, low at first, and poll them up one after the other, each until
//! [`Tmf882x::is_measuring`]. A sensor that has to be switched off and on again
//! goes back to 0x41 for some 20 ms and its loading time, so no sensor may keep
//! that address.
//!
//! # After an error
//!
//! A packet that is wrong costs its set. Any other error while measuring stops
//! and configures the sensor anew; an error while that is going on switches it
//! off and on and loads the image again.
//!
//! # Cost
//!
//! A packet takes 145 bytes on the bus, addresses included, and three more for
//! every chunk after the first: 3.3 ms at 400 kHz. A set has 30 of them.
//! The driver has 2.6 KiB of RAM for the counts of a set.

mod bootloader;
mod bring_up;
mod config;
mod error;
mod frame;
mod packets;
mod registers;

use dtof_core::fixed::types::{I24F8, U16F16};
use embedded_hal::digital::{ErrorType as PinErrorType, InputPin, OutputPin};
use embedded_hal::i2c::{ErrorKind, ErrorType, I2c, NoAcknowledgeSource};

use self::bootloader::Answer;
use self::frame::{Assembly, PACKET};
use self::registers::{APPID, APPLICATION, CMD_STAT, DEFAULT_ADDRESS, FIRST_COMMAND};
use crate::timer::Since;
use crate::{About, PhotonSink, Polled, Sensor};

pub use self::config::{Config, ConfigError, Settings, SpadMap};
pub use self::error::{Error, Waiting};
pub use self::registers::{BootCommand, Command};

/// ENABLE stays low this long when the sensor is switched off and on.
const RESET_MS: u32 = 5;
/// From ENABLE high to the first access.
const START_MS: u32 = 10;
/// From the start of the image to the first access.
const BOOT_MS: u32 = 10;

/// A TMF8820/21/28 on an I²C bus, with INT and ENABLE, and its image.
///
/// `CHUNK` is how many bytes of a packet or of the image go over the bus in one
/// transaction, 1 to 135 (checked when compiled; the
/// bootloader takes 128 at most): what another device on the bus
/// may have to wait for.
#[derive(Debug)]
pub struct Tmf882x<'a, I2C, INT, EN, const CHUNK: usize = PACKET> {
    i2c: I2C,
    interrupt: INT,
    enable: EN,
    image: &'a [u8],
    config: Config,
    /// The address it answers at now.
    address: u8,
    state: State,
    assembly: Assembly,
    counts: Counts,
}

/// Counts of the data so far. Each sticks at `u32::MAX`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counts {
    /// Histograms given to the sink.
    pub histograms: u32,
    /// Packets of raw histograms.
    pub packets: u32,
    /// Packets left out while waiting for packet 0 of a set.
    pub left_out: u32,
    /// Errors.
    pub errors: u32,
}

/// The state of the driver: each waits for something else.
#[derive(Clone, Copy, Debug)]
enum State {
    /// Nothing: to be switched on, or off and on again.
    Off { reset: bool },
    /// ENABLE is low.
    Resetting { since: Since },
    /// ENABLE is high, nothing is asked yet.
    Starting { since: Since },
    /// The processor is to be ready.
    Waking { since: Since },
    /// The bootloader is at work; this much of the image has been sent.
    Loading {
        since: Since,
        command: BootCommand,
        sent: usize,
    },
    /// The image was started.
    Booting { since: Since },
    /// The application is at work.
    Commanded { since: Since, command: Command },
    /// Packets come. `stuck` polls found INT low for no reason.
    Measuring { since: Since, stuck: u8 },
}

type Result<T, I2C, INT> =
    core::result::Result<T, Error<<I2C as ErrorType>::Error, <INT as PinErrorType>::Error>>;

impl<'a, I2C, INT, EN, const CHUNK: usize> Tmf882x<'a, I2C, INT, EN, CHUNK>
where
    I2C: I2c,
    INT: InputPin,
    EN: OutputPin + PinErrorType<Error = INT::Error>,
{
    /// A driver that has not touched its device yet. `image` may be empty for a
    /// sensor that already runs the application.
    pub const fn new(
        i2c: I2C,
        interrupt: INT,
        enable: EN,
        image: &'a [u8],
        config: Config,
    ) -> Self {
        const {
            assert!(CHUNK >= 1 && CHUNK <= PACKET, "CHUNK must be from 1 to 135");
        };
        Self {
            i2c,
            interrupt,
            enable,
            image,
            config,
            address: DEFAULT_ADDRESS,
            // With an address of its own it may answer at that or at 0x41, so
            // that only a reset makes sure.
            state: State::Off {
                reset: config.settings().address != DEFAULT_ADDRESS,
            },
            assembly: Assembly::new(),
            counts: Counts {
                histograms: 0,
                packets: 0,
                left_out: 0,
                errors: 0,
            },
        }
    }

    /// Counts of the data so far.
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// The I²C address the sensor answers at now.
    pub const fn address(&self) -> u8 {
        self.address
    }

    /// Whether the sensor is up.
    pub const fn is_measuring(&self) -> bool {
        matches!(self.state, State::Measuring { .. })
    }

    /// Gives the bus and the pins (INT, ENABLE) back.
    pub fn release(self) -> (I2C, INT, EN) {
        (self.i2c, self.interrupt, self.enable)
    }

    /// Where to begin again: only a sensor that measures is known to be well.
    const fn off(&self) -> State {
        match self.state {
            State::Off { reset } => State::Off { reset },
            State::Measuring { .. } => State::Off { reset: false },
            _ => State::Off { reset: true },
        }
    }

    fn step(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, I2C, INT> {
        let now = Since::new(now_ms);
        let limit = self.config.settings().command_timeout_ms;
        match self.state {
            State::Off { reset: false } => {
                self.enable.set_high().map_err(Error::Pin)?;
                self.state = State::Starting { since: now };
            }
            State::Off { reset: true } => {
                self.enable.set_low().map_err(Error::Pin)?;
                self.address = DEFAULT_ADDRESS;
                self.state = State::Resetting { since: now };
            }
            State::Resetting { since } => {
                if !since.is_over(RESET_MS, now_ms) {
                    return Ok(Polled::Idle);
                }
                self.enable.set_high().map_err(Error::Pin)?;
                self.state = State::Starting { since: now };
            }
            State::Starting { since } => {
                if !since.is_over(START_MS, now_ms) {
                    return Ok(Polled::Idle);
                }
                self.state = State::Waking { since: now };
            }
            State::Waking { since } => return self.wake(since, now_ms),
            State::Loading {
                since,
                command,
                sent,
            } => {
                let answer = self.read_register(CMD_STAT)?;
                match Answer::of(answer, command) {
                    Answer::Done => self.load_more(command, sent, now)?,
                    Answer::Busy if !since.is_over(limit, now_ms) => return Ok(Polled::Idle),
                    Answer::Busy => return Err(Error::Timeout(Waiting::Bootloader(command))),
                    Answer::Wrong => return Err(Error::Bootloader { command, answer }),
                }
            }
            State::Booting { since } => {
                if !since.is_over(BOOT_MS, now_ms) {
                    return Ok(Polled::Idle);
                }
                let [id] = self.read_register(APPID)?;
                if id == APPLICATION {
                    self.command(Command::LoadConfigPageCommon, now)?;
                } else if since.is_over(BOOT_MS.saturating_add(limit), now_ms) {
                    return Err(Error::Timeout(Waiting::Application));
                } else {
                    return Ok(Polled::Idle);
                }
            }
            State::Commanded { since, command } => {
                let [status] = self.read_register(CMD_STAT)?;
                if status == command.done() {
                    self.go_on_after(command, now)?;
                } else if status < FIRST_COMMAND {
                    return Err(Error::Refused { command, status });
                } else if since.is_over(limit, now_ms) {
                    return Err(Error::Timeout(Waiting::Command(command)));
                } else {
                    return Ok(Polled::Idle);
                }
            }
            State::Measuring { since, stuck } => return self.serve(since, stuck, now_ms, sink),
        }
        Ok(Polled::Working)
    }

    fn read_register<const N: usize>(&mut self, register: u8) -> Result<[u8; N], I2C, INT> {
        let mut bytes = [0; N];
        self.i2c
            .write_read(self.address, &[register], &mut bytes)
            .map_err(bus_error)?;
        Ok(bytes)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), I2C, INT> {
        self.i2c.write(self.address, bytes).map_err(bus_error)
    }
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

/// A device that does not acknowledge a byte has acknowledged its address, so it is there.
fn bus_error<B: embedded_hal::i2c::Error, P>(error: B) -> Error<B, P> {
    use NoAcknowledgeSource::{Address, Unknown};
    match error.kind() {
        ErrorKind::NoAcknowledge(Address | Unknown) => Error::Nack(error),
        _ => Error::Bus(error),
    }
}

impl<I2C, INT, EN, const CHUNK: usize> Sensor for Tmf882x<'_, I2C, INT, EN, CHUNK>
where
    I2C: I2c,
    INT: InputPin,
    EN: OutputPin + PinErrorType<Error = INT::Error>,
{
    type Error = Error<I2C::Error, INT::Error>;

    /// Bin width and offset are those fitted to the public log of one TMF8820. The laser rate is
    /// the mean over a period.
    fn about(&self) -> About {
        const ZONES: u16 = 9;
        const BIN_WIDTH: U16F16 = U16F16::lit("92.1");
        const OFFSET: I24F8 = I24F8::lit("-179.5");
        About {
            pixels: self.config.settings().first_pixel.0.saturating_add(ZONES),
            bin_width: Some(BIN_WIDTH),
            bins: 128,
            offset: OFFSET,
            is_whole: true,
            laser_millihertz: self.config.laser_millihertz(),
        }
    }

    fn start(&mut self, _: U16F16) {
        self.state = self.off();
    }

    /// Tells the sensor to stop; if that fails, the next start sees to it.
    fn stop(&mut self) {
        if self.is_measuring() {
            let _ = self.write(&[CMD_STAT, Command::Stop as u8]);
        }
        self.state = self.off();
    }

    fn poll(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, I2C, INT> {
        let was_measuring = self.is_measuring();
        let polled = self.step(now_ms, sink);
        if let Err(error) = &polled {
            count(&mut self.counts.errors);
            self.state = match error {
                Error::ForeignResult { .. }
                | Error::WrongSize { .. }
                | Error::OutOfOrder { .. } => self.state,
                _ => State::Off {
                    reset: !was_measuring,
                },
            };
        }
        polled
    }
}
