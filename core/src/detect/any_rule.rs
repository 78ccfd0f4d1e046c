//! A detection rule that is chosen when the program runs.
//!
//! A program that knows its rule when it is compiled takes the rule itself. It then has
//! the code of no other.
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
use super::quadrant::PaperRule;
use super::rule::DetectionRule;
use super::window::WindowRule;
use crate::counter::CounterWidth;
use crate::gate::RangeGate;
use crate::histogram::{Histogram, Peak};

/// One of the rules; decides as the one it holds.
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
    ) -> Option<U24F8> {
        match self {
            // The looks of a pixel with the default rule stay as fast as they are.
            Self::Paper(rule) if W::BITS <= 10 => rule.detect(histogram, gate, peak),
            Self::Paper(rule) => once(rule, histogram, gate, peak),
            Self::Average(rule) => once(rule, histogram, gate, peak),
            Self::Window(rule) => once(rule, histogram, gate, peak),
        }
    }
}

/// The code of the rule is there once, not once with a gate and once without: a look
/// takes some instructions more than with the rule itself.
#[inline(never)]
fn once<const BINS: usize, W: CounterWidth>(
    rule: &impl DetectionRule,
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    peak: Peak,
) -> Option<U24F8> {
    rule.detect(histogram, gate, peak)
}
