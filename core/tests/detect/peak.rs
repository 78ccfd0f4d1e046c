//! Comparator tree, running peak and a plain search find the same peak.

use dtof_core::paper::ComparatorTree;
use dtof_core::{Count10, Count16, Count24, CounterWidth, Histogram, Peak, RangeGate};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// The lowest of the highest bins, and its count.
fn naive_peak(counts: &[u32]) -> (u16, u32) {
    let mut best = (0, 0);
    for (bin, &count) in counts.iter().enumerate() {
        if count > best.1 {
            best = (bin as u16, count);
        }
    }
    best
}

fn plain(peak: Peak) -> (u16, u32) {
    (peak.bin.raw(), peak.count.raw())
}

/// One code a photon, in random order.
fn shuffled(photons: &[u32], rng: &mut Pcg32) -> Vec<u16> {
    let mut codes = Vec::new();
    for (code, &count) in (0..).zip(photons) {
        codes.extend((0..count).map(|_| code));
    }
    for i in (1..codes.len()).rev() {
        codes.swap(i, rng.next_u32() as usize % (i + 1));
    }
    codes
}

/// The peak of a histogram of these photons, by all ways to arrive at it.
fn check<const BINS: usize, W: CounterWidth>(photons: &[u32; BINS], rng: &mut Pcg32) {
    let gate = RangeGate::full();
    let counts = photons.map(|count| count.min(W::MAX));
    let expected = naive_peak(&counts);

    let tree = ComparatorTree::of(&counts);
    assert_eq!(plain(tree.peak()), expected, "tree {photons:?}");

    // A whole frame.
    let mut framed = Histogram::<BINS, W>::new();
    framed.add_frame(photons, &gate);
    assert_eq!(plain(framed.peak()), expected, "frame {photons:?}");

    // A frame that lacks some photons, which then arrive one at a time.
    let late = photons.map(|count| count.min(rng.next_u32() % 3));
    let mut early = *photons;
    for (early, late) in early.iter_mut().zip(late) {
        *early -= late;
    }
    let mut mixed = Histogram::<BINS, W>::new();
    mixed.add_frame(&early, &gate);
    mixed.add_batch(&shuffled(&late, rng));
    assert_eq!(plain(mixed.peak()), expected, "mixed {photons:?}");

    // One photon at a time.
    if photons.iter().map(|&count| u64::from(count)).sum::<u64>() < 3000 {
        let mut single = Histogram::<BINS, W>::new();
        single.add_batch(&shuffled(photons, rng));
        assert_eq!(plain(single.peak()), expected, "single {photons:?}");
    }
}

const PATTERNS: u32 = 12;

/// Photons to make a search stumble.
fn pattern<const BINS: usize>(number: u32, full: u32, rng: &mut Pcg32) -> [u32; BINS] {
    let group = BINS / 8;
    let mut below = |limit: u32| rng.next_u32() % limit;
    let mut photons = [0u32; BINS];
    match number % PATTERNS {
        // Empty.
        0 => {}
        // All equal.
        1 => photons = [1 + below(4); BINS],
        // All full, or past it.
        2 => photons.fill_with(|| full + below(3)),
        // One single photon.
        3 => photons[below(BINS as u32) as usize] = 1,
        // A tie across groups, over lower bins.
        4 => {
            photons.fill_with(|| below(5));
            let a = below(8) as usize;
            let b = (a + 1 + below(7) as usize) % 8;
            photons[a * group + below(group as u32) as usize] = 5;
            photons[b * group + below(group as u32) as usize] = 5;
        }
        // A tie inside a group: all its bins.
        5 => {
            photons.fill_with(|| below(5));
            let a = below(8) as usize;
            photons[a * group..(a + 1) * group].fill(5);
        }
        // Some bins one below full, full, one past it.
        6 => photons.fill_with(|| match below(4) {
            0 => full - 1 + below(3),
            _ => below(9),
        }),
        // One bin far past full, so that a later one may tie with it.
        7 => {
            photons[below(BINS as u32) as usize] = full + 100;
            photons[below(BINS as u32) as usize] = full;
        }
        // Rising, and falling.
        8 => photons = core::array::from_fn(|bin| bin as u32),
        9 => photons = core::array::from_fn(|bin| (BINS - bin) as u32),
        // Low counts: many ties.
        10 => photons.fill_with(|| below(3)),
        // Anything.
        _ => photons.fill_with(|| below(full + 2)),
    }
    photons
}

fn check_patterns<const BINS: usize, W: CounterWidth>(histograms: u32, seed: u64) {
    let mut rng = Pcg32::seed_from_u64(seed);
    for number in 0..histograms {
        check::<BINS, W>(&pattern(number, W::MAX, &mut rng), &mut rng);
    }
}

#[test]
fn all_8_bin_histograms_of_up_to_3_photons_a_bin() {
    let mut rng = Pcg32::seed_from_u64(1);
    for number in 0..4u32.pow(8) {
        let photons: [u32; 8] = core::array::from_fn(|bin| number >> (2 * bin) & 3);
        check::<8, Count10>(&photons, &mut rng);
    }
}

#[test]
fn six_hundred_thousand_histograms_of_8_bins() {
    check_patterns::<8, Count10>(600_000, 2);
}

#[test]
fn two_hundred_thousand_histograms_of_128_bins() {
    check_patterns::<128, Count10>(200_000, 3);
}

#[test]
fn two_hundred_thousand_more_histograms_of_128_bins() {
    check_patterns::<128, Count10>(200_000, 4);
}

#[test]
fn other_counter_widths_and_sizes() {
    check_patterns::<1024, Count10>(3000, 5);
    check_patterns::<8, Count16>(30_000, 6);
    check_patterns::<1024, Count16>(3000, 7);
    check_patterns::<8, Count24>(30_000, 8);
    check_patterns::<128, Count24>(10_000, 9);
    check_patterns::<256, Count24>(10_000, 10); // the most whose keys fit 32 bits
}

#[test]
fn all_bins_full_photon_by_photon() {
    let mut rng = Pcg32::seed_from_u64(11);
    let mut histogram = Histogram::<128>::new();
    histogram.add_batch(&shuffled(&[1025; 128], &mut rng));
    assert_eq!(plain(histogram.peak()), (0, 1023));
}

#[test]
fn the_tree_takes_counts_past_24_bits_as_24_bits() {
    let tree = ComparatorTree::of(&[0, 0x00ff_fffe, 0x00ff_ffff, u32::MAX, 0, 0, 0, 0]);
    assert_eq!(plain(tree.peak()), (2, 0x00ff_ffff));
}

proptest! {
    #[test]
    fn the_running_peak_is_right_after_every_photon(
        codes in prop::collection::vec(0u16..20, 0..200),
    ) {
        let mut histogram = Histogram::<16>::new();
        let mut counts = [0u32; 16];
        prop_assert_eq!(plain(histogram.peak()), (0, 0));
        for code in codes {
            histogram.add(code);
            if let Some(count) = counts.get_mut(usize::from(code)) {
                *count += 1;
            }
            prop_assert_eq!(plain(histogram.peak()), naive_peak(&counts));
        }
    }

    #[test]
    fn any_counts(photons in prop::array::uniform32(0u32..1100), seed: u64) {
        check::<32, Count10>(&photons, &mut Pcg32::seed_from_u64(seed));
    }
}
