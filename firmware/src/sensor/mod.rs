//! Drivers of the sensors that photons come from.
//!
//! | module | sensor | what it gives |
//! |---|---|---|
//! | [`tdc7200`] | TI TDC7200 time-to-digital converter, SPI | one photon time for each of up to five stops |
//! | [`tmf882x`] | ams OSRAM TMF8820/21/28, I²C | whole histograms of nine zones |
//! | [`simulated`] | none | photons drawn on the device |
//!
//! A driver never waits. Each [`Sensor::poll`] does what can be done at once,
//! at most one register block on the bus, and keeps in its state what it waits
//! for; the time is an argument. So a sensor that is unplugged or hangs costs
//! its own error every few milliseconds and nobody else's time. Every error
//! leaves the driver usable: the next polls bring the sensor up again.
//!
//! A driver owns an `SpiDevice` or an `I2c` of embedded-hal 1.0, so that several
//! sensors share a bus by way of embedded-hal-bus.

#![deny(
    clippy::expect_used,
    clippy::float_arithmetic,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used
)]

mod fault;
pub mod simulated;
pub mod tdc7200;
mod timer;
pub mod tmf882x;

use dtof_core::PixelAddress;
use dtof_core::fixed::types::U16F16;

pub use self::fault::SensorFault;

/// Where a sensor's photons go.
pub trait PhotonSink {
    /// One photon of `pixel` in the present laser cycle.
    fn photon(&mut self, pixel: PixelAddress, code: u16);
    /// The present laser cycle and `cycles - 1` empty ones after it have ended.
    fn end_laser_cycles(&mut self, cycles: u16);
    /// A whole histogram of `pixel`, complete in itself.
    fn histogram(&mut self, pixel: PixelAddress, counts: &[u32; 128]);
}

/// A sensor that is asked when its interrupt pin (or a timer) says so; never
/// blocks longer than its bus transfers.
///
/// Ask on every edge of the interrupt pin and once a millisecond besides:
/// bringing a sensor up and noticing that it is gone take the timer. Ask again
/// at once while the answer is not [`Polled::Idle`], but not without a bound: a
/// fast sensor may always have more.
pub trait Sensor {
    /// What can go wrong; the error of the bus is inside. A host is told the kind.
    type Error: Into<SensorFault>;

    /// How wide the bins of the configuration in force are, in picoseconds. A
    /// sensor that measures times makes its TDC codes that wide from now on; one
    /// with bins of its own takes no notice.
    fn set_bin_width(&mut self, _bin_width: U16F16) {}

    /// Takes the next step. `now_ms` counts milliseconds and may wrap.
    ///
    /// # Errors
    /// What went wrong. The sensor is brought up again by the polls that
    /// follow.
    fn poll(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, Self::Error>;
}

/// What a poll came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Polled {
    /// Nothing to do before the next interrupt or millisecond.
    Idle,
    /// A step was taken, but nothing is complete yet.
    Working,
    /// The sink was given something.
    Data,
}
