//! The threshold a peak must exceed: `background + α·√background`.
//!
//! α is an unsigned fixed-point number with 8 fractional bits, 0 to 255.996. The root
//! is the integer one of [`isqrt`](crate::paper::isqrt()). So the threshold lies less than α
//! counts below the real-valued one, as in the paper's hardware.
//!
//! With a background of 0 the threshold is 0, and one stray photon would exceed it. So
//! the peak must also have a minimum count.
//!
//! ```
//! use dtof_core::{Count, Count10, fixed::types::U8F8};
//! use dtof_core::paper::Threshold;
//!
//! let threshold = Threshold::new(const { U8F8::lit("2.5") }, Count::saturating(5));
//! let background = Count::saturating(20); // root 4
//! assert_eq!(threshold.level::<Count10>(background), 30u16);
//! assert!(!threshold.is_exceeded::<Count10>(Count::saturating(30), background));
//! assert!(threshold.is_exceeded::<Count10>(Count::saturating(31), background));
//! // Background 0: only the minimum count rejects a stray photon.
//! assert!(!threshold.is_exceeded::<Count10>(Count::saturating(4), Count::saturating(0)));
//! ```
//!
//! Cost on a Cortex-M4: some 35 instructions a level, those of the root included.
//!
//! Source: the paper's Eq. 5.

use fixed::types::{U8F8, U24F8};

use super::root::{root_below, square_root};
use crate::histogram::counter::CounterWidth;
use crate::units::Count;

/// α and the minimum peak count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Threshold {
    alpha: U8F8,
    minimum_count: Count,
}

impl Threshold {
    /// `alpha` standard deviations above the background, and at least
    /// `minimum_count` photons in the peak.
    #[must_use]
    pub const fn new(alpha: U8F8, minimum_count: Count) -> Self {
        Self {
            alpha,
            minimum_count,
        }
    }

    /// How many standard deviations above the background.
    #[must_use]
    pub const fn alpha(&self) -> U8F8 {
        self.alpha
    }

    /// The fewest photons a reported peak holds.
    #[must_use]
    pub const fn minimum_count(&self) -> Count {
        self.minimum_count
    }

    /// `background + α·⌊√background⌋`, exact in 1/256 counts.
    ///
    /// `W` is the width of the counters the background comes from. The level saturates at
    /// the largest `U24F8`, which no [`Count`] exceeds.
    #[inline]
    #[must_use]
    pub fn level<W: CounterWidth>(&self, background: Count) -> U24F8 {
        // 16 bits of α times at most 12 bits of root: no overflow.
        let above = u32::from(self.alpha.to_bits()) * square_root::<W>(background.raw());
        U24F8::from_bits((background.raw() << 8).saturating_add(above))
    }

    /// Whether a peak of `peak` photons stands clear: strictly above the level,
    /// and not below the minimum count.
    #[inline]
    #[must_use]
    pub fn is_exceeded<W: CounterWidth>(&self, peak: Count, background: Count) -> bool {
        (peak.raw() << 8) > self.level::<W>(background).to_bits()
            && peak.raw() >= self.minimum_count.raw()
    }

    /// The lowest background a bin, in counts of the width `W`, whose level a peak
    /// of `peak` photons does not exceed: one more than the largest count if every
    /// level is exceeded.
    ///
    /// With `r` the root, `peak ≤ background + α·r` is a straight line in the
    /// background from `r²` on, up to the next square. The last `r` whose line
    /// begins below the peak comes out of the iterations of the square root.
    #[inline]
    #[must_use]
    pub fn lowest_background<W: CounterWidth>(&self, peak: Count) -> u32 {
        let (root, left) = root_below::<W>(peak.raw() << 8, self.alpha.to_bits());
        root * root + left.div_ceil(256).min(2 * root + 1)
    }
}
