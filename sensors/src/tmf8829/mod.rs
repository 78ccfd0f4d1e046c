//! ams OSRAM TMF8829: 8×8 to 48×32 zones of raw histograms over I²C, at most 1 MHz, or SPI, at most
//! 20 MHz.
//!
//! The sensor's program is the vendor's and not part of this crate. Pass the bytes of its image to
//! the driver. It is loaded when the bootloader runs; a sensor that already runs the application
//! is configured again and not loaded again.
//!
//! # Histograms
//!
//! A measurement has 2 to 12 time slots ([`Zones::frames`]). The sensor sends a frame of histograms
//! for each, and waits until it is read. The driver passes a histogram on as soon as its last byte
//! is read, so it needs room for one only. Bins behind those of the preset are 0: [`SensorInfo`] says how many
//! bins are measured and how wide they are.
//!
//! | preset | bins | width |
//! |---|---|---|
//! | standard | 54 | 814.6 ps |
//! | long range, 8×8 zones | 104 | 814.6 ps |
//! | high accuracy | 64 | 203.65 ps |
//! | high accuracy, 8×8 zones | 109 | 407.3 ps |
//!
//! The last one has 218 bins of 203.65 ps, more than a histogram holds: the driver adds pairs of bins.
//! A count in a bin that a histogram does not hold is in [`Counts::beyond`].
//!
//! Pixels follow the sensor's own zones row by row, the first row on top. Lenses mirror the scene
//! from left to right, as seen from the sensor; the driver does not turn it.
//!
//! After its histograms the sensor reports the targets that it has found itself
//! ([`PhotonSink::target`]). [`snr`] converts their confidence. Their distances are not
//! corrected for the sensor's clock.
//!
//! # Time zero
//!
//! The offset in [`SensorInfo`] was fitted to a public log of one sensor with the standard preset: pulses
//! then lie at the sensor's own distances, 0.26 to 2.85 m, 3.2 mm off in the median and 16.7 mm at
//! 95 %. In the same log the detector beside the laser sees its pulse within 12 mm of there.
//!
//! No log covers the other presets. The driver assumes the same offset for them; the shorter pulse
//! of high accuracy may shift it by some centimetres. Measure yours with a target at a known distance.
//!
//! The four reference histograms of each frame come from the detector beside the laser and show the
//! present time zero. [`Settings::reference`] enables them.
//!
//! # Laser cycles
//!
//! Every laser pulse is a laser cycle. The pulses of a measurement, `kilo_iterations` × 1,024, are
//! divided among its time slots, and a frame of histograms ends those of its slot. No
//! source documents this; the time stamps of recorded frames agree. The laser rate is the mean over a period, if the
//! bus is fast enough for it: a frame of histograms takes 0.6 s at 400 kHz, and the sensor waits.
//! Periods of 33 ms were 31.5 ms long with two sensors, so the rate may be 5 % low.
//!
//! # Where the numbers come from
//!
//! The data sheet DS001140, the application note AN001096, and where these are incomplete or
//! wrong the vendor's published drivers: the upload (0x45, least significant byte first), the
//! identifications of frames, and that no command has a checksum.
//!
//! # Not supported
//!
//! I3C; two measurements in turn (dual mode); detection of motion; standby.
//!
//! # Bus
//!
//! A bus that is an `I2c` needs [`Interface::I2c`] in the settings, which is the default; [`Spi`] needs
//! [`Settings::over_spi`]. A measurement with 16×16 zones then takes the bus, with chunks of 128 bytes:
//!
//! | bus | time |
//! |---|---|
//! | I²C, 400 kHz | 1.21 s |
//! | I²C, 1 MHz | 0.48 s |
//! | SPI, 10.5 MHz | 40.8 ms |
//! | SPI, 20 MHz | 21.4 ms |
//!
//! The pulses of the standard preset take 31 ms. Over SPI, SCL has to be high until the bootloader has
//! switched I²C off: connect it to VIO. Over I²C the same holds for CSN.
//!
//! # Several sensors on a bus
//!
//! With SPI each has its own CSN. On I²C, as with the TMF8820: give each an address of its own and its own ENABLE, low at first, and
//! poll them up one after the other, each until [`Tmf8829::is_measuring`].
//!
//! # After an error
//!
//! Missed frames and frames that are marked as not valid are reported as errors, and the measurement
//! goes on. After any other error while measuring the driver stops the sensor and configures it again.
//! After an error before the first whole frame it switches the sensor off and on and loads the image
//! again. The first histograms of a frame that breaks off have been given.
//!
//! # Cost
//!
//! The driver has less than 1 KiB of RAM. A poll has one chunk of the FIFO on the bus, or at most eight
//! short transfers.

