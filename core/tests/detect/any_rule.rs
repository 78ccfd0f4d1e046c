//! A rule chosen when the program runs decides as the one it holds.

use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::rule::{ExcludedBins, detect};
use dtof_core::{
    AnyRule, AverageRule, BlockLevel, CentredWindow, Count, Count8, Count10, Count24, CounterWidth,
    DepthEstimator, Detection, DetectionRule, Histogram, PaperRule, RangeGate, WindowRule,
};
use proptest::prelude::*;
use rand_core::SeedableRng;
use rand_pcg::Pcg32;

/// What `rule` itself and as one of all decide; both the same.
fn decides<const BINS: usize, W: CounterWidth>(
    rule: impl DetectionRule + Into<AnyRule>,
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    estimator: &DepthEstimator,
) -> Result<Option<Detection>, TestCaseError> {
    let any: AnyRule = rule.into();
    let alone = detect(histogram, gate, &rule, estimator);
    prop_assert_eq!(detect(histogram, gate, &any, estimator), alone);
    let peak = histogram.peak();
    let expected = rule.detect(histogram, gate, peak, &ExcludedBins::NONE);
    prop_assert_eq!(
        any.detect(histogram, gate, peak, &ExcludedBins::NONE),
        expected
    );
    Ok(alone)
}

fn check<const BINS: usize, W: CounterWidth>(
    (seed, round): (u64, u32),
    (alpha, z, width): (u16, u16, u8),
    minimum: u32,
    half_width: u16,
) -> Result<[bool; 3], TestCaseError> {
    let mut rng = Pcg32::seed_from_u64(seed);
    let (gate, histogram, _) = super::rules::histogram::<BINS, W>(&mut rng, round);
    let minimum = Count::saturating(minimum);
    let alpha = U8F8::from_bits(alpha);
    let paper = PaperRule::new(alpha, minimum);
    let average = AverageRule::new(alpha, minimum);
    let window = WindowRule::new(width, U4F12::from_bits(z), minimum).unwrap();
    let centred = CentredWindow::new(U8F8::from_bits(half_width)).unwrap();
    let estimator = DepthEstimator::CentredWindow(centred);
    Ok([
        decides(paper, &histogram, &gate, &estimator)?.is_some(),
        decides(average, &histogram, &gate, &estimator)?.is_some(),
        decides(window, &histogram, &gate, &estimator)?.is_some(),
    ])
}

proptest! {
    #[test]
    fn any_rule_decides_as_the_rule_inside(
        histogram: (u64, u32),
        alpha in 0u16..2048, z: u16, width in 1u8..=7,
        minimum in 0u32..2000,
        half_width in 256u16..=1024,
    ) {
        check::<8, Count10>(histogram, (alpha, z, width), minimum, half_width)?;
        check::<128, Count10>(histogram, (alpha, z, width), minimum, half_width)?;
        check::<128, Count24>(histogram, (alpha, z, width), minimum, half_width)?;
    }
}

/// Only a window rule tracks, and asks more of blocks.
#[test]
fn tracking_and_blocks_are_those_of_the_rule_inside() {
    let levels = (0..4).map(|level| BlockLevel::new(level).unwrap());
    let mut others_of_blocks = 0;
    for (width, z, minimum) in [(1, 4 << 12, 2), (3, 18_000, 0), (7, 30_000, 9)] {
        let minimum = Count::saturating(minimum);
        let window = WindowRule::new(width, U4F12::from_bits(z), minimum).unwrap();
        let alpha = U8F8::lit("4");
        let others = [
            AnyRule::from(PaperRule::new(alpha, minimum)),
            AnyRule::from(AverageRule::new(alpha, minimum)),
        ];
        for gate in [RangeGate::<128>::full(), RangeGate::new(20, 60).unwrap()] {
            let expected = window.tracking(&gate);
            let found = AnyRule::from(window).tracking(&gate).unwrap();
            assert_eq!(*found.near(), AnyRule::Window(*expected.near()));
            assert_eq!(*found.far(), AnyRule::Window(*expected.far()));
            assert_eq!(found.reach(), expected.reach());
            assert!(others.iter().all(|rule| rule.tracking(&gate).is_none()));
        }
        for level in levels.clone() {
            let expected = window.of_blocks(level);
            others_of_blocks += u32::from(expected != window);
            assert_eq!(AnyRule::from(window).of_blocks(level), expected.into());
            assert!(others.iter().all(|rule| rule.of_blocks(level) == *rule));
        }
    }
    assert!(others_of_blocks > 0);
}

/// The histograms above are some on either side of each rule.
#[test]
fn all_rules_fire_and_do_not() {
    let mut fired = [0; 3];
    for seed in 0..200 {
        let found = check::<128, Count10>((seed, 1), (1024, 4 << 12, 3), 5, 512).unwrap();
        for (fired, found) in fired.iter_mut().zip(found) {
            *fired += u32::from(found);
        }
    }
    let often = |fired| (20..180).contains(fired);
    assert!(fired.iter().all(often), "{fired:?}");
}

/// All minimum counts: a bin holds 255 or 1023 photons, a window as many times that as it has bins.
#[test]
fn a_minimum_count_fits_if_counters_hold_it() {
    fn fits(rule: impl Into<AnyRule>) -> [bool; 2] {
        let rule = rule.into();
        [rule.fits::<Count8>(), rule.fits::<Count10>()]
    }
    let alpha = U8F8::lit("4");
    for minimum in 1..=2000 {
        let least = Count::saturating(minimum);
        let of_a_bin = [minimum <= 255, minimum <= 1023];
        assert_eq!(fits(PaperRule::new(alpha, least)), of_a_bin);
        assert_eq!(fits(AverageRule::new(alpha, least)), of_a_bin);
        for width in 1..=7 {
            let rule = WindowRule::new(width, U4F12::lit("4"), least).unwrap();
            let bins = u32::from(width);
            assert_eq!(fits(rule), [minimum <= 255 * bins, minimum <= 1023 * bins]);
        }
    }
}
