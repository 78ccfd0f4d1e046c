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
    let mut shift = ITERATIONS;
    while shift > 0 {
        shift -= 1;
        let bit = 1 << shift;
        // (root + bit)² - root², which the remainder must still hold.
        let trial = ((root << 1) + bit) << shift;
        if remainder >= trial {
            root += bit;
            remainder -= trial;
        }
    }
    root
}
