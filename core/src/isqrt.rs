//! The square root: the paper's iterative algorithm (Alg. 1).
//!
//! One result bit an iteration, from the highest down, with shifts, additions
//! and compares only. `ITERATIONS` iterations give the exact floor of the root
//! of every integer below `4^ITERATIONS`: five cover the 10-bit counts of the
//! paper, eight cover 16 bits, twelve cover 24. (The listing starts at
//! `b = 32`, a sixth iteration that no 10-bit input ever takes.)
//!
//! ```
//! use dtof_core::isqrt;
//!
//! assert_eq!(isqrt::<5>(1023), 31);
//! assert_eq!(isqrt::<8>(65_535), 255);
//! ```

/// Does `$step` for each shift below `$iterations`, from the highest down. Not a
/// loop, which takes twice as long where it is not unrolled, at opt-level s.
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
    let _ = remainder; // the last is not used
    root
}

/// The largest `r` for which `r² + alpha·r < level`, or 0, and what is left of
/// `level`; the latter and `alpha` in 1/256.
///
/// The same algorithm with an addition more. `ITERATIONS` is at most 12 (checked when
/// compiled), so that nothing reaches 2³¹.
#[inline]
#[must_use]
pub(crate) const fn root_below<const ITERATIONS: u32>(level: u32, alpha: u16) -> (u32, u32) {
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
