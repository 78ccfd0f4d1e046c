//! Tracking: half of the allowed false alarms go to the place of the last event.
//!
//! A pixel that has reported expects its next event in the same place. A peak within
//! [`Tracking::reach`] bins of it has a lower threshold, one elsewhere a higher one. Each
//! threshold has half of the false alarms, so that their rate stays the same. An exposure
//! without an event ends the expectation.
//!
//! [`WindowRule::tracking`](crate::WindowRule::tracking) has the two thresholds for a z.
//!
//! ```
//! use dtof_core::fixed::types::U4F12;
//! use dtof_core::{Count, PixelConfig, RangeGate, WindowRule};
//!
//! let rule = WindowRule::new(3, const { U4F12::lit("4.47") }, Count::saturating(5))?;
//! let tracking = rule.tracking(&RangeGate::<128>::full());
//! assert!(tracking.near().z() < rule.z() && rule.z() < tracking.far().z());
//! let config = PixelConfig::<128, _>::with_rule(rule).tracking(Some(tracking)).build()?;
//! assert_eq!(config.tracking(), Some(&tracking));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Cost: two bytes a pixel; a look at a pixel that has reported decides twice. On a Cortex-M4
//! and with a window of 3 bins it takes 417 instructions, without tracking 197.

use super::decision::{Detection, detect_at, detection_at};
use super::live::{LiveCounts, LiveDecision};
use super::rule::DetectionRule;
use crate::depth::DepthEstimator;
use crate::histogram::counter::CounterWidth;
use crate::histogram::excluded::ExcludedBins;
use crate::histogram::gate::RangeGate;
use crate::histogram::{Histogram, Peak};
use crate::units::{BinIndex, Count};

/// A rule for peaks where one is expected, and one for all others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Tracking<R> {
    near: R,
    far: R,
    reach: u16,
}

impl<R> Tracking<R> {
    /// `near` for peaks up to `reach` bins from the last event, `far` for the others. Their
    /// rates of false alarms add up.
    #[must_use]
    pub const fn new(near: R, far: R, reach: u16) -> Self {
        Self { near, far, reach }
    }

    /// How many bins to either side of the last event count as near: those of all windows
    /// that contain its bin.
    #[must_use]
    pub const fn reach(&self) -> u16 {
        self.reach
    }

    /// The rule near the last event.
    #[must_use]
    pub const fn near(&self) -> &R {
        &self.near
    }

    /// The rule elsewhere.
    #[must_use]
    pub const fn far(&self) -> &R {
        &self.far
    }
}

impl<R: DetectionRule> Tracking<R> {
    /// Decides on the windows that contain the bin `expected` with the near rule, and else on
    /// the highest bin with the far rule. The peak of the former is the highest bin near
    /// `expected`.
    #[inline(always)]
    pub(crate) fn detect<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        estimator: &DepthEstimator,
        expected: BinIndex,
        excluded: &ExcludedBins,
    ) -> Option<Detection> {
        let peak_at = |bin: u16| Peak {
            bin: BinIndex::saturating(bin),
            count: Count::saturating(histogram.count(bin.into()).unwrap_or(0)),
        };
        let at_expected = peak_at(expected.raw());
        if gate.contains(expected.raw())
            && let Some(background) = self.near.detect(histogram, gate, at_expected, excluded)
        {
            let first = expected.raw().saturating_sub(self.reach);
            let last = expected.raw().saturating_add(self.reach);
            let mut near = at_expected;
            for bin in first.max(gate.first())..=last.min(gate.last()) {
                let peak = peak_at(bin);
                // The lowest index wins a tie, as everywhere.
                if peak.count > near.count || peak.count == near.count && peak.bin < near.bin {
                    near = peak;
                }
            }
            return Some(detection_at(
                histogram, gate, near, background, estimator, excluded,
            ));
        }
        detect_at(
            histogram,
            gate,
            histogram.peak(),
            &self.far,
            estimator,
            excluded,
        )
    }
    /// Decides from live counts: on the windows that contain the bin `expected` with the near rule, and
    /// else on all with the far rule.
    #[must_use]
    pub fn detect_live<const BINS: usize, W: CounterWidth>(
        &self,
        counts: &LiveCounts<'_, BINS, W>,
        expected: BinIndex,
    ) -> LiveDecision {
        if counts.gate().contains(expected.raw()) {
            let near = self.near.detect_live(counts, Some(expected));
            if near.window.is_some() {
                return near;
            }
        }
        self.far.detect_live(counts, None)
    }
}
