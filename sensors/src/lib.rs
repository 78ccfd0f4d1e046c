#![doc = include_str!("../README.md")]
//! ## Async
//!
//! With the feature `async`, `next` of a driver ([`protocol::Driver`]) waits for INT, reads, and returns once the
//! sink has photons or a histogram. A bus that hangs ends with `BusTimeout`. What a dropped future loses
//! is counted. In `examples/embassy` the loop is:
//!
//! ```text
//! let mut timing = Timing::new(|| Instant::now().as_millis() as u32, Delay, 100); // a poll takes 100 ms at most
//! sensor.start_async(); // before it the sensor is off, and `next` waits without end
//! loop {
//!     if let Err(error) = sensor.next(&mut timing, &mut sink).await {
//!         warn!("{}", error); // the next call starts the sensor again
//!     }
//! }
//! ```
//!
//! ## After an error
//!
//! A driver keeps in its state what it waits for, and the time is an argument of
//! [`Sensor::poll`]. A sensor that is unplugged or hangs therefore costs one error every few
//! milliseconds and blocks nothing else. Every error leaves the driver usable: the next
//! polls bring the sensor up again. [`Sensor`] says when it is off.

#![no_std]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::expect_used,
        clippy::float_arithmetic,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used
    )
)]

#[cfg(test)]
extern crate std;

pub mod dither;
mod enable;
mod fault;
pub mod i2c;
pub mod photon_timer;
pub mod protocol;
pub mod simulated;
pub mod tdc7200;
mod timer;
pub mod tmf;
pub mod tmf8829;
pub mod tmf882x;

use dtof_core::PixelAddress;
use dtof_core::fixed::types::{I24F8, U16F16};

use self::dither::Dither;
pub use self::enable::ReleaseError;
pub use self::fault::SensorFault;

/// Where a sensor's photons go. `BINS` is the number of bins of its histograms; the drivers of this
/// crate give 128.
pub trait PhotonSink<const BINS: usize = 128> {
    /// One photon of `pixel` in the present laser cycle. The photons of a pixel come one after
    /// another, in any order of bins, or in the order of time between those of other pixels.
    fn photon(&mut self, pixel: PixelAddress, code: u16);
    /// The present laser cycle and `cycles - 1` empty ones after it have ended.
    fn end_laser_cycles(&mut self, cycles: u16);
    /// The sensor has integrated `cycles` laser cycles, at least one. The histograms that follow
    /// are of these cycles.
    fn begin_frame(&mut self, cycles: u32);
    /// A whole histogram of `pixel` of the frame that began last.
    fn histogram(&mut self, pixel: PixelAddress, counts: &[u32; BINS]);
    /// A target of `pixel` that the sensor itself has found, for comparison. Only some sensors
    /// report targets.
    fn target(&mut self, _pixel: PixelAddress, _target: &Target) {}
}

/// A target that the sensor's own program has found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Target {
    /// Its number among the targets of its pixel, from 0.
    pub number: u8,
    /// Millimetres along the ray.
    pub distance: I24F8,
    /// The sensor's confidence, on its own scale.
    pub confidence: u8,
    /// Photons of the target, if the sensor reports them.
    pub signal: Option<u32>,
    /// Photons of a bin without a target, if reported.
    pub noise: Option<u32>,
    /// Photons of the crosstalk, if reported.
    pub crosstalk: Option<u32>,
}

/// A sensor that is polled. A poll never blocks longer than its bus transfers.
///
/// Poll on every edge of the interrupt pin and also once a millisecond: the timer brings a sensor
/// up and notices that it is gone. Poll again at once while the answer is not [`Polled::Idle`], up
/// to a limit: a fast sensor may always have more.
///
/// # When it is on
///
/// A sensor may fire a laser. It is on only between [`Self::start`] and [`Self::stop`]: a poll before a start, or after
/// a stop, switches nothing on. It is off once its driver is dropped. An error that ends a measurement switches
/// it off before the poll returns, and the next poll begins anew. Some errors do not end a measurement, such as a missed
/// frame, and the sensor stays on. If you poll no more, stop the sensor or drop its driver. A watchdog covers a loop
/// that hangs.
///
/// `BINS` is the number of bins of the histograms that it gives.
pub trait Sensor<const BINS: usize = 128> {
    /// The driver's error, which contains that of the bus. The host receives its kind.
    type Error: Into<SensorFault>;

