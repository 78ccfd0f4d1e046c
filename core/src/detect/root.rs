//! The square root of a count.
//!
//! One result bit an iteration, from the highest down, with shifts, additions
//! and compares only. `ITERATIONS` iterations give the exact floor of the root
//! of every integer below `4^ITERATIONS`. Five cover the 10-bit counts of the
//! paper, eight cover 16 bits, twelve cover 24.
//!
//! ```
//! use dtof_core::paper::isqrt;
//!
//! assert_eq!(isqrt::<5>(1023), 31);
//! assert_eq!(isqrt::<8>(65_535), 255);
//! ```
//!
//! Cost on a Cortex-M4: 27 instructions for five iterations.
//!
//! Source: the paper's Alg. 1. Its listing starts at `b = 32`, a sixth iteration that
//! no 10-bit input ever takes.

use crate::histogram::counter::CounterWidth;

/// Does `$step` for each shift below `$iterations`, from the highest down. A loop that is
/// not unrolled, as at opt-level s, takes twice as long.
macro_rules! for_each_shift {
    ($iterations:ident, |$shift:ident| $step:block) => {
        for_each_shift!($iterations, |$shift| $step, 15 14 13 12 11 10 9 8 7 6 5 4 3 2 1 0)
    };
    ($iterations:ident, |$shift:ident| $step:block, $($value:literal)*) => {
        $(if $iterations > $value {
            let $shift = $value;
            $step
        })*
    };
}

/// The floor of the square root: `r² ≤ value < (r + 1)²`.
///
/// `ITERATIONS` is 1 to 16 (checked when compiled). A `value` of
/// `4^ITERATIONS` or more gives the largest root that fits, `2^ITERATIONS - 1`.
#[inline]
#[must_use]
pub const fn isqrt<const ITERATIONS: u32>(value: u32) -> u32 {
    const { assert!(ITERATIONS >= 1 && ITERATIONS <= 16) };
    let mut root = 0;
    let mut remainder = value;
    for_each_shift!(ITERATIONS, |shift| {
        let bit = 1 << shift;
        // (root + bit)² - root², which the remainder must still hold.
        let trial = ((root << 1) + bit) << shift;
        if remainder >= trial {
            root += bit;
            remainder -= trial;
        }
    });
    let _ = remainder; // of the last iteration
    root
}

/// [`root_below`] with so many iterations.
///
/// The same algorithm with an addition more. `ITERATIONS` is at most 12 (checked when
/// compiled), so that nothing reaches 2³¹.
#[inline]
#[must_use]
const fn root_below_in<const ITERATIONS: u32>(level: u32, alpha: u16) -> (u32, u32) {
    const { assert!(ITERATIONS >= 1 && ITERATIONS <= 12) };
    // alpha + 2·root, in 1/256
    let alpha = alpha as u32;
    let mut slope = alpha;
    let mut remainder = level;
    for_each_shift!(ITERATIONS, |shift| {
        let trial = (slope + (1 << (shift + 8))) << shift;
        if remainder > trial {
            slope += 1 << (shift + 9);
            remainder -= trial;
        }
    });
    ((slope - alpha) >> 9, remainder)
}

/// The floor of the square root of any count of the width `W`.
#[inline]
pub(super) fn square_root<W: CounterWidth>(count: u32) -> u32 {
    if W::BITS <= 10 {
        isqrt::<5>(count)
    } else if W::BITS <= 16 {
        isqrt::<8>(count)
    } else {
        isqrt::<12>(count)
    }
}

/// The largest root of a count of the width `W` for which `r² + alpha·r < level`, or 0,
/// and the rest of `level`; `alpha` and `level` in 1/256. Nothing overflows.
#[inline]
pub(super) fn root_below<W: CounterWidth>(level: u32, alpha: u16) -> (u32, u32) {
    if W::BITS <= 10 {
        root_below_in::<5>(level, alpha)
    } else if W::BITS <= 16 {
        root_below_in::<8>(level, alpha)
    } else {
        root_below_in::<12>(level, alpha)
    }
}

#[cfg(test)]
mod tests {
    use rand_core::{Rng, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;
    use crate::histogram::counter::{Count10, Count16, Count24};

    /// Random levels and α, and the largest.
    #[test]
    fn no_root_below_a_level_overflows() {
        fn check<W: CounterWidth>(level: u32, alpha: u16) {
            let squared = |root: u32| {
                let (root, alpha) = (u64::from(root), u64::from(alpha));
                root * root * 256 + alpha * root
            };
            let (root, left) = root_below::<W>(level, alpha);
            assert_eq!(u64::from(level), squared(root) + u64::from(left));
            assert!(root == 0 || left > 0);
            let most = (1 << W::BITS.div_ceil(2)) - 1;
            assert!(root == most || squared(root + 1) >= u64::from(level));
        }
        let mut rng = Pcg32::seed_from_u64(10);
        for round in 0..100_000 {
            let (level, alpha) = match round % 4 {
                0 => (u32::MAX, rng.next_u32()),
                1 => (rng.next_u32(), u32::MAX),
                _ => (rng.next_u32() >> (rng.next_u32() % 32), rng.next_u32()),
            };
            let [low, high, ..] = alpha.to_le_bytes();
            let alpha = u16::from_le_bytes([low, high]);
            check::<Count10>(level, alpha);
            check::<Count16>(level, alpha);
            check::<Count24>(level, alpha);
        }
    }
}
