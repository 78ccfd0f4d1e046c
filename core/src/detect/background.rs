//! The background of the paper's rule: how many photons a bin holds without a target.
//!
//! Take the half of the histogram without the peak, and split it into two quadrants. The
//! background is the smaller of the two quadrants' maxima. That needs no division. A
//! pulse across the middle affects at most one quadrant.
//!
//! It is a *maximum* of a quarter of the bins, so it lies above the mean: about two
//! standard deviations for 32 bins. The α for a given false-alarm rate is therefore
//! lower than in the paper's Eq. 11.
//!
//! ```
//! use dtof_core::{BinIndex, RangeGate};
//! use dtof_core::paper::quadrant_background;
//!
//! // Peak in the upper half, so bins 0..=3 count: maxima 5 and 4, the smaller is 4.
//! let counts = [5u16, 1, 4, 2, 0, 9, 3, 0];
//! let level = quadrant_background(&counts, &RangeGate::full(), BinIndex::saturating(5));
//! assert_eq!(level.raw(), 4);
//! ```
//!
//! Cost: one pass over half of the gated bins.
//!
//! Source: the paper's section IV-B, which uses it instead of the average of all bins:
//! [`AverageRule`](crate::AverageRule).

use core::ops::Range;

use crate::histogram::counter::PhotonCount;
use crate::histogram::excluded::ExcludedBins;
use crate::histogram::gate::RangeGate;
use crate::units::{BinIndex, Count};

/// The paper's quadrant estimate over the gated bins.
///
/// Counts beyond [`Count::MAX`] are taken as [`Count::MAX`].
// Out of line: most looks end without it.
#[inline(never)]
#[must_use]
pub fn quadrant_background<C: PhotonCount, const BINS: usize>(
    counts: &[C; BINS],
    gate: &RangeGate<BINS>,
    peak: BinIndex,
) -> Count {
    let [lower, upper] = quadrants_without(counts, gate, peak);
    Count::saturating(C::highest(lower).min(C::highest(upper)))
}

/// Whether [`quadrant_background`] is `level` or more.
///
/// Cheaper: it stops at the first such count of each quadrant.
#[inline(always)]
pub(super) fn background_reaches<C: PhotonCount, const BINS: usize>(
    counts: &[C; BINS],
    gate: &RangeGate<BINS>,
    peak: BinIndex,
    level: u32,
) -> bool {
    let [lower, upper] = quadrants_without(counts, gate, peak);
    C::any_reaches(lower, level) && C::any_reaches(upper, level)
}

/// [`quadrant_background`] with excluded bins: a quadrant of which more than half is excluded
/// does not count. `None` if no quadrant is left.
#[inline(never)]
pub(super) fn background_without<C: PhotonCount, const BINS: usize>(
    counts: &[C; BINS],
    gate: &RangeGate<BINS>,
    peak: BinIndex,
    excluded: &ExcludedBins,
) -> Option<Count> {
    let [start, lower, middle, upper, end] = gate.quadrant_starts();
    let quadrants = if peak.raw() < middle {
        [middle..upper, upper..end]
    } else {
        [start..lower, lower..middle]
    };
    let highest = |bins: Range<u16>| {
        let (first, last) = (bins.start, bins.end.saturating_sub(1));
        let is_kept = 2 * excluded.bins_among(first..=last) <= u32::from(bins.end - bins.start);
        let bins = usize::from(bins.start)..usize::from(bins.end);
        is_kept.then(|| C::highest(counts.get(bins).unwrap_or_default()))
    };
    let [one, other] = quadrants.map(highest);
    let least = match (one, other) {
        (Some(one), Some(other)) => one.min(other),
        _ => one.or(other)?,
    };
    Some(Count::saturating(least))
}

/// The two quadrants of the half without the peak.
#[inline(always)]
fn quadrants_without<'a, C, const BINS: usize>(
    counts: &'a [C; BINS],
    gate: &RangeGate<BINS>,
    peak: BinIndex,
) -> [&'a [C]; 2] {
    let [lower, upper] = halves(counts.get(gate.bins()).unwrap_or_default());
    let in_lower = usize::from(peak.raw()) < gate.bins().start + lower.len();
    halves(if in_lower { upper } else { lower })
}

/// With an odd number the second half has one more. Halving twice gives `n/4`, `n/2`
/// and `3n/4`, each rounded down.
#[inline(always)]
fn halves<C>(bins: &[C]) -> [&[C]; 2] {
    let halves = bins.split_at_checked(bins.len() / 2);
    halves.unwrap_or_default().into()
}
