//! ams OSRAM TMF8820, TMF8821 and TMF8828: nine zones of raw 128-bin histograms
//! over I²C, at most 1 MHz; with a TMF8828 also 8×8 zones.
//!
//! The sensor's program is the vendor's and not part of this crate. Pass the bytes of
//! its RAM image to the driver, from RAM address 0x0000 on.
//! It is loaded when the bootloader runs; a sensor that already runs the
//! application is configured again and not loaded again.
//!
//! # Laser cycles
//!
//! Every laser pulse of a measurement is a laser cycle. A set of histograms ends
//! `kilo_iterations` × 1,024 of them, 549,888 with [`Settings::new`]. They end at the set's packet 0
//! and count even if the set is damaged later.
//!
//! The sensor pulses faster while it measures and then pauses until the next period. The laser
//! rate of [`SensorInfo`] is the mean, pulses of a measurement ÷ `period_ms`: 4.166 MHz with
//! [`Settings::new`]. Laser cycle ÷ rate is then a time, if a measurement is over within its
//! period, and the sensor's clock is right. With a period of 0 ms the rate is unknown.
//!
//! # 8×8 zones
//!
//! With [`Zones::SixtyFour`] a TMF8828 measures its zones in four captures of two halves. Only the
//! result after a capture tells which of the four it was. So the driver drops the histograms of the
//! first capture and assigns the next ones in turn; each result confirms them. If it does not, the poll
//! returns [`DeviceError::WrongCapture`] or [`DeviceError::OutOfOrder`], and the driver is in step again. If the
//! measurement ends with another error before the result, nothing confirms those of its last capture.
//! Zones are numbered row by row as in the vendor's examples; their place in space is not published.
//! The sensor's own targets come with each result ([`PhotonSink::target`]).
//!
//! The driver assumes that each half is one frame of `kilo_iterations` × 1,024 laser cycles; the
//! laser rate is unknown. It neither makes nor restores a crosstalk calibration. If a TMF8828
//! is in the 8×8 mode while nine zones are configured, the driver switches it off and on, after
//! [`DeviceError::WrongMode`].
//!
//! # Where the numbers come from
//!
//! Register addresses, fields, commands and status values are those of the
//! vendor's published headers (`tmf8x2x_application_registers.h`,
//! `tmf8x2x_config_page_common.h`), generated from the register description that
//! the data sheet DS000693 prints. From the vendor's drivers alone (`tmf8828.c`
//! for Arduino, `tmf8820_21_28_driver_python`), which have no table to cite:
//!
//! - the bootloader's messages, and the seed 0x29 of `DOWNLOAD_INIT`, which the
//!   newer drivers leave out;
//! - that a raw histogram comes as packets, and which is which, also of 8×8 zones;
//! - that an interrupt is cleared before its packet is read, and that the result
//!   interrupt is enabled along with the histogram interrupt;
//! - that the address changes by `I2C_SLAVE_ADDRESS`, `I2C_ADDR_CHANGE` = 0 and
//!   command 0x21, whose status is read at the new address;
//! - the value 0x08 of ID;
//! - the waits of 10 ms after ENABLE and after the start of the image.
//!
//! # Not supported
//!
//! - Time-multiplexed maps of 4×4 and 3×6 zones: their packets come in several
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
//! A wrong packet costs its set. After any other error while measuring the driver stops the sensor
//! and configures it again. If that fails too, or no packet comes, it switches the sensor off and on
//! and loads the image again.
//!
//! # Cost
//!
//! A packet takes 145 bytes on the bus, addresses included, and three more for
//! every chunk after the first: 3.3 ms at 400 kHz. A set has 30 of them.
//! The driver has 2.6 KiB of RAM for the counts of a set.

mod answers;
mod bootloader;
mod captures;
mod config;
mod error;
mod frame;
mod packets;
mod registers;
mod requests;

use dtof_core::fixed::types::{I24F8, U16F16};
use embedded_hal::digital::OutputPin;

use self::captures::Captures;
use self::frame::{Assembly, PACKET};
use self::registers::{CMD_STAT, DEFAULT_ADDRESS};
use self::requests::Block;
use crate::protocol::{Driver, Protocol, Request};
use crate::tmf::{Watch, count};
use crate::{PhotonSink, Polled, SensorInfo};

