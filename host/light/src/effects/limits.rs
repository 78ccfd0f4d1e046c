//! The ranges of the numbers of effects, and the time base.

use std::ops::RangeInclusive;

/// The most picoseconds an effect may last: 100 µs.
pub(crate) const LONGEST_PS: f64 = 1e8;

/// The range of a share.
pub(crate) const SHARE: RangeInclusive<f64> = 0.0..=1.0;

/// The range of the probability of an afterpulse: with 1 they would never end.
pub(crate) const SHARE_OF_AFTERPULSES: RangeInclusive<f64> = 0.0..=0.9;

/// From picoseconds to bins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Bins of a histogram.
    pub bins: u16,
    /// Picoseconds a bin.
    pub bin_width_ps: f64,
    /// From one laser pulse to the next in the mean, in bins; at least `bins`.
    pub period: f64,
    /// By how many bins the longest laser cycle is longer than the shortest: see
    /// [`Dither`](dtof_sensors::dither::Dither).
    pub dither_bins: u16,
}
