//! The background is the smaller of the two quadrant maxima of the half
//! without the peak, and sees nothing outside the gate.

use dtof_core::paper::{ComparatorTree, quadrant_background};
use dtof_core::rule::PhotonCount;
use dtof_core::{BinIndex, Count, RangeGate};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use crate::common::parallel;

/// The paper's rule over all the bins given, with its example in mind: "if the
/// peak was located in bins 64-127, the non-peak half was defined as bins 0-63".
fn naive(bins: &[u32], peak: usize) -> u32 {
    let n = bins.len();
    let (lower, upper) = bins.split_at(n / 2);
    let (one, other) = if peak < n / 2 {
        upper.split_at(n * 3 / 4 - n / 2)
    } else {
        lower.split_at(n / 4)
    };
    let highest = |quadrant: &[u32]| quadrant.iter().copied().max().unwrap();
    highest(one).min(highest(other))
}

fn quadrant<const BINS: usize>(counts: &[u32; BINS], gate: &RangeGate<BINS>, peak: usize) -> u32 {
    quadrant_background(counts, gate, BinIndex::new(peak as u16).unwrap()).raw()
}

fn random<const BINS: usize>(rng: &mut Pcg32) -> [u32; BINS] {
    core::array::from_fn(|_| rng.next_u32() % 1024)
}

#[test]
fn all_8_bin_histograms_of_up_to_2_photons_a_bin_and_every_peak() {
    let gate = RangeGate::full();
    for number in 0..3u32.pow(8) {
        let counts: [u32; 8] = core::array::from_fn(|bin| number / 3u32.pow(bin as u32) % 3);
        for peak in 0..8 {
            assert_eq!(quadrant(&counts, &gate, peak), naive(&counts, peak));
        }
    }
}

#[test]
fn random_128_bin_histograms_and_every_peak() {
    let mut rng = Pcg32::seed_from_u64(1);
    for _ in 0..2000 {
        let counts: [u32; 128] = random(&mut rng);
        for peak in 0..128 {
            let expected = naive(&counts, peak);
            assert_eq!(quadrant(&counts, &RangeGate::full(), peak), expected);
        }
    }
}

#[test]
fn the_paper_s_example_of_128_bins() {
    let mut counts = [0u32; 128];
    counts[0] = 7; // bins 0 to 31
    counts[63] = 5; // bins 32 to 63
    counts[64] = 11; // bins 64 to 95
    counts[127] = 9; // bins 96 to 127
    for peak in 0..128 {
        let expected = if peak < 64 { 9 } else { 5 };
        assert_eq!(quadrant(&counts, &RangeGate::full(), peak), expected);
    }
}

#[test]
fn every_gate_of_24_bins_and_every_peak_inside() {
    let mut rng = Pcg32::seed_from_u64(2);
    for first in 0..24u16 {
        for last in first + 7..32 {
            let gate = RangeGate::<32>::new(first, last).unwrap();
            for _ in 0..20 {
                let counts: [u32; 32] = random(&mut rng);
                let inside = &counts[first.into()..=last.into()];
                for peak in first..=last {
                    let expected = naive(inside, (peak - first).into());
                    assert_eq!(quadrant(&counts, &gate, peak.into()), expected);
                }
            }
        }
    }
}

/// Every gate of 8 to 128 bins, and every peak in it.
#[test]
#[ignore = "takes a minute: `.ci/long proofs`"]
fn every_gate_of_128_bins_and_every_peak_inside() {
    fn check<const BINS: usize>() {
        let bins = BINS as u64;
        parallel::for_each(bins - 7, |first| {
            let mut rng = Pcg32::seed_from_u64(bins + first);
            for last in first + 7..bins {
                let gate = RangeGate::<BINS>::new(first as u16, last as u16).unwrap();
                for most in [2, 4, 64, 1024] {
                    let counts: [u32; BINS] = core::array::from_fn(|_| rng.next_u32() % most);
                    let (first, last) = (first as usize, last as usize);
                    for peak in first..=last {
                        let expected = naive(&counts[first..=last], peak - first);
                        assert_eq!(quadrant(&counts, &gate, peak), expected);
                    }
                }
            }
        });
    }
    check::<8>();
    check::<16>();
    check::<32>();
    check::<64>();
    check::<128>();
}

