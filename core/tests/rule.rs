//! The paper's rule decides as it is written, by all the ways there are.

#![allow(clippy::cast_possible_truncation, reason = "small numbers")]

mod common;

use dtof_core::fixed::types::U8F8;
use dtof_core::{
    Count, Count10, Count16, Count24, CounterWidth, DepthEstimator, DetectionRule, Histogram,
    PaperRule, Peak, RangeGate, background, detect, whole_background,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// Peak and background, each as the rule is written.
fn as_written<const BINS: usize, W: CounterWidth>(
    rule: &PaperRule,
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
) -> Option<(Peak, Count)> {
    let peak = histogram.peak();
    let background = background::quadrant(histogram.counts(), gate, peak.bin);
    let exceeded = rule.threshold().is_exceeded::<W>(peak.count, background);
    exceeded.then_some((peak, background))
}

/// Random histograms with a peak that stands more or less clear; how many fired.
fn check<const BINS: usize, W: CounterWidth>(rounds: u32, seed: u64) -> u32 {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut fired = 0;
    for round in 0..rounds {
        let (gate, histogram, most) = common::histogram::<BINS, W>(&mut rng, round);
        let alpha = rng.next_u32() as u16 >> (rng.next_u32() % 16);
        let minimum = Count::saturating(rng.next_u32() % (2 * most));
        let minimum = if round % 2 == 0 {
            Count::default()
        } else {
            minimum
        };
        let rule = PaperRule::new(U8F8::from_bits(alpha), minimum);

        let expected = as_written(&rule, &histogram, &gate);
        let background = rule.detect(&histogram, &gate, histogram.peak());
        assert_eq!(
            background,
            expected.map(|(_, background)| whole_background(background))
        );
        let detection = detect(&histogram, &gate, &rule, &DepthEstimator::default());
        let detected = detection.map(|detection| (detection.peak, detection.background));
        assert_eq!(detected, expected);
        let whole = rule.detect_whole::<W, BINS>(histogram.counts(), &gate);
        assert_eq!(whole, expected);
        fired += u32::from(expected.is_some());
    }
    fired
}

#[test]
fn every_way_decides_as_the_rule_is_written() {
    for (fired, rounds) in [
        (check::<8, Count10>(20_000, 1), 20_000),
        (check::<32, Count10>(20_000, 6), 20_000),
        (check::<32, Count16>(20_000, 7), 20_000),
        (check::<128, Count10>(5000, 2), 5000),
        (check::<128, Count16>(5000, 3), 5000),
        (check::<128, Count24>(5000, 4), 5000),
        (check::<1024, Count10>(500, 5), 500),
    ] {
        // Both answers, often.
        assert!(
            fired > rounds / 20 && fired < rounds - rounds / 20,
            "{fired}"
        );
    }
}

/// Few photons a bin, all the same but for some, so that the highest bit of a count
/// decides now and then, and now and then does not.
#[test]
fn whole_histograms_near_the_threshold_decide_as_the_rule_is_written() {
    let mut rng = Pcg32::seed_from_u64(8);
    let gate = RangeGate::full();
    let (mut fired, mut below) = (0, 0);
    for round in 0..200_000u32 {
        let most = 1 << (rng.next_u32() % 7);
        let mut counts = [0u16; 32];
        counts.fill_with(|| (rng.next_u32() % most) as u16);
        for _ in 0..rng.next_u32() % 4 {
            let bin = rng.next_u32() as usize % 32;
            counts[bin] += (rng.next_u32() % (3 * most)) as u16;
        }
        let alpha = U8F8::from_bits((rng.next_u32() % 2048) as u16);
        let rule = PaperRule::new(alpha, Count::saturating(round % 7));
        let mut histogram = Histogram::<32>::new();
        histogram.add_frame(&counts, &gate);
        let expected = as_written(&rule, &histogram, &gate);
        assert_eq!(
            rule.detect_whole::<Count10, 32>(&counts, &gate),
            expected,
            "{counts:?}"
        );
        match expected {
            Some(_) => fired += 1,
            None => below += 1,
        }
    }
    assert!(fired > 20_000 && below > 20_000, "{fired}, {below}");
}

#[test]
fn an_empty_histogram_is_no_detection() {
    let rule = PaperRule::new(U8F8::ZERO, Count::default());
    let counts = [0; 8];
    assert_eq!(
        rule.detect_whole::<Count10, 8>(&counts, &RangeGate::full()),
        None
    );
}

/// Counts that the width does not allow, but the integer does.
#[test]
fn counts_past_the_width_are_compared_as_they_are() {
    let rule = PaperRule::new(U8F8::ZERO, Count::default());
    let counts = [0, 0, 0, 0, u16::MAX, u16::MAX - 1, u16::MAX, 0];
    let (peak, background) = rule
        .detect_whole::<Count10, 8>(&counts, &RangeGate::full())
        .unwrap();
    assert_eq!(
        (peak.bin.raw(), peak.count.raw(), background.raw()),
        (4, 65_535, 0)
    );
    let mut counts = [40_000; 32];
    (counts[3], counts[17], counts[30]) = (50_000, u16::MAX, u16::MAX);
    let rule = PaperRule::new(U8F8::ONE, Count::default());
    let (peak, background) = rule
        .detect_whole::<Count10, 32>(&counts, &RangeGate::full())
        .unwrap();
    assert_eq!(
        (peak.bin.raw(), peak.count.raw(), background.raw()),
        (17, 65_535, 40_000)
    );
}
