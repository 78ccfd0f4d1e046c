//! Configurations that are valid, and those that are not.

use dtof_core::fixed::types::{U8F8, U24F8};
use dtof_core::rule::ExcludedBins;
use dtof_core::{
    Count, CounterWidth, DepthEstimator, DetectionRule, EchoNumber, Histogram, Look, PaperRule,
    Peak, PixelConfig, PixelConfigError, RangeGate, checked,
};

use super::model::Lone;

#[test]
fn small_configurations_are_valid_if_and_only_if_there_is_a_look() {
    let rule = PaperRule::new(U8F8::lit("8"), Count::saturating(5));
    for x in 0..=12u16 {
        for l1 in 0..=12 {
            for l2 in 0..=12 {
                let config = PixelConfig::<8>::with_rule(rule).x(x).l1(l1).l2(l2).build();
                let valid =
                    0 < x && x <= l1 && l1 < l2 && (0..20).any(|k| l1 < k * x && k * x < l2);
                assert_eq!(config.is_ok(), valid, "{x} {l1} {l2}");
                let reason = if x == 0 {
                    PixelConfigError::ZeroX
                } else if x > l1 {
                    PixelConfigError::XAboveL1
                } else if l1 >= l2 {
                    PixelConfigError::L2NotAboveL1
                } else {
                    PixelConfigError::NoLook
                };
                match config {
                    Ok(config) => {
                        assert_eq!((config.x(), config.l1(), config.l2()), (x, l1, l2));
                        assert_eq!(config.gate(), &RangeGate::full());
                        assert_eq!(config.rule(), &rule);
                    }
                    Err(error) => assert_eq!(error, reason, "{x} {l1} {l2}"),
                }
            }
        }
    }
}

#[test]
fn what_is_not_set_is_the_papers() {
    const CONFIG: PixelConfig<128> = checked!(PixelConfig::paper().build());
    assert_eq!((CONFIG.x(), CONFIG.l1(), CONFIG.l2()), (4, 40, 2000));
    let rule = PaperRule::new(U8F8::lit("4"), Count::saturating(5));
    assert_eq!((CONFIG.rule(), CONFIG.gate()), (&rule, &RangeGate::full()));
    assert_eq!(CONFIG.estimator(), &DepthEstimator::Centroid3);
    assert!(!CONFIG.is_first_photon_only());
}

#[test]
fn every_setting_arrives() {
    let gate = RangeGate::new(3, 60).unwrap();
    let estimator = DepthEstimator::for_pulse(U8F8::ONE);
    let config = PixelConfig::<64>::paper().x(7).l1(9).l2(99).gate(gate);
    let last = EchoNumber::new(3).unwrap();
    let config = config.estimator(estimator).dead_time(u16::MAX);
    let config = config.echoes(last, 5).echo_wait(6).build().unwrap();
    assert_eq!((config.echoes(), config.echo_guard_bins()), (last, 5));
    assert_eq!(config.echo_wait(), 6);
    assert_eq!((config.x(), config.l1(), config.l2()), (7, 9, 99));
    assert_eq!((config.gate(), config.estimator()), (&gate, &estimator));
    assert!(config.is_first_photon_only());
}

#[test]
fn a_dead_time_of_all_bins_leaves_the_first_photon_only() {
    for dead_time in [0, 1, 20, 63, 64, 65, u16::MAX] {
        let config = PixelConfig::<64>::paper().dead_time(dead_time).build();
        let config = config.unwrap();
        assert_eq!(config.dead_time(), dead_time);
        assert_eq!(config.is_first_photon_only(), dead_time >= 64);
    }
}

#[test]
fn large_configurations_are_checked_without_overflow() {
    let rule = PaperRule::new(U8F8::lit("8"), Count::saturating(5));
    for (x, l1, l2, expected) in [
        (1, 65_533, 65_535, None),
        (1, 65_534, 65_535, Some(PixelConfigError::NoLook)),
        (32_767, 32_767, 65_535, None), // looks at 65,534
        (32_767, 32_767, 65_534, Some(PixelConfigError::NoLook)),
        (65_535, 65_535, 65_535, Some(PixelConfigError::L2NotAboveL1)),
        (65_535, 65_534, 65_535, Some(PixelConfigError::XAboveL1)),
        (65_534, 65_534, 65_535, Some(PixelConfigError::NoLook)),
    ] {
        let config = PixelConfig::<8>::with_rule(rule).x(x).l1(l1).l2(l2).build();
        assert_eq!(config.err(), expected, "{x} {l1} {l2}");
    }
}

/// Fires on every second photon, whatever the bins say.
#[derive(Clone, Copy)]
struct EverySecond;

impl DetectionRule for EverySecond {
    fn detect<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        _: &RangeGate<BINS>,
        _: Peak,
        _: &ExcludedBins,
    ) -> Option<U24F8> {
        (histogram.total() == 2).then_some(U24F8::lit("1.25"))
    }
}

#[test]
fn another_rule_takes_the_place_of_the_paper_s() {
    let config = PixelConfig::with_rule(EverySecond).x(1).l1(1).l2(9);
    let config = config.build().unwrap();
    let mut pixel = Lone::<8>::new(0);
    for cycle in 0..100 {
        pixel.pixel.count(&config, 5);
        let expected = [Look::TooEarly, Look::Event][cycle as usize % 2];
        assert_eq!(pixel.end(&config, cycle, 1), expected);
        if let Some(event) = pixel.pixel.take_event() {
            assert_eq!((event.peak_count.raw(), event.background.raw()), (2, 1));
        }
    }
    assert_eq!(pixel.statistics().events, 50);
}
