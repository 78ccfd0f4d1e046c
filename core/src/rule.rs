//! Detection rules: when does a peak stand clear of the background?
//!
//! [`PaperRule`] is the default and stays faithful to the paper. Another rule
//! implements [`DetectionRule`] and is given to
//! [`PixelConfig`](crate::PixelConfig) as its type parameter; histogram, pixel,
//! depth and events stay the same.

use fixed::types::{U8F8, U24F8};

use crate::background;
use crate::gate::RangeGate;
use crate::histogram::{CounterWidth, Histogram};
use crate::peak::Peak;
use crate::photon_count::PhotonCount;
use crate::threshold::Threshold;
use crate::units::{BinIndex, Count};

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
}

/// A background of whole counts, as [`DetectionRule::detect`] gives it. Exact.
#[inline]
#[must_use]
pub const fn whole_background(background: Count) -> U24F8 {
    U24F8::from_bits(background.raw() << U24F8::FRAC_NBITS)
}

/// The paper's rule: the peak bin against the quadrant background plus α of its
/// standard deviations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PaperRule {
    threshold: Threshold,
}

impl PaperRule {
    /// See [`Threshold::new`].
    #[must_use]
    pub const fn new(alpha: U8F8, minimum_count: Count) -> Self {
        Self {
            threshold: Threshold::new(alpha, minimum_count),
        }
    }

    /// The threshold it applies.
    #[must_use]
    pub const fn threshold(&self) -> &Threshold {
        &self.threshold
    }

    /// One decision on a histogram that arrives whole: the peak and the background
    /// a bin if it is a detection, the same as [`detect`](crate::detect) gives for a
    /// [`Histogram`] of these counts, none of which may exceed `W`'s. Whether the
    /// peak's counter is full is the caller's to see.
    ///
    /// Costs most often one pass over the bins, two at a time, for the bits set in any
    /// count of a quadrant: these tell its maximum to within a factor of two, often
    /// enough to know that nothing can fire. With a gate, and where a factor of two
    /// cannot be enough, the maxima themselves are worked out.
    #[inline]
    #[must_use]
    pub fn detect_whole<W: CounterWidth, const BINS: usize>(
        &self,
        counts: &[W::Counter; BINS],
        gate: &RangeGate<BINS>,
    ) -> Option<(Peak, Count)> {
        // A quadrant must be of whole blocks.
        if BINS / 4 < BLOCK || !(BINS / 4).is_multiple_of(BLOCK) || !gate.is_full() {
            return self.detect_gated::<W, BINS>(counts, gate);
        }
        let [first, second, third, fourth] = background::quadrants(counts, &RangeGate::full());
        let union = W::Counter::union;
        let a = union(first);
        if self.needs_maxima(a) {
            return self.detect_ungated::<W, BINS>(counts);
        }
        let (b, c, d) = (union(second), union(third), union(fourth));
        let (lower, upper) = (a | b, c | d);
        // The peak is in the half with the highest bit, if only one has it.
        let in_lower = is_longer(lower, upper);
        let in_upper = is_longer(upper, lower);
        let (most, least) = if in_lower {
            (lower, c.min(d))
        } else if in_upper {
            (upper, a.min(b))
        } else {
            (lower | upper, a.min(b).min(c.min(d)))
        };
        // No peak is above `most`, no background below the highest bit of `least`.
        let level = self.threshold.level::<W>(highest_bit(least));
        if !self.exceeds(Count::saturating(most), level) {
            return None;
        }
        let (half, (one, other), (x, y), [in_one, in_other]) = if in_lower {
            (0, (first, second), (third, fourth), [a, b])
        } else if in_upper {
            (BINS / 2, (third, fourth), (first, second), [c, d])
        } else {
            return self.detect_ungated::<W, BINS>(counts);
        };
        let (start, quadrant) = if is_longer(in_one, in_other) {
            (half, one)
        } else if is_longer(in_other, in_one) {
            (half + BINS / 4, other)
        } else {
            return self.detect_ungated::<W, BINS>(counts);
        };
        let (count, index) = highest_with_bit(quadrant, highest_bit(most).raw());
        if !self.exceeds(count, level) {
            return None;
        }
        let background = Count::saturating(W::Counter::highest(x).min(W::Counter::highest(y)));
        if !self.exceeds(count, self.threshold.level::<W>(background)) {
            return None;
        }
        let bin = BinIndex::saturating(u16::try_from(start + index).ok()?);
        Some((Peak { bin, count }, background))
    }

