//! The threshold over the average of all bins: the background as the paper defines it.
//!
//! With `T` photons in `B` gated bins the background is `λ = T/B`. The peak is a detection
//! if it exceeds `λ + α·√λ`. Multiplied by `B` and squared, this is
//!
//! ```text
//! (B·peak - T)² > α²·B·T
//! ```
//!
//! in whole numbers, exact, without a division or a root. The total is kept while counting,
//! so the rule takes no pass over the bins.
//!
//! The average includes the photons of the pulse, which matters with few bins. A strong
//! pulse raises its own threshold: with 8 bins and α = 8, a pulse in a single bin needs 11
//! photons even without background. The background of an event is too high by the pulse's
//! photons divided by B. The centroid subtracts it and errs more: with 8 bins and a pulse of
//! 0.33 bins by up to 0.12 bins instead of 0.03. [`CentredWindow`](crate::CentredWindow) has a
//! background of its own. [`PaperRule`](crate::PaperRule) leaves out the half with the peak.
//!
//! ```
//! use dtof_core::fixed::types::U8F8;
//! use dtof_core::{AverageRule, Count, DepthEstimator, Histogram, RangeGate};
//! use dtof_core::rule::detect;
//!
//! let rule = AverageRule::new(const { U8F8::lit("4") }, Count::saturating(5));
//! let mut histogram = Histogram::<8>::new();
//! histogram.add_batch(&[0, 1, 2, 3, 4, 4, 4, 4, 5, 6, 7]); // peak 4, average 11/8
//! let (gate, estimator) = (RangeGate::full(), DepthEstimator::default());
//! assert_eq!(detect(&histogram, &gate, &rule, &estimator), None);
//! histogram.add_batch(&[4, 4, 4, 4]); // peak 8, average 15/8: 8 > 1.875 + 4·1.369
//! let detection = detect(&histogram, &gate, &rule, &estimator).unwrap();
//! assert_eq!(detection.background.raw(), 2); // 1.875, rounded
//! ```
//!
//! Source: Eq. 5 with `λ_b` as in the paper's section II-A; section IV-B calls it "the
//! average of all 128 bins".

use fixed::types::{U8F8, U24F8};

use super::rule::DetectionRule;
use super::threshold::Threshold;
use crate::histogram::counter::CounterWidth;
use crate::histogram::excluded::ExcludedBins;
use crate::histogram::gate::RangeGate;
use crate::histogram::{Histogram, Peak, mean};
use crate::units::Count;

/// The peak bin against the average of all gated bins plus α of its standard deviations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AverageRule {
    threshold: Threshold,
}

impl AverageRule {
    /// See [`Threshold::new`].
    #[must_use]
    pub const fn new(alpha: U8F8, minimum_count: Count) -> Self {
        Self {
            threshold: Threshold::new(alpha, minimum_count),
        }
    }

    /// Its α and minimum count. The level itself has no rounding here.
    #[must_use]
    pub const fn threshold(&self) -> &Threshold {
        &self.threshold
    }
}

impl DetectionRule for AverageRule {
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
        let bins = excluded.bins_left(gate)?;
        let total = histogram.total();
        // A peak key fits 32 bits, so B times the highest count does.
        let above = bins.wrapping_mul(peak.count.raw()).saturating_sub(total);
        let alpha = u64::from(self.threshold.alpha().to_bits());
        // α² in 1/65536: 32 bits, times 32. Then times B, rounded down to whole numbers.
        let level = alpha * alpha * u64::from(total);
        let bins_wide = u64::from(bins);
        let level = (level >> 16) * bins_wide + (((level & 0xffff) * bins_wide) >> 16);
        if u64::from(above) * u64::from(above) <= level {
            return None;
        }
        mean(total, bins)
    }
}