    /// The description for a host.
    fn info(&self) -> SensorInfo;

    /// Starts with a new configuration. The driver abandons the present measurement and begins
    /// again. A sensor that measures times makes its TDC codes `bin_width` picoseconds wide, which
    /// is above 0. A sensor with bins of its own ignores it. The range of `dither` is at most
    /// [`SensorInfo::most_dither`].
    fn start(&mut self, bin_width: U16F16, dither: Dither);

    /// Stops the sensor, as far as that is possible at once and without an answer. It need not be polled
    /// before the next [`Self::start`], unless [`Self::is_stopping`].
    fn stop(&mut self);

    /// Whether the last stop may not have reached the sensor, as its bus or a pin has failed. A new driver is stopping,
    /// too. Poll it on then: each poll tries again.
    fn is_stopping(&self) -> bool {
        false
    }

    /// Takes the next step. `now_ms` counts milliseconds and may wrap.
    ///
    /// # Errors
    /// Fails if this step fails. The next polls bring the sensor up again.
    fn poll(
        &mut self,
        now_ms: u32,
        sink: &mut impl PhotonSink<BINS>,
    ) -> Result<Polled, Self::Error>;
}

/// The description of a sensor for a host.
///
/// Exhaustive, because drivers in other crates build it from its fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SensorInfo {
    /// Its pixels have addresses below this.
    pub pixels: u16,
    /// The width of its bins in picoseconds; `None` if the configuration sets it.
    pub bin_width: Option<U16F16>,
    /// Bins that can hold photons. Later bins are not measured.
    pub bins: u16,
    /// The range of the start of bin 0 in millimetres; 0 if unknown.
    pub offset: I24F8,
    /// It gives whole histograms, not photons.
    pub gives_histograms: bool,
    /// Laser cycles in a thousand seconds; 0 if unknown. If the sensor pauses between measurements
    /// this is the mean rate, so that laser cycle ÷ rate is a time.
    pub laser_millihertz: u64,
    /// Bins for which its TDC is blind after a photon, so that early photons hide late ones;
    /// `u16::MAX` if it takes only the first photon of a laser cycle, 0 if there is none or it is
    /// unknown. See
    /// [`PixelConfigBuilder::dead_time`](dtof_core::PixelConfigBuilder::dead_time).
    pub dead_time: u16,
    /// The largest range of [dither], in its bins; 0 if it cannot.
    pub most_dither: u8,
}

impl SensorInfo {
    /// A sensor of photons with 128 bins of any width from the laser pulse on, an unknown laser
    /// rate and no dead time.
    #[must_use]
    pub const fn new(pixels: u16) -> Self {
        Self {
            pixels,
            bin_width: None,
            bins: 128,
            offset: I24F8::ZERO,
            gives_histograms: false,
            laser_millihertz: 0,
            dead_time: 0,
            most_dither: 0,
        }
    }

    /// Whether `bin_width` is the width of this sensor's bins, within a sixteenth. This leaves room
    /// for a calibration.
    #[must_use]
    pub fn has_bins_of(&self, bin_width: U16F16) -> bool {
        self.bin_width
            .is_none_or(|own| own.abs_diff(bin_width) <= own / 16)
    }
}

/// The result of a poll.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Polled {
    /// Nothing to do before the next interrupt or millisecond.
    Idle,
    /// A step was taken, but nothing is complete yet; at most a frame has begun.
    Working,
    /// The sink was given photons, or the end of laser cycles, or a histogram.
    Data,
}
