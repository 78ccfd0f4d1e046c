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
// Kept apart from the looks that end without it.
#[inline(never)]
#[must_use]
pub fn quadrant<C: Copy + Into<u32>, const BINS: usize>(
    counts: &[C; BINS],
    gate: &RangeGate<BINS>,
    peak: BinIndex,
) -> Count {
    let [lower, upper] = quadrants_without(counts, gate, peak);
    Count::saturating(highest(lower).min(highest(upper)))
}

/// Whether [`quadrant`] is `level` or more.
///
/// Costs less: it ends at the first such count of each quadrant.
#[inline(always)]
#[must_use]
pub fn quadrant_reaches<C: Copy + Into<u32>, const BINS: usize>(
    counts: &[C; BINS],
    gate: &RangeGate<BINS>,
    peak: BinIndex,
    level: u32,
) -> bool {
    let [lower, upper] = quadrants_without(counts, gate, peak);
    reaches(lower, level) && reaches(upper, level)
}

/// The two quadrants of the half without the peak.
#[inline(always)]
fn quadrants_without<'a, C, const BINS: usize>(
    counts: &'a [C; BINS],
    gate: &RangeGate<BINS>,
    peak: BinIndex,
) -> [&'a [C]; 2] {
    let gated = counts.get(gate.bins()).unwrap_or_default();
    // Rounded down twice, this is where `RangeGate::quadrant_starts` says.
    let middle = gated.len() / 2;
    let (lower, upper) = gated.split_at_checked(middle).unwrap_or_default();
    let peak_in_lower = usize::from(peak.raw()) < gate.bins().start + middle;
    let half = if peak_in_lower { upper } else { lower };
    half.split_at_checked(half.len() / 2)
        .unwrap_or_default()
        .into()
}

/// The highest count.
#[inline(always)]
fn highest<C: Copy + Into<u32>>(counts: &[C]) -> u32 {
    // Not `max()`, which carries a reference along with each count.
    let higher = |highest: u32, &count: &C| count.into().max(highest);
    let (fours, rest) = counts.as_chunks::<4>();
    let highest = fours.iter().fold(0, |highest, [a, b, c, d]| {
        higher(higher(higher(higher(highest, a), b), c), d)
    });
    rest.iter().fold(highest, higher)
}

/// Whether a count is `level` or more.
#[inline(always)]
fn reaches<C: Copy + Into<u32>>(counts: &[C], level: u32) -> bool {
    let reaches = |&count: &C| count.into() >= level;
    // Four a turn, so that the loop itself costs little.
    let (fours, rest) = counts.as_chunks::<4>();
    let one_of = |[a, b, c, d]: &[C; 4]| reaches(a) || reaches(b) || reaches(c) || reaches(d);
    fours.iter().any(one_of) || rest.iter().any(reaches)
}
