//! The paper's rule decides as it is written.

use dtof_core::fixed::types::U8F8;
use dtof_core::paper::quadrant_background;
use dtof_core::rule::{ExcludedBins, background_from_count, detect};
use dtof_core::{
    Count, Count10, Count16, Count24, CounterWidth, DepthEstimator, DetectionRule, Histogram,
    PaperRule, Peak, RangeGate,
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
    let background = quadrant_background(histogram.counts(), gate, peak.bin);
    let exceeded = rule.threshold().is_exceeded::<W>(peak.count, background);
    exceeded.then_some((peak, background))
}

/// Random histograms with a peak that stands more or less clear: both answers, often.
fn check<const BINS: usize, W: CounterWidth>(rounds: u32, seed: u64) {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut fired = 0;
    for round in 0..rounds {
        let (gate, histogram, most) = super::rules::histogram::<BINS, W>(&mut rng, round);
        let alpha = rng.next_u32() as u16 >> (rng.next_u32() % 16);
        let minimum = rng.next_u32() % (2 * most) * (round % 2);
        let rule = PaperRule::new(U8F8::from_bits(alpha), Count::saturating(minimum));

        let expected = as_written(&rule, &histogram, &gate);
        let background = rule.detect(&histogram, &gate, histogram.peak(), &ExcludedBins::NONE);
        let whole = expected.map(|(_, background)| background_from_count(background));
        assert_eq!(background, whole);
        let detection = detect(&histogram, &gate, &rule, &DepthEstimator::default());
        let detected = detection.map(|detection| (detection.peak, detection.background));
        assert_eq!(detected, expected);
        fired += u32::from(expected.is_some());
    }
    super::rules::both_often(fired, rounds);
}

#[test]
fn it_decides_as_the_rule_is_written() {
    check::<8, Count10>(20_000, 1);
    check::<32, Count10>(20_000, 6);
    check::<32, Count16>(20_000, 7);
    check::<128, Count10>(5000, 2);
    check::<128, Count16>(5000, 3);
    check::<128, Count24>(5000, 4);
    check::<1024, Count10>(500, 5);
}

#[test]
fn an_empty_histogram_is_no_detection() {
    let rule = PaperRule::new(U8F8::ZERO, Count::default());
    let (empty, estimator) = (Histogram::<8>::new(), DepthEstimator::default());
    assert!(detect(&empty, &RangeGate::full(), &rule, &estimator).is_none());
}
