//! The z for a given rate of false alarms.
//!
//! Without a target each bin of each look is a trial of the window rule. Neighbouring
//! windows and successive looks share photons, so the looks of an exposure count as fewer
//! independent ones. The first table has the number of independent looks that the first `k`
//! looks count as, with one look every X laser cycles. For looks from `N = X·k` on, those
//! before are subtracted. The second table is the normal distribution's: the z that one in
//! so many trials exceeds.
//!
//! `core/tests/detect/window_z_tables.rs` computes both again, the first by simulation.
//! `core/tests/detect/window_z.rs` checks them with another simulation.

use fixed::types::U4F12;

use crate::histogram::gate::RangeGate;
use crate::units::BlockLevel;

/// Independent looks that the first 1, 2, 4, … looks count as, in 1/16.
const LOOKS: [u16; 11] = [12, 23, 45, 73, 112, 164, 222, 300, 388, 469, 573];

/// The highest z that [`z_for`] gives, 6.44, for 2³⁴ trials or more. There the rate of false
/// alarms may exceed the given one.
pub const HIGHEST_Z: U4F12 = U4F12::from_bits(26394);

/// z in 1/4096 for 2⁶, 2⁸, … trials.
const Z: [u16; 15] = [
    8822, 10896, 12686, 14283, 15737, 17079, 18331, 19509, 20625, 21687, 22702, 23677, 24614,
    25519, 26394,
];

/// The z of a [`WindowRule`](crate::WindowRule) for one false alarm in `one_in` exposures
/// without a target: 100 for 1 %, 1000 for 0.1 %.
///
/// `gate`, `x`, `l1` and `l2` are those of the [`PixelConfig`](crate::PixelConfig). With 8 to
/// 128 bins, 1 in 100 or 1000 and many looks an exposure, the rate is at most 1.5 times the
/// given one, whatever the width of the window and the background. With a single look, 512
/// bins or more, or 1 in a million, it is up to 2.5 times. With 128 bins and at least 0.4
/// photons a bin at the first look, it is at least 0.5 times the given one; with fewer bins
/// or photons, or a window of most of the bins, less. z is limited to 2.15, for 64 trials, to
/// [`HIGHEST_Z`](crate::rule::HIGHEST_Z).
///
/// ```
/// use dtof_core::{RangeGate, z_for};
///
/// let gate = RangeGate::<128>::full();
/// let z = z_for(100, &gate, 4, 40, 1000);
/// assert_eq!((z.to_num::<f64>() * 100.0).round(), 446.0);
/// ```
#[must_use]
pub fn z_for<const BINS: usize>(
    one_in: u32,
    gate: &RangeGate<BINS>,
    x: u16,
    l1: u16,
    l2: u16,
) -> U4F12 {
    let first = l1.checked_div(x).unwrap_or(0).saturating_add(1);
    let last = l2.saturating_sub(1).checked_div(x).unwrap_or(0);
    let looks = 16 + worth(last).saturating_sub(worth(first));
    let bins = gate.last() - gate.first() + 1;
    // At most 32 + 11 + 11 bits.
    let trials = u64::from(one_in) * u64::from(bins) * u64::from(looks) / 16;

    z_of(log2(trials))
}

/// [`z_for`] for pixels with blocks of so many levels. One in `one_in` pixels has a false
/// report in L2 laser cycles, its own or that of a block. Three quarters of these are reports
/// of pixels, the rest those of blocks with the z of
/// [`WindowRule::of_blocks`](crate::WindowRule::of_blocks). The patience does not matter:
/// without a target nearly all pixels feed their blocks.
#[must_use]
pub fn z_for_levels<const BINS: usize>(
    one_in: u32,
    gate: &RangeGate<BINS>,
    x: u16,
    l1: u16,
    l2: u16,
    levels: BlockLevel,
) -> U4F12 {
    let z = z_for(one_in, gate, x, l1, l2);
    if levels == BlockLevel::PIXEL {
        return z;
    }
    // 4/3 as many trials.
    z_of(trials_of(z) + 106)
}

/// 1 in the unit of [`log2`].
pub(super) const ONE: u32 = 256;

/// The z for so many trials, as a binary logarithm in 1/256.
#[allow(clippy::cast_possible_truncation, reason = "the highest z is 16 bits")]
fn z_of(trials: u32) -> U4F12 {
    let above = trials.saturating_sub(6 * ONE);
    let (index, part) = ((above >> 9) as usize, above & 511);
    let z = match Z.get(index..) {
        Some(&[low, high, ..]) => u32::from(low) + ((u32::from(high - low) * part) >> 9),
        _ => u32::from(HIGHEST_Z.to_bits()),
    };
    U4F12::from_bits(z as u16)
}

/// The trials for a z, as a binary logarithm in 1/256: the inverse of [`z_of`], limited to
/// its range.
pub(super) fn trials_of(z: U4F12) -> u32 {
    let z = z.to_bits();
    let mut trials = 6 * ONE;
    for (&low, &high) in Z.iter().zip(Z.iter().skip(1)) {
        let above = u32::from(z.saturating_sub(low)) << 9;
        let part = above.checked_div(u32::from(high - low)).unwrap_or(0);
        trials += part.min(2 * ONE);
    }
    trials
}

/// The z with half of the false alarms.
pub(super) fn twice_the_trials(z: U4F12) -> U4F12 {
    z_of(trials_of(z) + ONE).max(z)
}

/// The z near the last event, and elsewhere, each with half of the false alarms of `z`. The
/// windows that contain one bin count as [`NEAR`] bins.
pub(super) fn tracking_z<const BINS: usize>(z: U4F12, gate: &RangeGate<BINS>) -> [U4F12; 2] {
    let bins = gate.last() - gate.first() + 1;
    let half = trials_of(z) + ONE;
    let near = (half + log2(NEAR.into())).saturating_sub(log2(bins.into()));
    [z_of(near).min(z), z_of(half).max(z)]
}

/// Bins that the windows around an expected one count as.
const NEAR: u16 = 2;

/// The z with which the blocks of all `levels` together have a third of the false alarms of
/// pixels with `z`. A block has a quarter more than a pixel with the same z.
pub(super) fn block_z(z: U4F12, levels: BlockLevel) -> U4F12 {
    // 3 · 5/4 · levels.
    let share = log2(15 * u64::from(levels.raw())).saturating_sub(2 * ONE);
    z_of(trials_of(z) + share).max(z)
}

/// Independent looks that the first `looks` count as, in 1/16: interpolated between powers
/// of two, and extrapolated by the last step.
fn worth(looks: u16) -> u32 {
    let power = looks.checked_ilog2().unwrap_or(0);
    let part = u32::from(looks).saturating_sub(1 << power);
    let index = power.min(9);
    let Some(&[low, high, ..]) = LOOKS.get(index as usize..) else {
        return 0;
    };
    let (low, rise) = (u32::from(low), u32::from(high - low));
    low + rise * (power - index) + ((rise * part) >> power)
}

/// The binary logarithm in 1/256, interpolated between powers of two; 0 for 0. `value` is
/// less than 2⁵⁶.
#[allow(
    clippy::cast_possible_truncation,
    reason = "only the last 8 bits are kept"
)]
fn log2(value: u64) -> u32 {
    let power = value.checked_ilog2().unwrap_or(0);
    let part = ((value << 8) >> power) as u32 & 255;
    (power << 8) | part
}