pub use self::config::{Config, Settings, SpadMap, Zones};
pub use self::error::{DeviceError, Error, Waiting};
pub use self::registers::{BootCommand, Command};
pub use crate::tmf::ConfigError;

/// Picoseconds a bin of nine zones. A fit of pulse positions to distances from 30 to 400 mm, in the public log of
/// one TMF8820, gives 13.80 mm a bin; the log's authors state 91 ps.
pub const BIN_WIDTH_PS: U16F16 = U16F16::lit("92.1");
/// Moves the ranges of the centre zone of that log to its ground truth from 30 to 400 mm.
pub const OFFSET_MM: I24F8 = I24F8::lit("-179.5");
/// Picoseconds a bin of 8×8 zones, from a fit to a short log of a TMF8828, which does not show the offset.
/// Others name 373.6 ps, 1.8 % less.
pub const BIN_WIDTH_8X8_PS: U16F16 = U16F16::lit("380.3");

/// ENABLE stays low this long when the sensor is switched off and on.
const RESET_MS: u32 = 5;
/// From ENABLE high to the first access.
const START_MS: u32 = 10;
/// From the start of the image to the first access.
const BOOT_MS: u32 = 10;

/// A TMF8820/21/28 on an I²C bus, with INT and ENABLE.
///
/// `CHUNK` is how many bytes of a packet or of the image go over the bus in one
/// transaction, 1 to 135 (checked when compiled; the
/// bootloader takes 128 at most). Another device on the bus may have to wait for that long.
pub type Tmf882x<'a, BUS, INT, EN, const CHUNK: usize = PACKET> =
    Driver<Tmf882xProtocol<'a, CHUNK>, BUS, INT, EN>;

/// The protocol of a TMF8820/21/28, with its image.
#[derive(Debug)]
pub struct Tmf882xProtocol<'a, const CHUNK: usize = PACKET> {
    image: &'a [u8],
    config: Config,
    /// The address it answers at now.
    address: u8,
    state: State,
    watch: Watch,
    /// The command to measure was sent; the sensor has neither answered a stop nor been reset since.
    may_measure: bool,
    /// A packet has come since it began to measure.
    has_given: bool,
    buffer: [u8; PACKET],
    assembly: Assembly,
    captures: Captures,
    counts: Counts,
}

/// Counts of the data so far. They stop at their largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counts {
    /// Histograms given to the sink.
    pub histograms: u32,
    /// Packets of raw histograms.
    pub packets: u32,
    /// Packets dropped while waiting for packet 0 of a set. With 8×8 zones also histograms whose
    /// zones are unknown.
    pub left_out: u32,
    /// Sets that broke off because a poll was dropped while it read a packet.
    pub broken: u32,
    /// Errors.
    pub errors: u32,
}

/// The next step: one transfer, or a wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Drive ENABLE high, or with `reset` first low.
    Off { reset: bool },
    /// ENABLE is low.
    Resetting,
    /// ENABLE is high.
    Starting,
    /// Read whether the processor is ready.
    Waking,
    /// It is not ready, and not switched on: switch it on.
    SwitchingOn { enable: u8 },
    /// Read which chip it is.
    Identifying,
    /// Read which program runs.
    Looking,
    /// Send a command to the bootloader; this much of the image has been sent.
    Loading { command: BootCommand, sent: usize },
    /// Read whether it is done.
    Loaded { command: BootCommand, sent: usize },
    /// Read whether the application runs.
    Booting,
    /// Send a command to the application.
    Commanding(Command),
    /// Read whether it is done.
    Commanded(Command),
    /// Read whether it has 8×8 zones.
    Switched,
    /// Read which page is shown.
    Paging,
    /// Write this part of the page.
    Configuring(Block),
    /// Clear the interrupts, then enable them.
    Unmasking { cleared: bool },
    /// Read INT.
    Measuring,
    /// INT is low: read why.
    Asking,
    /// Clear these reasons.
    Clearing { reasons: u8 },
    /// Read a packet from this byte on.
    Reading { at: u8 },
}

