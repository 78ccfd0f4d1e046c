//! The threshold is exact, and strict.

use dtof_core::fixed::types::{U8F8, U24F8};
use dtof_core::paper::Threshold;
use dtof_core::{Count, Count10, Count16, Count24, CounterWidth};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use crate::common::parallel;

/// In 1/256: 0, the smallest, 1/2, the paper's 4 and 8, odd ones, the largest.
const ALPHAS: [u16; 12] = [
    0, 1, 128, 255, 256, 257, 640, 1024, 2048, 25_601, 65_534, 65_535,
];

/// The largest number whose square is not above `value`.
fn root(value: u64) -> u64 {
    let mut root = 0;
    while (root + 1) * (root + 1) <= value {
        root += 1;
    }
    root
}

/// In 1/256 counts, as wide as it may be.
fn true_level(alpha: u16, background: u32) -> u64 {
    u64::from(background) * 256 + u64::from(alpha) * root(background.into())
}

fn threshold(alpha: u16, minimum: u32) -> Threshold {
    Threshold::new(U8F8::from_bits(alpha), Count::new(minimum).unwrap())
}

fn level<W: CounterWidth>(alpha: u16, background: u32) -> U24F8 {
    threshold(alpha, 0).level::<W>(Count::new(background).unwrap())
}

fn fires<W: CounterWidth>(threshold: Threshold, peak: u32, background: u32) -> bool {
    threshold.is_exceeded::<W>(Count::new(peak).unwrap(), Count::new(background).unwrap())
}

#[test]
fn it_gives_back_what_it_was_made_of() {
    let threshold = Threshold::new(U8F8::lit("255.99609375"), Count::saturating(7));
    assert_eq!(threshold.alpha().to_bits(), 65_535);
    assert_eq!(threshold.minimum_count().raw(), 7);
}

#[test]
fn the_level_is_exact_for_all_10_bit_backgrounds() {
    for alpha in ALPHAS {
        for background in 0..1024 {
            let level = level::<Count10>(alpha, background);
            assert_eq!(u64::from(level.to_bits()), true_level(alpha, background));
            // Below the real-valued one by less than α.
            let real =
                f64::from(background) + f64::from(alpha) / 256.0 * f64::from(background).sqrt();
            let below = real - level.to_num::<f64>();
            assert!(below >= 0.0 && (below < f64::from(alpha) / 256.0 || alpha == 0));
        }
    }
}

#[test]
fn the_level_is_exact_for_all_16_bit_backgrounds() {
    for alpha in ALPHAS {
        for background in 0..=65_535 {
            let level = level::<Count16>(alpha, background);
            assert_eq!(u64::from(level.to_bits()), true_level(alpha, background));
        }
    }
}

#[test]
fn every_10_bit_peak_fires_strictly_above_the_level_only() {
    for alpha in ALPHAS {
        for background in 0..1024 {
            let level = true_level(alpha, background);
            for peak in 0..1024 {
                let expected = u64::from(peak) * 256 > level;
                let fires = fires::<Count10>(threshold(alpha, 0), peak, background);
                assert_eq!(fires, expected, "{alpha}/256, {background}, {peak}");
            }
        }
    }
}

#[test]
fn fewer_photons_than_the_minimum_never_fire() {
    for minimum in [0, 1, 2, 5, 1000, 1023, 1024, 0x00ff_ffff] {
        for background in (0..1024).step_by(31) {
            for peak in 0..1024 {
                let expected =
                    peak >= minimum && u64::from(peak) * 256 > true_level(256, background);
                let fires = fires::<Count10>(threshold(256, minimum), peak, background);
                assert_eq!(fires, expected, "{minimum}, {background}, {peak}");
            }
        }
    }
}

/// The level at 24 bits, and all peaks around it.
fn check_24_bits(alpha: u16, background: u32) {
    const TOP: u64 = u32::MAX as u64; // the largest U24F8
    let exact = true_level(alpha, background);
    let level = level::<Count24>(alpha, background);
    assert_eq!(u64::from(level.to_bits()), exact.min(TOP));
    for peak in [exact / 256, exact / 256 + 1, 0x00ff_fffe, 0x00ff_ffff] {
        let peak = u32::try_from(peak.min(0x00ff_ffff)).unwrap();
        let fires = fires::<Count24>(threshold(alpha, 0), peak, background);
        let expected = u64::from(peak) * 256 > exact;
        assert_eq!(fires, expected, "{alpha}, {background}");
    }
}