#[test]
fn without_a_gate_it_is_a_by_product_of_the_comparator_tree() {
    fn check<const BINS: usize>(rng: &mut Pcg32) {
        let counts: [u32; BINS] = random(rng);
        let tree = ComparatorTree::of(&counts);
        let [a, b, c, d] = tree.quadrant_maxima().map(Count::raw);
        let peak = usize::from(tree.peak().bin.raw());
        let expected = if peak < BINS / 2 { c.min(d) } else { a.min(b) };
        assert_eq!(quadrant(&counts, &RangeGate::full(), peak), expected);
        // And the by-product itself.
        for (maximum, quarter) in [a, b, c, d].iter().zip(counts.chunks(BINS / 4)) {
            assert_eq!(maximum, quarter.iter().max().unwrap());
        }
    }
    let mut rng = Pcg32::seed_from_u64(3);
    for _ in 0..10_000 {
        check::<8>(&mut rng);
        check::<128>(&mut rng);
        check::<1024>(&mut rng);
    }
}

#[test]
fn counts_past_24_bits_are_taken_as_24_bits() {
    let counts = [0, 0, 0, 0, 0x0100_0000, 0, u32::MAX, 0];
    assert_eq!(quadrant(&counts, &RangeGate::full(), 0), 0x00ff_ffff);
}

/// The same of any integer.
#[test]
fn counts_of_every_width_give_the_same() {
    fn check<const BINS: usize>(rng: &mut Pcg32) {
        let width = 8 + rng.next_u32() % (BINS as u32 - 7);
        let first = (rng.next_u32() % (BINS as u32 - width + 1)) as u16;
        let gate = RangeGate::<BINS>::new(first, first + width as u16 - 1).unwrap();
        let bits = 1 + rng.next_u32() % 16;
        let counts: [u32; BINS] = core::array::from_fn(|_| rng.next_u32() >> (32 - bits));
        let peak = BinIndex::saturating((rng.next_u32() % BINS as u32) as u16);
        let expected = quadrant_background(&counts, &gate, peak);
        let halves = counts.map(|count| count as u16);
        assert_eq!(quadrant_background(&halves, &gate, peak), expected);
        if bits <= 8 {
            let bytes = counts.map(|count| count as u8);
            assert_eq!(quadrant_background(&bytes, &gate, peak), expected);
        }
    }
    let mut rng = Pcg32::seed_from_u64(4);
    for _ in 0..10_000 {
        check::<8>(&mut rng);
        check::<16>(&mut rng);
        check::<128>(&mut rng);
    }
}

proptest! {
    #[test]
    fn the_highest_of_some_counts_and_whether_one_reaches_a_level(
        counts in prop::collection::vec(0u16.., 0..40),
        level: u16,
    ) {
        let wide: Vec<u32> = counts.iter().map(|&count| count.into()).collect();
        let highest = wide.iter().copied().max().unwrap_or(0);
        prop_assert_eq!(u16::highest(&counts), highest);
        prop_assert_eq!(u32::highest(&wide), highest);
        let sum = wide.iter().sum();
        prop_assert_eq!(u16::highest_and_sum(&counts), (highest, sum));
        prop_assert_eq!(u32::highest_and_sum(&wide), (highest, sum));
        for level in [level.into(), highest] {
            let expected = wide.iter().any(|&count| count >= level);
            prop_assert_eq!(u16::any_reaches(&counts, level), expected);
            prop_assert_eq!(u32::any_reaches(&wide, level), expected);
            let first = wide.iter().position(|&count| count >= level);
            prop_assert_eq!(u16::first_reaching(&counts, level), first);
            prop_assert_eq!(u32::first_reaching(&wide, level), first);
        }
    }
}