impl<'a, BUS, INT, EN: OutputPin, const CHUNK: usize> Tmf882x<'a, BUS, INT, EN, CHUNK> {
    /// A driver that has not accessed its device yet. `image` may be empty for a
    /// sensor that already runs the application. ENABLE low ends the application: start the driver before its first
    /// poll.
    pub const fn new(
        bus: BUS,
        interrupt: INT,
        enable: EN,
        image: &'a [u8],
        config: Config,
    ) -> Self {
        let protocol = Tmf882xProtocol::new(image, config);
        Self::of(protocol, bus, interrupt, enable)
    }

    /// Counts of the data so far.
    pub const fn counts(&self) -> Counts {
        self.protocol().counts
    }

    /// The I²C address the sensor answers at now.
    pub const fn address(&self) -> u8 {
        self.protocol().address
    }
}

impl<'a, const CHUNK: usize> Tmf882xProtocol<'a, CHUNK> {
    /// The protocol of a device that was not accessed yet.
    #[must_use]
    pub const fn new(image: &'a [u8], config: Config) -> Self {
        const {
            assert!(CHUNK >= 1 && CHUNK <= PACKET, "CHUNK must be from 1 to 135");
        };
        Self {
            image,
            config,
            address: DEFAULT_ADDRESS,
            // A sensor with its own address may answer there or at 0x41: a reset makes sure.
            state: State::Off {
                reset: config.settings().address != DEFAULT_ADDRESS,
            },
            watch: Watch::new(),
            may_measure: false,
            has_given: false,
            buffer: [0; PACKET],
            assembly: Assembly::new(),
            captures: Captures::new(),
            counts: Counts {
                histograms: 0,
                packets: 0,
                left_out: 0,
                broken: 0,
                errors: 0,
            },
        }
    }

    /// Counts of the data so far.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// Abandons the measurement. Only a sensor that measures is known to work; others are reset.
    fn give_up(&mut self) {
        self.state = State::Off {
            reset: !self.is_measuring(),
        };
    }
}

impl<const CHUNK: usize> Protocol for Tmf882xProtocol<'_, CHUNK> {
    type Error<B, P> = Error<B, P>;

    fn info(&self) -> SensorInfo {
        self.config.info()
    }

    fn is_measuring(&self) -> bool {
        matches!(
            self.state,
            State::Measuring | State::Asking | State::Clearing { .. } | State::Reading { .. }
        )
    }

    fn is_reset_next(&self) -> bool {
        matches!(self.state, State::Off { reset: true })
    }

    fn restart(&mut self) {
        if !matches!(self.state, State::Off { .. }) {
            self.give_up();
        }
    }

    fn reset(&mut self) {
        self.state = State::Off { reset: true };
    }

    fn dropped(&mut self) {
        match self.state {
            // Reading and clearing the reasons can be repeated.
            State::Asking | State::Clearing { .. } => return,
            State::Reading { .. } => count(&mut self.counts.broken),
            _ => {}
        }
        self.restart();
    }

    fn stop(&mut self) -> Request<'_> {
        self.restart();
        if self.may_measure {
            self.write(&[CMD_STAT, Command::Stop as u8])
        } else {
            Request::Nothing(Polled::Idle)
        }
    }

    fn request(&mut self, now_ms: u32) -> Request<'_> {
        self.next_request(now_ms)
    }

    fn answered<B, P>(
        &mut self,
        is_high: bool,
        now_ms: u32,
        sink: &mut impl PhotonSink,
    ) -> Result<Option<Polled>, Error<B, P>> {
        self.take_answer(is_high, now_ms, sink)
    }

    fn failed<B, P>(&mut self, error: &Error<B, P>) {
        count(&mut self.counts.errors);
        match error {
            Error::Device(
                DeviceError::ForeignResult { .. }
                | DeviceError::WrongSize { .. }
                | DeviceError::OutOfOrder { .. }
                | DeviceError::WrongCapture { .. },
            ) => {}
            // Stopping and configuring it again has not helped before.
            Error::Timeout(Waiting::Data) if !self.has_given => {
                self.state = State::Off { reset: true };
            }
            _ => self.give_up(),
        }
    }
}
