//! A detection rule that is chosen at run time.
//!
//! A program with one rule uses that rule's type. It then contains the code of no other.
//!
//! ```
//! use dtof_core::fixed::types::{U4F12, U8F8};
//! use dtof_core::{AnyRule, Count, PaperRule, PixelConfig, WindowRule};
//!
//! let minimum_count = Count::saturating(5);
//! let rule = |window: bool| -> Result<AnyRule, dtof_core::WindowWidthError> {
//!     Ok(if window {
//!         WindowRule::new(3, const { U4F12::lit("4.47") }, minimum_count)?.into()
//!     } else {
//!         PaperRule::new(const { U8F8::lit("4") }, minimum_count).into()
//!     })
//! };
//! let config = PixelConfig::<128, AnyRule>::with_rule(rule(true)?).build()?;
//! assert!(matches!(config.rule(), AnyRule::Window(rule) if rule.width() == 3));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Cost: one comparison a look more than the rule itself, and a call for all but the paper's
//! with 10-bit counters.

use fixed::types::U24F8;

use super::average::AverageRule;
use super::live::{LiveCounts, LiveDecision};
use super::quadrant::PaperRule;
use super::rule::DetectionRule;
use super::tracking::Tracking;
use super::window::WindowRule;
use crate::histogram::counter::CounterWidth;
use crate::histogram::excluded::ExcludedBins;
use crate::histogram::gate::RangeGate;
use crate::histogram::{Histogram, Peak};
use crate::units::{BinIndex, BlockLevel};

/// One of the rules.
///
/// Exhaustive, because the link and the C header number each rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AnyRule {
    /// The paper's.
    Paper(PaperRule),
    /// The paper's threshold over the average of all bins.
    Average(AverageRule),
    /// All photons of the pulse against all the others.
    Window(WindowRule),
}

impl AnyRule {
    /// The rules of a pixel that tracks; `None` for all but the window rule.
    #[must_use]
    pub fn tracking<const BINS: usize>(&self, gate: &RangeGate<BINS>) -> Option<Tracking<Self>> {
        let Self::Window(rule) = self else {
            return None;
        };
        let tracking = rule.tracking(gate);
        Some(Tracking::new(
            Self::Window(*tracking.near()),
            Self::Window(*tracking.far()),
            tracking.reach(),
        ))
    }

    /// Whether counters of `W` can hold as many photons as the rule wants: a bin of them, or a window of
    /// the window rule. If not, there is never an event.
    #[must_use]
    pub const fn fits<W: CounterWidth>(&self) -> bool {
        let (minimum, bins) = match self {
            Self::Paper(rule) => (rule.threshold().minimum_count(), 1),
            Self::Average(rule) => (rule.threshold().minimum_count(), 1),
            Self::Window(rule) => (rule.minimum_count(), rule.width() as u32),
        };
        minimum.raw() <= W::MAX.saturating_mul(bins)
    }

    /// The rule for blocks of pixels with this rule. Only the window rule's differs.
    #[must_use]
    pub fn of_blocks(&self, levels: BlockLevel) -> Self {
        match self {
            Self::Window(rule) => Self::Window(rule.of_blocks(levels)),
            _ => *self,
        }
    }
}

impl From<PaperRule> for AnyRule {
    fn from(rule: PaperRule) -> Self {
        Self::Paper(rule)
    }
}

impl From<AverageRule> for AnyRule {
    fn from(rule: AverageRule) -> Self {
        Self::Average(rule)
    }
}

impl From<WindowRule> for AnyRule {
    fn from(rule: WindowRule) -> Self {
        Self::Window(rule)
    }
}

impl DetectionRule for AnyRule {
    #[inline(always)]
    fn detect<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
        excluded: &ExcludedBins,
    ) -> Option<U24F8> {
        match self {
            // Inlined, for fast looks with the default rule.
            Self::Paper(rule) if W::BITS <= 10 => rule.detect(histogram, gate, peak, excluded),
            Self::Paper(rule) => once(rule, histogram, gate, peak, excluded),
            Self::Average(rule) => once(rule, histogram, gate, peak, excluded),
            Self::Window(rule) => once(rule, histogram, gate, peak, excluded),
        }
    }

    #[inline(always)]
    fn window_bins(&self) -> u16 {
        match self {
            Self::Window(rule) => rule.window_bins(),
            Self::Paper(_) | Self::Average(_) => 1,
        }
    }

    #[inline(always)]
    fn fewest_photons(&self) -> u32 {
        match self {
            Self::Window(rule) => rule.fewest_photons(),
            Self::Paper(rule) => rule.fewest_photons(),
            Self::Average(rule) => rule.fewest_photons(),
        }
    }

    #[inline(always)]
    fn weighs_dead_time(&self) -> bool {
        matches!(self, Self::Window(_))
    }

    fn detect_live<const BINS: usize, W: CounterWidth>(
        &self,
        counts: &LiveCounts<'_, BINS, W>,
        expected: Option<BinIndex>,
    ) -> LiveDecision {
        match self {
            Self::Window(rule) => rule.detect_live(counts, expected),
            _ => LiveDecision::NONE,
        }
    }
}

/// Keeps one copy of the rule's code for looks with a gate and without. A look takes some
/// instructions more than with the rule's own type.
#[inline(never)]
fn once<const BINS: usize, W: CounterWidth>(
    rule: &impl DetectionRule,
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    peak: Peak,
    excluded: &ExcludedBins,
) -> Option<U24F8> {
    rule.detect(histogram, gate, peak, excluded)
}