    /// Whether a quadrant with the bits `union` leaves little hope that bits are
    /// enough: the highest count may be twice the background, and α standard deviations
    /// of it are less than that from a background of α² on.
    #[inline(always)]
    fn needs_maxima(&self, union: u32) -> bool {
        let alpha = u32::from(self.threshold.alpha().to_bits());
        union > (alpha * alpha) >> 15
    }

    #[inline(always)]
    fn exceeds(&self, peak: Count, level: U24F8) -> bool {
        (peak.raw() << 8) > level.to_bits() && peak >= self.threshold.minimum_count()
    }

    /// [`Self::detect_by_maxima`] with quadrants known when compiled.
    // Kept apart from the decisions that end without it.
    #[inline(never)]
    fn detect_ungated<W: CounterWidth, const BINS: usize>(
        &self,
        counts: &[W::Counter; BINS],
    ) -> Option<(Peak, Count)> {
        self.detect_by_maxima::<W, BINS>(counts, &RangeGate::full())
    }

    /// [`Self::detect_by_maxima`] with any gate.
    #[inline(never)]
    fn detect_gated<W: CounterWidth, const BINS: usize>(
        &self,
        counts: &[W::Counter; BINS],
        gate: &RangeGate<BINS>,
    ) -> Option<(Peak, Count)> {
        self.detect_by_maxima::<W, BINS>(counts, gate)
    }

    /// The maxima of the four quadrants tell the peak's count, its half and the
    /// background. Only a detection is looked for in its quadrant.
    #[inline(always)]
    fn detect_by_maxima<W: CounterWidth, const BINS: usize>(
        &self,
        counts: &[W::Counter; BINS],
        gate: &RangeGate<BINS>,
    ) -> Option<(Peak, Count)> {
        let [first, second, third, fourth] = background::quadrants(counts, gate);
        let highest = W::Counter::highest;
        let [a, b, c, d] = [
            highest(first),
            highest(second),
            highest(third),
            highest(fourth),
        ];
        let (highest, background) = if a.max(b) >= c.max(d) {
            (a.max(b), c.min(d))
        } else {
            (c.max(d), a.min(b))
        };
        let (count, background) = (Count::saturating(highest), Count::saturating(background));
        if !self.threshold.is_exceeded::<W>(count, background) {
            return None;
        }
        // The lowest of the highest bins: in the first quadrant that has one.
        let (before, quadrant) = if a == highest {
            (0, first)
        } else if b == highest {
            (first.len(), second)
        } else if c == highest {
            (first.len() + second.len(), third)
        } else {
            (first.len() + second.len() + third.len(), fourth)
        };
        let bin = before + W::Counter::first_reaching(quadrant, highest)?;
        let bin = BinIndex::saturating(gate.first() + u16::try_from(bin).ok()?);
        Some((Peak { bin, count }, background))
    }
}

/// Bins that are searched or left out together.
const BLOCK: usize = 8;

/// The highest of some counts, which has `bit` set, and which is the first of it.
#[inline(never)]
fn highest_with_bit<C: PhotonCount>(counts: &[C], bit: u32) -> (Count, usize) {
    let (blocks, _) = counts.as_chunks::<BLOCK>();
    let (mut highest, mut found) = (0, 0);
    for (index, block) in blocks.iter().enumerate() {
        if C::union(block) & bit != 0 {
            let of_block = C::highest(block);
            if of_block > highest {
                (highest, found) = (of_block, index);
            }
        }
    }
    let block = blocks.get(found).map_or(&[][..], |block| block);
    let index = C::first_reaching(block, highest).unwrap_or_default();
    (Count::saturating(highest), BLOCK * found + index)
}

/// Whether `one` has a bit set above all of `other`.
#[inline(always)]
const fn is_longer(one: u32, other: u32) -> bool {
    one & !other > other
}

/// The highest bit set, alone.
#[inline(always)]
const fn highest_bit(bits: u32) -> Count {
    match (1u32 << 31).checked_shr(bits.leading_zeros()) {
        Some(bit) => Count::saturating(bit),
        None => Count::saturating(0),
    }
}

impl DetectionRule for PaperRule {
    #[inline(always)]
    fn detect<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
    ) -> Option<U24F8> {
        if peak.count < self.threshold.minimum_count() {
            return None;
        }
        // Most looks end here, without the background itself.
        let lowest = self.threshold.lowest_background::<W>(peak.count);
        if background::quadrant_reaches(histogram.counts(), gate, peak.bin, lowest) {
            return None;
        }
        let background = background::quadrant(histogram.counts(), gate, peak.bin);
        Some(whole_background(background))
    }
}
