#![doc = include_str!("../README.md")]
//! ## After an error
//!
//! Each [`Sensor::poll`] keeps in the driver's state what it waits for; the time is an
//! argument. So a sensor that is unplugged or hangs costs its own error every few
//! milliseconds and nobody else's time. Every error leaves the driver usable: the next
//! polls bring the sensor up again.

#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::expect_used,
    clippy::float_arithmetic,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used
)]

mod fault;
pub mod i2c;
pub mod protocol;
pub mod simulated;
pub mod tdc7200;
mod timer;
pub mod tmf8829;
pub mod tmf882x;

use dtof_core::PixelAddress;
use dtof_core::fixed::types::{I24F8, U16F16};

pub use self::fault::SensorFault;

/// Where a sensor's photons go.
pub trait PhotonSink {
    /// One photon of `pixel` in the present laser cycle.
    fn photon(&mut self, pixel: PixelAddress, code: u16);
    /// The present laser cycle and `cycles - 1` empty ones after it have ended.
    fn end_laser_cycles(&mut self, cycles: u16);
    /// `cycles` laser cycles have ended, at least one, and the sensor has integrated them:
    /// the histograms that follow are of them.
    fn begin_frame(&mut self, cycles: u32);
    /// A whole histogram of `pixel`, of the frame that was begun last.
    fn histogram(&mut self, pixel: PixelAddress, counts: &[u32; 128]);
    /// What the sensor itself takes for a target of `pixel`, to compare with. Only some sensors
    /// say it.
    fn target(&mut self, _pixel: PixelAddress, _target: &Target) {}
}

/// A target as a sensor's own program sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Target {
    /// Of the targets of its pixel, from 0 on.
    pub number: u8,
    /// Millimetres along the ray.
    pub distance: I24F8,
    /// How sure the sensor is, as it says it.
    pub confidence: u8,
    /// Photons of the target, if that is said.
    pub signal: Option<u32>,
    /// Photons of a bin without one.
    pub noise: Option<u32>,
    /// Photons of the crosstalk.
    pub crosstalk: Option<u32>,
}

/// A sensor that is asked when its interrupt pin (or a timer) says so; never
/// blocks longer than its bus transfers.
///
/// Ask on every edge of the interrupt pin and once a millisecond besides:
/// bringing a sensor up and noticing that it is gone take the timer. Ask again
/// at once while the answer is not [`Polled::Idle`], but not without a bound: a
/// fast sensor may always have more.
pub trait Sensor {
    /// The driver's error, with that of the bus inside. A host is told the kind.
    type Error: Into<SensorFault>;

    /// The description for a host.
    fn about(&self) -> About;

    /// Whether it gives the first photon of a laser cycle only, so that at high rates
    /// early photons hide late ones. Events then say so:
    /// [`PixelConfig::with_one_hit_tdc`](dtof_core::PixelConfig::with_one_hit_tdc).
    fn is_one_hit(&self) -> bool {
        false
    }

    /// A configuration comes into force: whatever is under way is given up, and
    /// what the next polls give begins anew. A sensor that measures times makes its
    /// TDC codes `bin_width` picoseconds wide, which is above 0; for one with bins
    /// of its own it is about theirs.
    fn start(&mut self, bin_width: U16F16);

    /// Nothing is asked before the next [`Self::start`]: as far as it can at once
    /// and without an answer, the sensor rests.
    fn stop(&mut self);

    /// Takes the next step. `now_ms` counts milliseconds and may wrap.
    ///
    /// # Errors
    /// The error of this step. The next polls bring the sensor up again.
    fn poll(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, Self::Error>;
}

/// The description of a sensor for a host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct About {
    /// Its pixels have addresses below this.
    pub pixels: u16,
    /// How wide its bins are, in picoseconds; `None` if as wide as the
    /// configuration says.
    pub bin_width: Option<U16F16>,
    /// Bins that can hold photons. Those behind them are not measured.
    pub bins: u16,
    /// The range of the start of bin 0 in millimetres, as far as it is known.
    pub offset: I24F8,
    /// It gives whole histograms, not photons.
    pub is_whole: bool,
    /// Laser cycles that it gives in a thousand seconds; 0 if that is not known. Of a sensor
    /// that pauses between measurements it is the mean: laser cycle ÷ rate is a time.
    pub laser_millihertz: u64,
}

impl About {
    /// Bins of any width, from the laser pulse on, of a laser whose rate is not known.
    #[must_use]
    pub const fn new(pixels: u16) -> Self {
        Self {
            pixels,
            bin_width: None,
            bins: 128,
            offset: I24F8::ZERO,
            is_whole: false,
            laser_millihertz: 0,
        }
    }

    /// Whether bins of the width of a configuration are this sensor's: within a
    /// sixteenth, which leaves room for a calibration.
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
