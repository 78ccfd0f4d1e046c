//! Detection rules: when does a peak stand clear of the background?
//!
//! [`PaperRule`] is the default and stays faithful to the paper. Another rule
//! implements [`DetectionRule`] and is given to
//! [`PixelConfig`](crate::PixelConfig) as its type parameter; histogram, pixel,
//! depth and events stay the same.

use fixed::types::{U8F8, U24F8};

use crate::background;
use crate::gate::RangeGate;
use crate::histogram::{CounterWidth, Histogram};
use crate::peak::Peak;
use crate::photon_count::PhotonCount;
use crate::threshold::Threshold;
use crate::units::{BinIndex, Count};

/// Decides from one histogram. Implementations hold their configuration only,
/// which is copied; all state is in the histogram.
pub trait DetectionRule: Copy {
    /// The background a bin, in counts, if `peak`, the highest of the gated bins,
    /// is a detection; `None` if it is not. [`whole_background`] makes it one.
    fn detect<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
    ) -> Option<U24F8>;
}

/// A background of whole counts, as [`DetectionRule::detect`] gives it. Exact.
#[inline]
#[must_use]
pub const fn whole_background(background: Count) -> U24F8 {
    U24F8::from_bits(background.raw() << U24F8::FRAC_NBITS)
}

/// The paper's rule: the peak bin against the quadrant background plus α of its
/// standard deviations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PaperRule {
    threshold: Threshold,
}

impl PaperRule {
    /// See [`Threshold::new`].
    #[must_use]
    pub const fn new(alpha: U8F8, minimum_count: Count) -> Self {
        Self {
            threshold: Threshold::new(alpha, minimum_count),
        }
    }

    /// The threshold it applies.
    #[must_use]
    pub const fn threshold(&self) -> &Threshold {
        &self.threshold
    }

    /// One decision on a histogram that arrives whole: the peak and the background
    /// a bin if it is a detection, the same as [`detect`](crate::detect) gives for a
    /// [`Histogram`] of these counts, none of which may exceed `W`'s. Whether the
    /// peak's counter is full is the caller's to see.
    ///
    /// Costs one pass over the gated bins: the maxima of the four quadrants tell
    /// the peak's count, its half and the background. Only a detection is looked
    /// for in its quadrant.
    #[inline]
    #[must_use]
    pub fn detect_whole<W: CounterWidth, const BINS: usize>(
        &self,
        counts: &[W::Counter; BINS],
        gate: &RangeGate<BINS>,
    ) -> Option<(Peak, Count)> {
        // Without a gate, quadrants are known when compiled.
        if gate.is_full() {
            self.detect_gated::<W, BINS>(counts, &RangeGate::full())
        } else {
            self.detect_gated::<W, BINS>(counts, gate)
        }
    }

    #[inline(always)]
    fn detect_gated<W: CounterWidth, const BINS: usize>(
        &self,
        counts: &[W::Counter; BINS],
        gate: &RangeGate<BINS>,
    ) -> Option<(Peak, Count)> {
        let [first, second, third, fourth] = background::quadrants(counts, gate);
        let highest = W::Counter::highest;
        let [a, b, c, d] = [
            highest(first),
            highest(second),
            highest(third),
            highest(fourth),
        ];
        let (highest, background) = if a.max(b) >= c.max(d) {
            (a.max(b), c.min(d))
        } else {
            (c.max(d), a.min(b))
        };
        let (count, background) = (Count::saturating(highest), Count::saturating(background));
        if !self.threshold.is_exceeded::<W>(count, background) {
            return None;
        }
        // The lowest of the highest bins: in the first quadrant that has one.
        let (before, quadrant) = if a == highest {
            (0, first)
        } else if b == highest {
            (first.len(), second)
        } else if c == highest {
            (first.len() + second.len(), third)
        } else {
            (first.len() + second.len() + third.len(), fourth)
        };
        let is_peak = |&count: &W::Counter| count.into() == highest;
        let bin = before + quadrant.iter().position(is_peak)?;
        let bin = BinIndex::saturating(gate.first() + u16::try_from(bin).ok()?);
        Some((Peak { bin, count }, background))
    }
}

impl DetectionRule for PaperRule {
    #[inline(always)]
    fn detect<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
    ) -> Option<U24F8> {
        if peak.count < self.threshold.minimum_count() {
            return None;
        }
        // Most looks end here, without the background itself.
        let lowest = self.threshold.lowest_background::<W>(peak.count);
        if background::quadrant_reaches(histogram.counts(), gate, peak.bin, lowest) {
            return None;
        }
        let background = background::quadrant(histogram.counts(), gate, peak.bin);
        Some(whole_background(background))
    }
}
