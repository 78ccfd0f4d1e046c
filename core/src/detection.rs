//! One decision on one histogram.
//!
//! ```
//! use dtof_core::fixed::types::U8F8;
//! use dtof_core::{Count, DepthEstimator, Histogram, PaperRule, RangeGate, detect};
//!
//! let rule = PaperRule::new(const { U8F8::lit("4") }, Count::saturating(5));
//! let mut histogram = Histogram::<128>::new();
//! histogram.add_batch(&[60, 60, 60, 60, 7]);
//! let estimator = DepthEstimator::default();
//! assert_eq!(detect(&histogram, &RangeGate::full(), &rule, &estimator), None);
//! histogram.add(60);
//! let detection = detect(&histogram, &RangeGate::full(), &rule, &estimator).unwrap();
//! assert_eq!((detection.peak.bin.raw(), detection.background.raw()), (60, 0));
//! ```

use fixed::types::U24F8;

use crate::depth::Depth;
use crate::estimator::DepthEstimator;
use crate::gate::RangeGate;
use crate::histogram::{CounterWidth, Histogram};
use crate::peak::Peak;
use crate::rule::DetectionRule;
use crate::units::Count;

/// A peak that stands clear of the background.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Detection {
    /// The highest bin.
    pub peak: Peak,
    /// The background a bin, as the rule estimates it, rounded to whole counts.
    pub background: Count,
    /// Where in its bins the pulse lies.
    pub depth: Depth,
}

/// One decision on one histogram: peak, background, threshold, depth. What a
/// pixel does at each look, on its own for histograms that arrive whole.
///
/// `histogram` holds gated bins only, as [`Histogram::add_frame`] with the same
/// gate and [`AsyncPixel::count`](crate::AsyncPixel::count) see to. A peak outside
/// the gate is none.
#[inline(always)]
#[must_use]
pub fn detect<const BINS: usize, W: CounterWidth, R: DetectionRule>(
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    rule: &R,
    estimator: &DepthEstimator,
) -> Option<Detection> {
    // Without a gate, halves and quadrants are known when compiled.
    if gate.is_full() {
        detect_gated(histogram, &RangeGate::full(), rule, estimator)
    } else {
        detect_gated(histogram, gate, rule, estimator)
    }
}

#[inline(always)]
fn detect_gated<const BINS: usize, W: CounterWidth, R: DetectionRule>(
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    rule: &R,
    estimator: &DepthEstimator,
) -> Option<Detection> {
    let peak = histogram.peak();
    if !gate.contains(peak.bin.raw()) {
        return None;
    }
    let background = rule.detect(histogram, gate, peak)?;
    let depth = estimator.estimate(histogram, gate, peak, background);
    Some(Detection {
        peak,
        background: rounded(background),
        depth,
    })
}

/// To the nearest whole count, halves up.
#[inline]
fn rounded(background: U24F8) -> Count {
    Count::saturating((background.to_bits() >> 8) + (background.to_bits() >> 7 & 1))
}
