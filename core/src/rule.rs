//! Detection rules: when does a peak stand clear of the background?
//!
//! [`PaperRule`] is the default and stays faithful to the paper. Another rule
//! implements [`DetectionRule`] and is given to
//! [`PixelConfig`](crate::PixelConfig) as its type parameter; histogram, pixel,
//! depth and events stay the same.

use fixed::types::U8F8;

use crate::background;
use crate::gate::RangeGate;
use crate::histogram::{CounterWidth, Histogram};
use crate::peak::Peak;
use crate::threshold::Threshold;
use crate::units::Count;

/// Decides from one histogram. Implementations hold their configuration only,
/// which is copied; all state is in the histogram.
pub trait DetectionRule: Copy {
    /// The background a bin if `peak`, the highest of the gated bins, is a
    /// detection; `None` if it is not.
    fn detect<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
    ) -> Option<Count>;
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
}

impl DetectionRule for PaperRule {
    #[inline(always)]
    fn detect<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
    ) -> Option<Count> {
        if peak.count < self.threshold.minimum_count() {
            return None;
        }
        // Most looks end here, without the background itself.
        let lowest = self.threshold.lowest_background::<W>(peak.count);
        if background::quadrant_reaches(histogram.counts(), gate, peak.bin, lowest) {
            return None;
        }
        Some(background::quadrant(histogram.counts(), gate, peak.bin))
    }
}
