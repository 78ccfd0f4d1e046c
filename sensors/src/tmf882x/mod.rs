//! ams OSRAM TMF8820, TMF8821 and TMF8828: nine zones of raw 128-bin histograms
//! over I²C, at most 1 MHz; with a TMF8828 also 8×8 zones.
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
//! # 8×8 zones
//!
//! With [`Zones::SixtyFour`] a TMF8828 measures its zones in four captures of two halves. Only the
//! result behind a capture says which of the four it was. So the histograms of the first capture are
//! left out, those of the next ones are given as what is due, and each result confirms them. If it does
//! not, [`Error::WrongCapture`] or [`Error::OutOfOrder`] says so, and the driver knows again from there.
//! Zones are numbered row by row as in the vendor's examples; how they lie in space is not published.
//! Targets of the sensor come with each result ([`PhotonSink::target`]).
//!
//! Each half is one frame of `kilo_iterations` × 1,024 laser cycles. That is assumed, and
//! the laser rate is not known. The crosstalk calibration is neither made nor restored. A TMF8828
//! that is in the 8×8 mode when nine zones are wanted is switched off and on, after
//! [`Error::WrongMode`].
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
//! A packet that is wrong costs its set. Any other error while measuring stops
//! and configures the sensor anew; an error while that is going on, or no packet
//! after it, switches it off and on and loads the image again.
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

use self::captures::Captures;
use self::frame::{Assembly, PACKET};
use self::registers::{CMD_STAT, DEFAULT_ADDRESS};
use self::requests::Block;
use crate::protocol::{Driver, Protocol, Request};
use crate::timer::Since;
use crate::{About, PhotonSink, Polled};

pub use self::config::{Config, ConfigError, Settings, SpadMap, Zones};
pub use self::error::{Error, Waiting};
pub use self::registers::{BootCommand, Command};

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
/// bootloader takes 128 at most): what another device on the bus
/// may have to wait for.
pub type Tmf882x<'a, I2C, INT, EN, const CHUNK: usize = PACKET> =
    Driver<Tmf882xProtocol<'a, CHUNK>, I2C, INT, EN>;

/// The protocol of a TMF8820/21/28, with its image.
#[derive(Debug)]
pub struct Tmf882xProtocol<'a, const CHUNK: usize = PACKET> {
    image: &'a [u8],
    config: Config,
    /// The address it answers at now.
    address: u8,
    state: State,
    /// When the present wait began.
    since: Since,
    /// Polls in a row with INT low for no reason.
    stuck: u8,
    /// A packet was taken since it began to measure.
    has_given: bool,
    buffer: [u8; PACKET],
    assembly: Assembly,
    captures: Captures,
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
    /// Packets left out while waiting for packet 0 of a set. With 8×8 zones also histograms while it
    /// is not known of which zones they are.
    pub left_out: u32,
    /// Errors.
    pub errors: u32,
}

/// What is to be done next. Each is one transfer, or a wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// ENABLE is to be driven high, or before that low.
    Off { reset: bool },
    /// ENABLE is low.
    Resetting,
    /// ENABLE is high, nothing is asked yet.
    Starting,
    /// Whether the processor is ready.
    Waking,
    /// It is not, nor switched on.
    SwitchingOn { enable: u8 },
    /// Which chip is it?
    Identifying,
    /// Which program runs?
    Looking,
    /// The bootloader is to be told; this much of the image has been sent.
    Loading { command: BootCommand, sent: usize },
    /// Whether it has done so.
    Loaded { command: BootCommand, sent: usize },
    /// Whether the application runs.
    Booting,
    /// The application is to be told.
    Commanding(Command),
    /// Whether it has done so.
    Commanded(Command),
    /// Whether it has 8×8 zones, as it should or should not.
    Switched,
    /// Which page is shown?
    Paging,
    /// This part of it is to be written.
    Configuring(Block),
    /// Interrupts are to be cleared, and then enabled.
    Unmasking { cleared: bool },
    /// Whether INT is low.
    Measuring,
    /// Why it is.
    Asking,
    /// These reasons are to be cleared.
    Clearing { reasons: u8 },
    /// A packet comes, from this byte on.
    Reading { at: u8 },
}

