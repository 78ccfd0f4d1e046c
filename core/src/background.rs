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

use fixed::types::U24F8;

use crate::gate::RangeGate;
use crate::photon_count::PhotonCount;
use crate::units::{BinIndex, Count};

/// The mean of `photons` in so many `bins`, in 1/256 rounded down; `None` of no bins.
#[inline(always)]
pub(crate) fn mean(photons: u32, bins: u32) -> Option<U24F8> {
    let whole = photons.checked_div(bins)?;
    // Less than 2¹⁰ bins, so that the rest fits.
    let rest = (photons.wrapping_sub(whole.wrapping_mul(bins)) << 8).checked_div(bins)?;
    Some(U24F8::from_bits((whole << 8) + rest))
}

/// The paper's quadrant estimate over the gated bins.
///
/// Costs one pass over half of the gated bins. Counts beyond [`Count::MAX`]
/// are taken as [`Count::MAX`].
// Kept apart from the looks that end without it.
#[inline(never)]
#[must_use]
pub fn quadrant<C: PhotonCount, const BINS: usize>(
    counts: &[C; BINS],
    gate: &RangeGate<BINS>,
    peak: BinIndex,
) -> Count {
    let [lower, upper] = quadrants_without(counts, gate, peak);
    Count::saturating(C::highest(lower).min(C::highest(upper)))
}

/// Whether [`quadrant`] is `level` or more.
///
/// Costs less: it ends at the first such count of each quadrant.
#[inline(always)]
#[must_use]
pub fn quadrant_reaches<C: PhotonCount, const BINS: usize>(
    counts: &[C; BINS],
    gate: &RangeGate<BINS>,
    peak: BinIndex,
    level: u32,
) -> bool {
    let [lower, upper] = quadrants_without(counts, gate, peak);
    C::any_reaches(lower, level) && C::any_reaches(upper, level)
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

/// The quadrants of the gated bins, as [`RangeGate::quadrant_starts`] has them.
#[inline(always)]
pub(crate) fn quadrants<'a, C, const BINS: usize>(
    counts: &'a [C; BINS],
    gate: &RangeGate<BINS>,
) -> [&'a [C]; 4] {
    let [lower, upper] = halves(counts.get(gate.bins()).unwrap_or_default());
    let ([a, b], [c, d]) = (halves(lower), halves(upper));
    [a, b, c, d]
}

/// Of an odd number the second has one more; halved twice this gives `n/4`, `n/2`
/// and `3n/4`, each rounded down.
#[inline(always)]
fn halves<C>(bins: &[C]) -> [&[C]; 2] {
    let halves = bins.split_at_checked(bins.len() / 2);
    halves.unwrap_or_default().into()
}
