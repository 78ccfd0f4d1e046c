//! The square root is the exact floor, and the paper's Alg. 1.

use dtof_core::isqrt;
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

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

#[test]
fn five_iterations_are_exact_for_all_10_bit_values() {
    for value in 0..=1023 {
        assert!(is_floor(isqrt::<5>(value), value), "{value}");
    }
}

#[test]
fn eight_iterations_are_exact_for_all_16_bit_values() {
    for value in 0..=65_535 {
        assert!(is_floor(isqrt::<8>(value), value), "{value}");
    }
}

#[test]
fn twelve_iterations_are_exact_at_every_boundary_of_24_bits() {
    assert_eq!(isqrt::<12>(0), 0);
    for root in 1..4096u32 {
        let square = root * root;
        for value in [square - 1, square, square + 1] {
            assert_eq!(isqrt::<12>(value), value.isqrt(), "{value}");
        }
    }
    assert_eq!(isqrt::<12>(0x00ff_ffff), 4095);
}

#[test]
fn twelve_iterations_are_exact_for_a_million_random_24_bit_values() {
    let mut rng = Pcg32::seed_from_u64(1);
    for _ in 0..1_000_000 {
        let value = rng.next_u32() >> 8;
        assert_eq!(isqrt::<12>(value), value.isqrt(), "{value}");
    }
}

#[test]
fn sixteen_iterations_are_exact_at_every_boundary_of_32_bits() {
    for root in 1..65_536u32 {
        let square = root * root;
        for value in [square - 1, square, square + 1] {
            assert_eq!(isqrt::<16>(value), value.isqrt(), "{value}");
        }
    }
    assert_eq!(isqrt::<16>(u32::MAX), 65_535);
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
    check_limit::<5>();
    check_limit::<6>();
    check_limit::<8>();
    check_limit::<12>();
    check_limit::<15>();
    check_limit::<16>();
}

proptest! {
    #[test]
    fn any_value_and_width(value: u32) {
        let root = value.isqrt();
        prop_assert_eq!(isqrt::<5>(value), root.min(31));
        prop_assert_eq!(isqrt::<8>(value), root.min(255));
        prop_assert_eq!(isqrt::<12>(value), root.min(4095));
        prop_assert_eq!(isqrt::<16>(value), root);
    }
}
