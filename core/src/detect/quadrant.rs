//! The rule of the paper's FPGA: the peak bin against the smaller of two quadrant maxima.
//!
//! The peak is a detection if it exceeds `background + α·√background`, the
//! [`Threshold`] of the [`quadrant_background`]. It is a CFAR test whose reference is a
//! maximum. The false-alarm rate for a given α therefore changes with the background; that
//! of [`WindowRule`](crate::WindowRule) does not.
//!
//! ```
//! use dtof_core::fixed::types::U8F8;
//! use dtof_core::{Count, DepthEstimator, Histogram, PaperRule, RangeGate};
//! use dtof_core::rule::detect;
//!
//! let rule = PaperRule::new(const { U8F8::lit("4") }, Count::saturating(5));
//! let mut histogram = Histogram::<128>::new();
//! histogram.add_batch(&[60, 60, 60, 60, 7]);
//! let (gate, estimator) = (RangeGate::full(), DepthEstimator::default());
//! assert_eq!(detect(&histogram, &gate, &rule, &estimator), None);
//! histogram.add(60); // the fifth photon
//! assert!(detect(&histogram, &gate, &rule, &estimator).is_some());
//! ```
//!
//! Cost on a Cortex-M4, 128 bins: 91 instructions for a usual look without an event, 272
//! if every bin has to be read. A look without an event does not compute the background:
//! [`Threshold::lowest_background`] is the lowest that the peak does not exceed, and the
//! search stops at the first count that reaches it.
//!
//! Source: the paper's section IV-B and Eq. 5. Its section III, with 8 bins, most likely
//! took the average of all bins: [`AverageRule`](crate::AverageRule).

use fixed::types::{U8F8, U24F8};

use super::background::{background_reaches, background_without, quadrant_background};
use super::rule::{DetectionRule, background_from_count};
use super::threshold::Threshold;
use crate::histogram::counter::CounterWidth;
use crate::histogram::excluded::ExcludedBins;
use crate::histogram::gate::RangeGate;
use crate::histogram::{Histogram, Peak};
use crate::units::Count;

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
        excluded: &ExcludedBins,
    ) -> Option<U24F8> {
        if peak.count < self.threshold.minimum_count() {
            return None;
        }
        if excluded.echoes() > 0 {
            let background = background_without(histogram.counts(), gate, peak.bin, excluded)?;
            let exceeded = self.threshold.is_exceeded::<W>(peak.count, background);
            return exceeded.then_some(background_from_count(background));
        }
        // Most looks end here, without the background itself.
        let lowest = self.threshold.lowest_background::<W>(peak.count);
        if background_reaches(histogram.counts(), gate, peak.bin, lowest) {
            return None;
        }
        let background = quadrant_background(histogram.counts(), gate, peak.bin);
        Some(background_from_count(background))
    }
}
