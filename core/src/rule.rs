//! For authors of detection rules, and for programs that check decisions.
//!
//! A rule of your own implements [`DetectionRule`](crate::DetectionRule) and goes into
//! [`PixelConfig::with_rule`](crate::PixelConfig::with_rule):
//!
//! ```
//! use dtof_core::fixed::types::U24F8;
//! use dtof_core::rule::ExcludedBins;
//! use dtof_core::{
//!     CounterWidth, DetectionRule, Histogram, Peak, PixelConfig, PixelConfigError, RangeGate,
//! };
//!
//! /// Ten photons are enough, whatever the background.
//! #[derive(Clone, Copy)]
//! struct TenPhotons;
//!
//! impl DetectionRule for TenPhotons {
//!     fn detect<const BINS: usize, W: CounterWidth>(
//!         &self,
//!         _: &Histogram<BINS, W>,
//!         _: &RangeGate<BINS>,
//!         peak: Peak,
//!         _: &ExcludedBins,
//!     ) -> Option<U24F8> {
//!         (peak.count.raw() >= 10).then_some(U24F8::ZERO)
//!     }
//! }
//!
//! let config = PixelConfig::<128, _>::with_rule(TenPhotons).build()?;
//! # Ok::<(), PixelConfigError>(())
//! ```

pub use crate::detect::{
    HIGHEST_Z, LiveCounts, LiveDecision, LiveWindow, Tracking, background_from_count, detect,
    z_for_levels,
};
pub use crate::histogram::counter::PhotonCount;
pub use crate::histogram::excluded::ExcludedBins;
pub use crate::pixel::DecisionInput;