mod answers;
mod config;
mod error;
mod frame;
mod registers;
mod requests;
mod snr;
mod spi;
mod stream;
mod zones;

use dtof_core::fixed::types::I24F8;
use embedded_hal::digital::OutputPin;

use self::registers::DEFAULT_ADDRESS;
use self::stream::Stream;
use crate::protocol::{Driver, Protocol, Request};
use crate::tmf::{Watch, count};
use crate::{PhotonSink, Polled, SensorInfo};

pub use self::config::{Config, Interface, Results, Settings};
pub use self::error::{DeviceError, Error, Waiting};
pub use self::registers::{BootCommand, Command};
pub use self::snr::snr;
pub use self::spi::Spi;
pub use self::zones::{FINEST_BIN_PS, Preset, Zones};
pub use crate::tmf::ConfigError;

/// Millimetres that move pulses to the sensor's own distances, from a fit to a public log, within 0.2 mm. The reference
/// pulses of the same log agree within 12 mm.
pub const OFFSET_MM: I24F8 = I24F8::lit("-439.4");

/// ENABLE stays low this long when the sensor is switched off and on.
const RESET_MS: u32 = 3;
/// From ENABLE high to the first access.
const START_MS: u32 = 3;
/// From the start of the image to the first access.
const BOOT_MS: u32 = 10;
/// The most bytes of an image: the bootloader counts 0x1000 words.
const MAX_IMAGE: usize = 4 * 0x1000;
/// Room for a transfer: the register, and as many bytes as a chunk may have.
const BUFFER: usize = 256;

/// A TMF8829 on a [bus](crate::protocol::Bus), with INT and ENABLE.
///
/// `CHUNK` is how many bytes of a frame or of the image go over the bus in one transaction, 4 to
/// 252 in steps of 4 (checked when compiled). Another device on the bus may have to wait for that
/// long. The header of a frame always has 21.
pub type Tmf8829<'a, BUS, INT, EN, const CHUNK: usize = 128> =
    Driver<Tmf8829Protocol<'a, CHUNK>, BUS, INT, EN>;

/// The protocol of a TMF8829, with its image.
#[derive(Debug)]
pub struct Tmf8829Protocol<'a, const CHUNK: usize = 128> {
    image: &'a [u8],
    config: Config,
    /// The address it answers at now.
    address: u8,
    state: State,
    watch: Watch,
    /// The command to measure was sent; the sensor has neither answered a stop nor been reset since.
    may_measure: bool,
    /// A whole frame has come since it began to measure.
    has_given: bool,
    /// The frame that should come next, once one has come.
    next: Option<u32>,
    buffer: [u8; BUFFER],
    stream: Stream,
    counts: Counts,
}

/// Counts of the data so far. They stop at their largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counts {
    /// Histograms that were given, references included.
    pub histograms: u32,
    /// Frames that began, of histograms and of results.
    pub frames: u32,
    /// Of these, frames that broke off.
    pub broken: u32,
    /// Of these, frames that the sensor aborted or marks as not valid.
    pub aborted: u32,
    /// Of these, frames with SPADs overloaded or the laser at its limit.
    pub limited: u32,
    /// Missed frames: by their numbers, or because a poll was dropped while it read the header.
    pub missed: u32,
    /// Photons in bins that a histogram does not hold.
    pub beyond: u64,
    /// All errors.
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
    /// Send a command to the bootloader.
    BootCommanding(BootCommand),
    /// Read whether it is done.
    BootCommanded(BootCommand),
    /// Send the image from this byte on.
    Uploading { sent: u16 },
    /// Read whether the image is complete.
    Uploaded,
    /// Read whether the application runs.
    Booting,
    /// Make resets start the application.
    Keeping,
    /// Send a command to the application.
    Commanding(Command),
    /// Read whether it is done.
    Commanded(Command),
    /// Read whether the preset is loaded.
    Paging,
    /// Write this block of the configuration.
    Configuring(u8),
    /// Read INT.
    Measuring,
    /// INT is low: read why.
    Asking,
    /// Clear these reasons.
    Clearing { reasons: u8 },
    /// Read the header of a frame.
    Beginning,
    /// Read the rest of the frame.
    Reading,
}