impl<'a, I2C, INT, EN, const CHUNK: usize> Tmf882x<'a, I2C, INT, EN, CHUNK> {
    /// A driver that has not touched its device yet. `image` may be empty for a
    /// sensor that already runs the application.
    pub const fn new(
        i2c: I2C,
        interrupt: INT,
        enable: EN,
        image: &'a [u8],
        config: Config,
    ) -> Self {
        let protocol = Tmf882xProtocol::new(image, config);
        Self::of(protocol, i2c, interrupt, enable)
    }

    /// Counts of the data so far.
    pub const fn counts(&self) -> Counts {
        self.protocol().counts
    }

    /// The I²C address the sensor answers at now.
    pub const fn address(&self) -> u8 {
        self.protocol().address
    }

    /// Whether the sensor is up.
    pub const fn is_measuring(&self) -> bool {
        self.protocol().is_measuring()
    }
}

impl<'a, const CHUNK: usize> Tmf882xProtocol<'a, CHUNK> {
    /// Of a device that was not touched yet.
    #[must_use]
    pub const fn new(image: &'a [u8], config: Config) -> Self {
        const {
            assert!(CHUNK >= 1 && CHUNK <= PACKET, "CHUNK must be from 1 to 135");
        };
        Self {
            image,
            config,
            address: DEFAULT_ADDRESS,
            // With an address of its own it may answer at that or at 0x41, so
            // that only a reset makes sure.
            state: State::Off {
                reset: config.settings().address != DEFAULT_ADDRESS,
            },
            since: Since::new(0),
            stuck: 0,
            has_given: false,
            buffer: [0; PACKET],
            assembly: Assembly::new(),
            captures: Captures::new(),
            counts: Counts {
                histograms: 0,
                packets: 0,
                left_out: 0,
                errors: 0,
            },
        }
    }

    /// Counts of the data so far.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// Whether the sensor is up.
    #[must_use]
    pub const fn is_measuring(&self) -> bool {
        matches!(
            self.state,
            State::Measuring | State::Asking | State::Clearing { .. } | State::Reading { .. }
        )
    }

    /// Where to begin again: only a sensor that measures is known to be well.
    const fn give_up(&mut self) {
        self.state = State::Off {
            reset: !self.is_measuring(),
        };
    }
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

impl<const CHUNK: usize> Protocol for Tmf882xProtocol<'_, CHUNK> {
    type Error<B, P> = Error<B, P>;

    /// Bin width and offset are those fitted to the public log of one TMF8820, and with 8×8 zones
    /// to a short one of a TMF8828, which says nothing of the offset. The laser rate is the mean
    /// over a period.
    fn about(&self) -> About {
        const BIN_WIDTH: U16F16 = U16F16::lit("92.1");
        const BIN_WIDTH_8X8: U16F16 = U16F16::lit("380.3");
        const OFFSET: I24F8 = I24F8::lit("-179.5");
        let settings = self.config.settings();
        let (bin_width, offset) = match settings.zones {
            Zones::Nine(_) => (BIN_WIDTH, OFFSET),
            Zones::SixtyFour => (BIN_WIDTH_8X8, I24F8::ZERO),
        };
        About {
            pixels: self.config.pixels(),
            bin_width: Some(bin_width),
            bins: 128,
            offset,
            is_whole: true,
            laser_millihertz: self.config.laser_millihertz(),
        }
    }

    fn restart(&mut self) {
        if !matches!(self.state, State::Off { .. }) {
            self.give_up();
        }
    }

    fn stop(&mut self) -> Request<'_> {
        let was_measuring = self.is_measuring();
        self.restart();
        if was_measuring {
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
            Error::ForeignResult { .. }
            | Error::WrongSize { .. }
            | Error::OutOfOrder { .. }
            | Error::WrongCapture { .. } => {}
            // To stop it and to begin again would bring no packet either.
            Error::Timeout(Waiting::Histogram) if !self.has_given => {
                self.state = State::Off { reset: true };
            }
            _ => self.give_up(),
        }
    }
}
