//! The trait of detection rules: does a peak stand clear of the background?
//!
//! Histogram, pixel, depth and events are the same for every rule. [`crate::rule`] has an
//! example of a rule of your own.

use fixed::types::U24F8;

use super::live::{LiveCounts, LiveDecision};
use crate::histogram::counter::CounterWidth;
use crate::histogram::excluded::ExcludedBins;
use crate::histogram::gate::RangeGate;
use crate::histogram::{Histogram, Peak};
use crate::units::{BinIndex, Count};

/// Decides from one histogram. An implementation holds its configuration only; all state
/// is in the histogram.
pub trait DetectionRule: Copy {
    /// The background a bin, in counts, if `peak`, the highest of the gated bins, is a
    /// detection; `None` if it is not. [`background_from_count`] converts whole counts.
    ///
    /// The `excluded` bins are empty, because their echo was reported. A rule that counts bins
    /// or compares parts of the histogram takes them into account.
    fn detect<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
        excluded: &ExcludedBins,
    ) -> Option<U24F8>;

    /// The bins of the window that it tests, 1 to 255; 1 if it tests the highest bin.
    #[inline(always)]
    fn window_bins(&self) -> u16 {
        1
    }

    /// The fewest photons of a detection, 1 or more.
    #[inline(always)]
    fn fewest_photons(&self) -> u32 {
        1
    }

    /// Whether [`Self::detect_live`] decides for a TDC with a dead time.
    #[inline(always)]
    fn weighs_dead_time(&self) -> bool {
        false
    }

    /// Decides from live counts, only on windows that contain `expected` if that is given. By
    /// default no rule does.
    fn detect_live<const BINS: usize, W: CounterWidth>(
        &self,
        _counts: &LiveCounts<'_, BINS, W>,
        _expected: Option<BinIndex>,
    ) -> LiveDecision {
        LiveDecision::NONE
    }
}

/// A background of whole counts, as [`DetectionRule::detect`] gives it. Exact.
#[inline]
#[must_use]
pub const fn background_from_count(background: Count) -> U24F8 {
    U24F8::from_bits(background.raw() << U24F8::FRAC_NBITS)
}