impl<'a, BUS, INT, EN: OutputPin, const CHUNK: usize> Tmf8829<'a, BUS, INT, EN, CHUNK> {
    /// A driver that has not accessed its device yet. `image` may be empty for a sensor that
    /// already runs the application. ENABLE low ends the application: start the driver before its first poll.
    pub const fn new(
        bus: BUS,
        interrupt: INT,
        enable: EN,
        image: &'a [u8],
        config: Config,
    ) -> Self {
        Self::of(Tmf8829Protocol::new(image, config), bus, interrupt, enable)
    }

    /// Counts of the data so far.
    pub const fn counts(&self) -> Counts {
        self.protocol().counts
    }

    /// The I²C address the sensor answers at now; with SPI it has none.
    pub const fn address(&self) -> u8 {
        self.protocol().address
    }
}

impl<'a, const CHUNK: usize> Tmf8829Protocol<'a, CHUNK> {
    /// The protocol of a device that was not accessed yet.
    #[must_use]
    pub const fn new(image: &'a [u8], config: Config) -> Self {
        const {
            assert!(
                CHUNK >= 4 && CHUNK < BUFFER && CHUNK.is_multiple_of(4),
                "CHUNK must be from 4 to 252, in fours"
            );
        };
        Self {
            image,
            config,
            address: DEFAULT_ADDRESS,
            // A sensor with its own address may answer there or at 0x41: a reset makes sure.
            state: State::Off {
                reset: config.settings().interface.address() != DEFAULT_ADDRESS,
            },
            watch: Watch::new(),
            may_measure: false,
            has_given: false,
            next: None,
            buffer: [0; BUFFER],
            stream: Stream::new(),
            counts: Counts {
                histograms: 0,
                frames: 0,
                broken: 0,
                aborted: 0,
                limited: 0,
                missed: 0,
                beyond: 0,
                errors: 0,
            },
        }
    }

    /// Counts of the data so far.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// Abandons the measurement and begins again, with a reset or without.
    fn give_up(&mut self, reset: bool) {
        if self.state == State::Reading {
            count(&mut self.counts.broken);
        }
        self.state = State::Off { reset };
    }
}

impl<const CHUNK: usize> Protocol for Tmf8829Protocol<'_, CHUNK> {
    type Error<B, P> = Error<B, P>;

    fn info(&self) -> SensorInfo {
        self.config.info()
    }

    fn is_measuring(&self) -> bool {
        matches!(
            self.state,
            State::Measuring
                | State::Asking
                | State::Clearing { .. }
                | State::Beginning
                | State::Reading
        )
    }

    fn is_reset_next(&self) -> bool {
        matches!(self.state, State::Off { reset: true })
    }

    fn restart(&mut self) {
        if !matches!(self.state, State::Off { .. }) {
            self.give_up(!self.is_measuring());
        }
    }

    fn reset(&mut self) {
        self.give_up(true);
    }

    fn dropped(&mut self) {
        match self.state {
            // Reading and clearing the reasons can be repeated.
            State::Asking | State::Clearing { .. } => return,
            // The sensor may have sent the header, and its number with it.
            State::Beginning => self.counts.missed = self.counts.missed.saturating_add(1),
            _ => {}
        }
        self.restart();
    }

    fn stop(&mut self) -> Request<'_> {
        self.restart();
        if self.may_measure {
            self.stop_request()
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
        if !matches!(
            error,
            Error::Device(DeviceError::Missed { .. } | DeviceError::Aborted { .. })
        ) {
            // Only a sensor that has sent a frame is known to work.
            self.give_up(!self.is_measuring() || !self.has_given);
        }
    }
}
