//! The square root is the exact floor, and the paper's Alg. 1.

use dtof_core::paper::isqrt;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use crate::common::parallel;

/// Whether `root` is the floor of the root of `value`, by the definition.
fn is_floor(root: u32, value: u32) -> bool {
    let root = u64::from(root);
    root * root <= u64::from(value) && u64::from(value) < (root + 1) * (root + 1)
}

/// Alg. 1 as printed: six iterations from b = 32.
fn listing(background: u32) -> u32 {
    let mut v_bit = 5;
    let mut n = 0;
    let mut b = 32;
    let mut bg_temp = background;
    while b > 0 {
        let temp = ((n << 1) + b) << v_bit;
        v_bit -= 1;
        if bg_temp >= temp {
            n += b;
            bg_temp -= temp;
        }
        b >>= 1;
    }
    n
}

/// Each number of iterations is exact up to its largest root.
fn check(value: u32) {
    let root = value.isqrt();
    assert!(is_floor(root, value), "{value}");
    assert_eq!(isqrt::<5>(value), root.min(31), "{value}");
    assert_eq!(isqrt::<8>(value), root.min(255), "{value}");
    assert_eq!(isqrt::<12>(value), root.min(4095), "{value}");
    assert_eq!(isqrt::<16>(value), root, "{value}");
}

#[test]
fn all_16_bit_values_are_exact() {
    (0..=65_535).for_each(check);
}

#[test]
fn every_boundary_of_32_bits_is_exact() {
    for root in 1..65_536u32 {
        let square = root * root;
        [square - 1, square, square + 1].into_iter().for_each(check);
    }
    check(u32::MAX);
}

/// In steps of 2¹⁶, within which the roots go up one by one.
#[test]
#[ignore = "takes a minute: `.ci/long proofs`"]
fn all_32_bit_values_are_exact() {
    parallel::for_each(1 << 16, |high| {
        let high = (high as u32) << 16;
        let mut root = high.isqrt();
        assert!(is_floor(root, high));
        for value in high..=high | 0xffff {
            let next = u64::from(root) + 1;
            if u64::from(value) == next * next {
                root += 1;
            }
            let found = [
                isqrt::<5>(value),
                isqrt::<6>(value),
                isqrt::<8>(value),
                isqrt::<12>(value),
                isqrt::<16>(value),
            ];
            let expected = [31, 63, 255, 4095, 65_535].map(|largest| root.min(largest));
            assert_eq!(found, expected, "{value}");
        }
    });
}

#[test]
fn a_million_random_values_of_32_and_24_bits_are_exact() {
    let mut rng = Pcg32::seed_from_u64(1);
    for _ in 0..1_000_000 {
        let value = rng.next_u32();
        [value, value >> 8].into_iter().for_each(check);
    }
}

#[test]
fn the_listing_as_printed_is_the_same_function_on_10_bits() {
    for value in 0..=1023 {
        assert_eq!(isqrt::<5>(value), listing(value), "{value}");
        assert_eq!(isqrt::<6>(value), listing(value), "{value}");
    }
}

/// For one number of iterations: exact up to the limit, the largest root past it.
fn check_limit<const ITERATIONS: u32>() {
    let limit = 1u64 << (2 * ITERATIONS); // 4^ITERATIONS
    let largest = (1 << ITERATIONS) - 1;
    for value in [limit - 1, limit, limit + 1, 2 * limit, u32::MAX.into()] {
        let Ok(value) = u32::try_from(value) else {
            continue; // 4^16 is past every u32
        };
        assert_eq!(isqrt::<ITERATIONS>(value), largest, "{value}");
    }
}

#[test]
fn values_past_the_limit_give_the_largest_root() {
    check_limit::<1>();
    check_limit::<2>();
    check_limit::<6>();
    check_limit::<15>();
}
