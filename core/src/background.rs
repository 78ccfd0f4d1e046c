//! The background: how many photons a bin holds without a target.
//!
//! The paper's rule (section IV-B): take the half of the histogram without the
//! peak, split it into two quadrants, and use the smaller of the two quadrants'
//! maxima. It needs no division and comes almost free with the peak search, and
//! a pulse that straddles the middle spoils at most one quadrant.
//!
//! It is a *maximum* of a quarter of the bins, so it lies above the mean: about
//! two standard deviations for 32 bins. The α that gives a wanted false
//! positive rate is therefore lower than the paper's Eq. 11 has it.
//!
//! ```
//! use dtof_core::{BinIndex, RangeGate, background};
//!
//! // Peak in the upper half, so bins 0..=3 count: maxima 5 and 4, the smaller is 4.
//! let counts = [5u16, 1, 4, 2, 0, 9, 3, 0];
//! let level = background::quadrant(&counts, &RangeGate::full(), BinIndex::saturating(5));
//! assert_eq!(level.raw(), 4);
//! ```

use crate::gate::RangeGate;
use crate::units::{BinIndex, Count};

/// The paper's quadrant estimate over the gated bins.
///
/// Costs one pass over half of the gated bins. Counts beyond [`Count::MAX`]
/// are taken as [`Count::MAX`].
#[inline]
#[must_use]
pub fn quadrant<C: Copy + Into<u32>, const BINS: usize>(
    counts: &[C; BINS],
    gate: &RangeGate<BINS>,
    peak: BinIndex,
) -> Count {
    let [start, first_quarter, middle, third_quarter, end] = gate.quadrant_starts();
    let (from, between, to) = if peak.raw() < middle {
        (middle, third_quarter, end)
    } else {
        (start, first_quarter, middle)
    };
    highest(counts, from, between).min(highest(counts, between, to))
}

/// The highest count from bin `from` up to, not including, bin `to`.
#[inline]
fn highest<C: Copy + Into<u32>>(counts: &[C], from: u16, to: u16) -> Count {
    let bins = counts.get(usize::from(from)..usize::from(to));
    let counts = bins.unwrap_or_default().iter();
    // Not `max()`, which carries a reference along with each count.
    Count::saturating(counts.fold(0, |highest, &count| count.into().max(highest)))
}