#[test]
fn at_the_top_of_24_bits_nothing_passes_that_should_not() {
    for alpha in ALPHAS {
        for below_top in (0..20_000).chain((20_000..1_100_000).step_by(997)) {
            check_24_bits(alpha, 0x00ff_ffff - below_top);
        }
    }
}

#[test]
fn random_24_bit_backgrounds() {
    let mut rng = Pcg32::seed_from_u64(1);
    for _ in 0..100_000 {
        let alpha = ALPHAS[rng.next_u32() as usize % ALPHAS.len()];
        // All magnitudes.
        check_24_bits(alpha, rng.next_u32() >> (8 + rng.next_u32() % 24));
    }
}

/// The lowest background whose level `peak` does not exceed, by definition.
fn assert_lowest<W: CounterWidth>(alpha: u16, peak: u32) {
    let lowest = threshold(alpha, 0).lowest_background::<W>(Count::new(peak).unwrap());
    assert!(lowest <= W::MAX + 1);
    if lowest <= W::MAX {
        assert!(!fires::<W>(threshold(alpha, 0), peak, lowest));
    }
    if lowest > 0 {
        assert!(fires::<W>(threshold(alpha, 0), peak, lowest - 1));
    }
}

#[test]
fn the_lowest_background_is_right_for_all_10_bit_peaks() {
    for alpha in (0..=65_535).step_by(97).chain(ALPHAS) {
        for peak in 0..1024 {
            assert_lowest::<Count10>(alpha, peak);
        }
    }
}

/// 2¹⁶ α, 2¹⁰ counts: the level of each, the peaks next to it, and the background that holds
/// each peak back.
#[test]
#[ignore = "takes a minute: `.ci/long proofs`"]
fn all_10_bit_counts_at_every_alpha() {
    let roots: Vec<u64> = (0..1024).map(root).collect();
    parallel::for_each(1 << 16, |alpha| {
        let alpha = alpha as u16;
        let exact = |background: u32| {
            u64::from(background) * 256 + u64::from(alpha) * roots[background as usize]
        };
        for background in 0..1024 {
            let exact = exact(background);
            let level = level::<Count10>(alpha, background);
            assert_eq!(u64::from(level.to_bits()), exact);
            for peak in [0, exact / 256, exact / 256 + 1, 1023] {
                let peak = peak.min(1023) as u32;
                let fires = fires::<Count10>(threshold(alpha, 0), peak, background);
                assert_eq!(fires, u64::from(peak) * 256 > exact);
            }
        }
        for peak in 0..1024 {
            let lowest = threshold(alpha, 0).lowest_background::<Count10>(Count::saturating(peak));
            let held_back = |background: &u32| u64::from(peak) * 256 <= exact(*background);
            // The level goes up with the background: one step on either side says all.
            assert!(lowest == 0 || !held_back(&(lowest - 1)));
            assert!(lowest == 1024 || held_back(&lowest));
        }
    });
}

#[test]
fn the_lowest_background_of_a_peak_past_the_width_may_not_exist() {
    let lowest = |peak| threshold(0, 0).lowest_background::<Count10>(Count::saturating(peak));
    assert_eq!(lowest(1023), 1023);
    assert_eq!(lowest(1024), 1024);
    assert_eq!(lowest(u32::MAX), 1024);
}

#[test]
fn the_lowest_background_is_right_for_wider_peaks() {
    let mut rng = Pcg32::seed_from_u64(9);
    for _ in 0..1_000_000 {
        let alpha = u16::try_from(rng.next_u32() >> 16).unwrap() >> (rng.next_u32() % 16);
        let peak = rng.next_u32() >> (8 + rng.next_u32() % 24);
        assert_lowest::<Count24>(alpha, peak);
        assert_lowest::<Count16>(alpha, peak & 0xffff);
    }
    for alpha in ALPHAS {
        assert_lowest::<Count24>(alpha, 0x00ff_ffff);
        assert_lowest::<Count16>(alpha, 0xffff);
    }
}

proptest! {
    #[test]
    fn any_alpha_background_and_peak(
        alpha: u16,
        background in 0u32..=0x00ff_ffff,
        peak in 0u32..=0x00ff_ffff,
        minimum in 0u32..=0x00ff_ffff,
    ) {
        let expected = u64::from(peak) * 256 > true_level(alpha, background) && peak >= minimum;
        let fires = fires::<Count24>(threshold(alpha, minimum), peak, background);
        prop_assert_eq!(fires, expected);
        check_24_bits(alpha, background);
    }
}
