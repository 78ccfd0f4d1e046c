//! The weights of the bins in the moment of a window.
//!
//! About the start of a bin, and about its middle, the weight of a bin is fixed: a bin from
//! `a` to `b` after the place counts `(b² - a²) / h²`, with both limited to the half width `h`.
//! Before the place the weight is negative. The weights of each side add up to 1, so that a
//! flat background balances whatever the half widths are.
//!
//! Between the two the moment is not a straight line: for the pulse that the window suits it
//! is steeper about the one than about the other. So the weights about the middle have a
//! gain. With it a straight line is exact for a pulse a quarter of a bin from the middle, and
//! nearly so in between.
//!
//! Weights are whole numbers of 1/4096. Cost: 68 bytes a window.

use crate::histogram::counter::CounterWidth;

/// Bins that count before a place, and after it.
const REACH: usize = 4;
/// The same in 1/256 bin.
const FARTHEST: i32 = 1024;

/// For windows about the start of a bin, and about its middle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Weights {
    start: [i32; REACH * 2],
    middle: [i32; REACH * 2 + 1],
}

/// The sum of the weights of a side about the start of a bin.
const WHOLE: u32 = 1 << 12;

/// The gain for half widths from 1 to 4 bins, each 1/16 more, times [`WHOLE`]: the moment about
/// the start of the next bin over that about the middle, for a Gaussian pulse of the standard
/// deviation `(h - 1/2) / 2` a quarter of a bin after the middle. `core/tests/depth/formula.rs`
/// computes it again.
const GAINS: [u16; 49] = [
    23_655, 15_838, 11_295, 8_461, 6_604, 5_346, 4_478, 3_874, 3_456, 3_462, 3_530, 3_648, 3_805,
    3_987, 4_184, 4_382, 4_571, 4_506, 4_422, 4_325, 4_219, 4_112, 4_006, 3_906, 3_815, 3_860,
    3_914, 3_974, 4_038, 4_105, 4_173, 4_240, 4_305, 4_264, 4_221, 4_175, 4_128, 4_081, 4_035,
    3_991, 3_948, 3_978, 4_010, 4_043, 4_077, 4_112, 4_146, 4_180, 4_213,
];

impl Weights {
    /// From the half widths, in 1/256 bin.
    pub const fn of(before: u16, after: u16) -> Self {
        Self {
            start: weights(0, before, after, WHOLE),
            middle: weights(128, before, after, gain(before, after)),
        }
    }

    /// The moment of the photons of `bins` about the start of one of them: above 0 if they lie
    /// after it. The `excess` lowest bits of counts are dropped, so that 10 are left.
    #[inline(always)]
    pub fn at_start<W: CounterWidth>(&self, bins: &[W::Counter], bin: usize, excess: u32) -> i32 {
        moment::<W, _>(bins, bin, &self.start, excess)
    }

    /// The same about the middle.
    #[inline(always)]
    pub fn at_middle<W: CounterWidth>(&self, bins: &[W::Counter], bin: usize, excess: u32) -> i32 {
        moment::<W, _>(bins, bin, &self.middle, excess)
    }
}

#[inline(always)]
fn moment<W: CounterWidth, const N: usize>(
    bins: &[W::Counter],
    bin: usize,
    weights: &[i32; N],
    excess: u32,
) -> i32 {
    let scaled = |count: u32| {
        if W::BITS > 10 {
            (count >> excess).min(1023)
        } else {
            count
        }
    };
    let bins = bins.get(bin.wrapping_sub(REACH)..);
    let Some::<&[W::Counter; N]>(bins) = bins.and_then(|bins| bins.first_chunk()) else {
        return 0;
    };
    let products = bins.iter().zip(weights);
    products.fold(0, |sum, (&count, &weight)| {
        sum + scaled(count.into()).cast_signed() * weight
    })
}

/// The weights of the bins about a place that lies `place` after the start of a bin, in 1/256 bin.
/// Those of each side add up to `whole`.
const fn weights<const N: usize>(place: i32, before: u16, after: u16, whole: u32) -> [i32; N] {
    let mut weights = [0; N];
    let mut left: &mut [i32] = &mut weights;
    let mut start = -FARTHEST - place;
    while let Some((weight, rest)) = left.split_first_mut() {
        let end = start + 256;
        *weight = below(end, after, whole) - below(start, after, whole)
            + below(-end, before, whole)
            - below(-start, before, whole);
        start = end;
        left = rest;
    }
    weights
}

/// The sum of the weights of a side up to `distance` from the place, which may lie on the other
/// side.
const fn below(distance: i32, half: u16, whole: u32) -> i32 {
    if distance <= 0 {
        return 0;
    }
    let half = half as u32;
    let distance = distance.cast_unsigned();
    let share = if distance < half {
        (distance << 15) / half
    } else {
        1 << 15
    };
    ((((share * share) >> 15) * whole) >> 15).cast_signed()
}

/// The gain for the narrower side.
const fn gain(before: u16, after: u16) -> u32 {
    let narrow = if before < after { before } else { after } - 256;
    let (row, rest) = ((narrow / 16) as usize, (narrow % 16) as u32);
    match GAINS.split_at_checked(row) {
        Some((_, &[gain, next, ..])) => (gain as u32 * (16 - rest) + next as u32 * rest) / 16,
        Some((_, &[gain])) => gain as u32,
        _ => WHOLE,
    }
}
