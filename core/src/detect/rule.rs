//! What a detection rule is: the decision whether a peak stands clear of the background.
//!
//! Histogram, pixel, depth and events are the same for every rule. A rule of your own
//! implements [`DetectionRule`] and goes into [`PixelConfig::with_rule`](crate::PixelConfig::with_rule):
//!
//! ```
//! use dtof_core::fixed::types::U24F8;
//! use dtof_core::*;
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
//!     ) -> Option<U24F8> {
//!         (peak.count.raw() >= 10).then_some(U24F8::ZERO)
//!     }
//! }
//!
//! let config = PixelConfig::<128, _>::with_rule(TenPhotons).build()?;
//! # Ok::<(), ConfigError>(())
//! ```

use fixed::types::U24F8;

use crate::histogram::counter::CounterWidth;
use crate::histogram::gate::RangeGate;
use crate::histogram::peeled::PeeledBins;
use crate::histogram::{Histogram, Peak};
use crate::units::Count;

/// Decides from one histogram. Implementations hold their configuration only,
/// which is copied; all state is in the histogram.
pub trait DetectionRule: Copy {
    /// The background a bin, in counts, if `peak`, the highest of the gated bins,
    /// is a detection; `None` if it is not. [`whole_background`] makes it one.
    fn detect<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
    ) -> Option<U24F8>;

    /// The same where some bins are left out, which are empty. A rule that counts bins or
    /// compares parts of the histogram takes them into account.
    fn detect_without<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
        _peeled: &PeeledBins,
    ) -> Option<U24F8> {
        self.detect(histogram, gate, peak)
    }
}

/// A background of whole counts, as [`DetectionRule::detect`] gives it. Exact.
#[inline]
#[must_use]
pub const fn whole_background(background: Count) -> U24F8 {
    U24F8::from_bits(background.raw() << U24F8::FRAC_NBITS)
}
