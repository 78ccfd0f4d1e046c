//! One decision on one histogram: peak, background, threshold, depth.
//!
//! A pixel decides so at each look. The same decision serves a histogram that arrives
//! whole from a sensor.
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
//!
//! Cost: that of the rule. A detection costs the depth estimator as well.
//!
//! Source: the flow chart of the paper's section II-B.

use fixed::types::U24F8;

use super::rule::DetectionRule;
use crate::depth::{Depth, DepthEstimator};
use crate::event::DepthEvent;
use crate::flags::Flags;
use crate::histogram::counter::CounterWidth;
use crate::histogram::gate::RangeGate;
use crate::histogram::peeled::PeeledBins;
use crate::histogram::{Histogram, Peak};
use crate::units::{BinPosition, BlockLevel, Count, EchoNumber, LaserCycle, PixelAddress};

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

impl Detection {
    /// Where the pulse lies, from the start of bin 0.
    #[inline]
    #[must_use]
    pub const fn position(&self) -> BinPosition {
        BinPosition::of(self.peak.bin, self.depth.offset)
    }

    /// The event that reports it. Laser cycle `cycle` brought the decision, and the
    /// histogram was counted over `exposure` laser cycles. It is the first echo of one pixel.
    #[inline(always)]
    #[must_use]
    pub const fn event(&self, pixel: PixelAddress, cycle: LaserCycle, exposure: u16) -> DepthEvent {
        DepthEvent {
            pixel,
            level: BlockLevel::PIXEL,
            echo: EchoNumber::FIRST,
            cycle,
            exposure,
            peak_bin: self.peak.bin,
            offset: self.depth.offset,
            peak_count: self.peak.count,
            background: self.background,
            flags: self.depth.flags,
        }
    }
}

/// Whether the highest bin of `histogram` stands clear, and how deep its pulse lies.
/// [`PixelConfig::detect`](crate::PixelConfig::detect) does it by a configuration.
///
/// `histogram` must hold gated bins only: [`Histogram::add_frame`] with the same gate
/// sees to it. A peak outside the gate is no detection.
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

/// Whether `peak` stands clear where some bins are left out. A window that reaches them is
/// flagged as [`Flags::CLIPPED`], a peak right behind them as [`Flags::TAIL`].
// Once for each rule: not with the looks of pixels that have reported nothing yet.
#[inline(never)]
pub(crate) fn detect_at<const BINS: usize, W: CounterWidth, R: DetectionRule>(
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    peak: Peak,
    rule: &R,
    estimator: &DepthEstimator,
    peeled: &PeeledBins,
) -> Option<Detection> {
    if !gate.contains(peak.bin.raw()) {
        return None;
    }
    let background = rule.detect_without(histogram, gate, peak, peeled)?;
    Some(detection_at(
        histogram, gate, peak, background, estimator, peeled,
    ))
}

/// The detection of a peak above such a background, where some bins are left out.
pub(crate) fn detection_at<const BINS: usize, W: CounterWidth>(
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    peak: Peak,
    background: U24F8,
    estimator: &DepthEstimator,
    peeled: &PeeledBins,
) -> Detection {
    let mut depth = estimator.estimate_without(histogram, gate, peak, background, peeled);
    if peeled.touches(peak.bin.raw(), estimator.reach()) {
        depth.flags |= Flags::CLIPPED;
    }
    if peeled.is_tail(peak.bin) {
        depth.flags |= Flags::TAIL;
    }
    Detection {
        peak,
        background: rounded(background),
        depth,
    }
}

/// To the nearest whole count, halves up.
#[inline]
fn rounded(background: U24F8) -> Count {
    Count::saturating((background.to_bits() >> 8) + (background.to_bits() >> 7 & 1))
}
