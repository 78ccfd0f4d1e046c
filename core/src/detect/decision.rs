//! One decision on one histogram: peak, background, threshold, depth.
//!
//! A pixel decides this way at each look. The same decision works on a whole histogram from
//! a sensor.
//!
//! ```
//! use dtof_core::fixed::types::U8F8;
//! use dtof_core::{Count, DepthEstimator, Histogram, PaperRule, RangeGate};
//! use dtof_core::rule::detect;
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

use super::live::{LiveCounts, LiveWindow};
use super::rule::DetectionRule;
use crate::depth::{Counted, DepthEstimate, DepthEstimator, Rates};
use crate::event::DepthEvent;
use crate::flags::Flags;
use crate::histogram::counter::CounterWidth;
use crate::histogram::excluded::ExcludedBins;
use crate::histogram::gate::RangeGate;
use crate::histogram::{Histogram, Peak};
use crate::units::{BinPosition, BlockLevel, Count, EchoNumber, LaserCycle, PixelAddress};

/// A peak that stands clear of the background.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Detection {
    /// The highest bin. Of a TDC with a dead time the bin with the most light, and the photons
    /// that were counted there.
    pub peak: Peak,
    /// The background a bin, as the rule estimates it, rounded to whole counts. Of a TDC with a
    /// dead time that of the peak's bin, in the laser cycles that it was live.
    pub background: Count,
    /// Where in its bins the pulse lies.
    pub depth: DepthEstimate,
}

impl Detection {
    /// Where the pulse lies, from the start of bin 0.
    #[inline]
    #[must_use]
    pub const fn position(&self) -> BinPosition {
        BinPosition::of(self.peak.bin, self.depth.offset)
    }

    /// The event that reports it: the first echo of one pixel, decided at the end of laser
    /// cycle `cycle`, from a histogram of `exposure` laser cycles.
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

/// The detection in `histogram`, if its highest bin stands clear of the background.
/// [`PixelConfig::detect`](crate::PixelConfig::detect) does this for a configuration.
///
/// `histogram` must hold gated bins only, as [`Histogram::add_frame`] with the same gate
/// leaves it. A peak outside the gate is not a detection.
#[inline(always)]
#[must_use]
pub fn detect<const BINS: usize, W: CounterWidth, R: DetectionRule>(
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    rule: &R,
    estimator: &DepthEstimator,
) -> Option<Detection> {
    // Without a gate, halves and quadrants are known at compile time.
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
    let background = rule.detect(histogram, gate, peak, &ExcludedBins::NONE)?;
    let depth = estimator.estimate(histogram, gate, peak, background);
    Some(Detection {
        peak,
        background: rounded(background),
        depth,
    })
}

/// The detection of `peak`, with excluded bins. A window that reaches them is flagged as
/// [`Flags::CLIPPED`], a peak right behind them as [`Flags::TAIL`].
// Out of line: most looks are of pixels that have not reported yet.
#[inline(never)]
pub(crate) fn detect_at<const BINS: usize, W: CounterWidth, R: DetectionRule>(
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    peak: Peak,
    rule: &R,
    estimator: &DepthEstimator,
    excluded: &ExcludedBins,
) -> Option<Detection> {
    if !gate.contains(peak.bin.raw()) {
        return None;
    }
    let background = rule.detect(histogram, gate, peak, excluded)?;
    Some(detection_at(
        histogram, gate, peak, background, estimator, excluded,
    ))
}

/// The detection of a peak above `background`, with excluded bins.
pub(crate) fn detection_at<const BINS: usize, W: CounterWidth>(
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    peak: Peak,
    background: U24F8,
    estimator: &DepthEstimator,
    excluded: &ExcludedBins,
) -> Detection {
    let mut depth = estimator.estimate_without(histogram, gate, peak, background, excluded);
    if excluded.touches(peak.bin.raw(), estimator.reach()) {
        depth.flags |= Flags::CLIPPED;
    }
    if excluded.is_tail(peak.bin) {
        depth.flags |= Flags::TAIL;
    }
    Detection {
        peak,
        background: rounded(background),
        depth,
    }
}

/// The detection in a window of live counts.
///
/// The peak is the bin of the window with the most light, its count that of the photons as they were
/// counted. The background is what the bins outside have a live laser cycle, in the laser cycles that
/// the peak was live: photons, too.
#[inline(never)]
pub(crate) fn detection_in<const BINS: usize, W: CounterWidth>(
    counts: &LiveCounts<'_, BINS, W>,
    window: &LiveWindow,
    estimator: &DepthEstimator,
) -> Detection {
    let (gate, excluded) = (counts.gate(), counts.excluded());
    let (first, width) = (window.first, window.width);
    let peak = counts.brightest(first, width);
    let bin = peak.bin.raw();
    let outside = Counted {
        photons: window.photons_outside.into(),
        live: window.live_outside,
    };
    let mut is_clipped = excluded.touches(bin, estimator.reach());
    let rates = Rates::about(peak.bin, outside, |other| {
        if !gate.contains(other) || excluded.contains(other) {
            return None;
        }
        let counted = counts.counted(other);
        let is_known = !counts.is_left_out(counted.live);
        is_clipped |= !is_known && other.abs_diff(bin) <= estimator.reach();
        is_known.then_some(counted)
    });
    let mut depth = estimator.estimate_rates(&rates, gate, peak.bin);
    if is_clipped {
        depth.flags |= Flags::CLIPPED;
    }
    if excluded.is_tail(peak.bin) {
        depth.flags |= Flags::TAIL;
    }
    // 32 + 28 bits.
    let half = outside.live / 2;
    let live = u64::from(counts.live(bin));
    let expected = (outside.photons * live + half).checked_div(outside.live);
    let background = u32::try_from(expected.unwrap_or(0)).unwrap_or(u32::MAX);
    Detection {
        peak,
        background: Count::saturating(background),
        depth,
    }
}

/// To the nearest whole count, halves up.
#[inline]
pub(super) fn rounded(background: U24F8) -> Count {
    Count::saturating((background.to_bits() >> 8) + (background.to_bits() >> 7 & 1))
}
