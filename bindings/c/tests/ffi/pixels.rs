//! Pixels and histograms give the same results as those of `dtof-core`.

use dtof_c::*;
use dtof_core::fixed::types::{I24F8, U4F12, U8F8, U16F16};
use dtof_core::{
    AnyRule, AsyncPixel, AverageRule, BinPosition, CentredWindow, Count, DepthEstimator,
    DepthEvent, EchoNumber, LaserCycle, PaperRule, PixelAddress, PixelConfig, RangeGate,
    RangeScale, Statistics, WholeHistogram, WindowRule, z_for,
};
use proptest::prelude::*;

use crate::{OK, checked, paper, pixel, statistics, zeroed};

/// Random settings, most of them valid.
pub fn settings() -> impl Strategy<Value = dtof_config_t> {
    let rule = (0u8..3, 1u8..8, 256u16..2048, 4096u16..30000, 3u32..12);
    let depth = (0u8..2, 256u16..1025, 256u16..1025);
    let cycles = (1u16..8, 8u16..30, 40u16..200, 0u16..60, 60u16..128);
    let dead_time = prop_oneof![Just(0u16), 1u16..128, Just(128), Just(u16::MAX)];
    let more = (dead_time, 0u8..2, 1u8..5, 0u8..6, 0u8..8);
    (rule, depth, cycles, more).prop_map(|(rule, depth, cycles, more)| dtof_config_t {
        rule: rule.0,
        window: rule.1,
        alpha_q8: rule.2,
        z_q12: rule.3,
        minimum_count: rule.4,
        estimator: depth.0,
        before_q8: depth.1,
        after_q8: depth.2,
        x: cycles.0,
        l1: cycles.1,
        l2: cycles.2,
        gate_first: cycles.3,
        gate_last: cycles.4,
        // Others refuse a shorter one.
        dead_time: match more.0 {
            1..128 if rule.0 != DTOF_RULE_WINDOW => 0,
            dead_time => dead_time,
        },
        tracking: more.1 & u8::from(rule.0 == DTOF_RULE_WINDOW),
        echoes: more.2,
        peel_reach: more.3,
        echo_wait: more.4,
    })
}

pub fn rule_of(settings: &dtof_config_t) -> Option<AnyRule> {
    let count = Count::new(settings.minimum_count)?;
    let alpha = U8F8::from_bits(settings.alpha_q8);
    let z = U4F12::from_bits(settings.z_q12);
    Some(match settings.rule {
        0 => PaperRule::new(alpha, count).into(),
        1 => WindowRule::new(settings.window, z, count).ok()?.into(),
        _ => AverageRule::new(alpha, count).into(),
    })
}

fn config_of(settings: &dtof_config_t) -> Option<PixelConfig<128, AnyRule>> {
    config_with(settings, rule_of(settings)?)
}

pub fn config_with(settings: &dtof_config_t, rule: AnyRule) -> Option<PixelConfig<128, AnyRule>> {
    let estimator = if settings.estimator == 0 {
        DepthEstimator::Centroid3
    } else {
        let before = U8F8::from_bits(settings.before_q8);
        let after = U8F8::from_bits(settings.after_q8);
        DepthEstimator::CentredWindow(CentredWindow::with_sides(before, after)?)
    };
    let gate = RangeGate::new(settings.gate_first, settings.gate_last).ok()?;
    let tracking = rule.tracking(&gate).filter(|_| settings.tracking == 1);
    let config = PixelConfig::with_rule(rule).estimator(estimator);
    let config = config.x(settings.x).l1(settings.l1).l2(settings.l2);
    let config = config.gate(gate).tracking(tracking);
    let config = config.dead_time(settings.dead_time);
    let config = config.echoes(EchoNumber::new(settings.echoes)?, settings.peel_reach);
    config.echo_wait(settings.echo_wait).build().ok()
}

pub fn plain(event: &DepthEvent) -> dtof_event_t {
    event.into()
}

pub fn read(statistics: &dtof_statistics_t) -> [u64; 12] {
    let mut counts = dtof_counts_t::default();
    // SAFETY: both pointers lead to objects of their types.
    assert_eq!(unsafe { dtof_statistics_read(statistics, &mut counts) }, OK);
    [
        counts.counted,
        counts.excluded,
        counts.saturated,
        counts.rejected,
        counts.gated_out,
        counts.repeated,
        counts.events,
        counts.deferred,
        counts.expired,
        counts.expired_deferred,
        counts.ended_full,
        counts.blind_looks,
    ]
}

pub fn numbers(of: &Statistics) -> [u64; 12] {
    let photons = [
        of.counted,
        of.excluded,
        of.saturated,
        of.rejected,
        of.gated_out,
        of.repeated,
    ];
    let events = [of.events, of.deferred, of.expired, of.expired_deferred];
    let losses = [of.ended_full, of.blind_looks];
    [&photons[..], &events, &losses]
        .concat()
        .try_into()
        .unwrap()
}

/// Laser cycles of a pixel; under Miri each costs 0.1 s.
pub const CYCLES: usize = if cfg!(miri) { 60 } else { 300 };

/// The TDC codes of laser cycles: a pulse, background, and codes past the last bin.
pub fn photons() -> impl Strategy<Value = Vec<Vec<u16>>> {
    let code = prop_oneof![4 => 70u16..73, 1 => 100u16..102, 3 => 0u16..140];
    prop::collection::vec(prop::collection::vec(code, 0..3), CYCLES)
}

proptest! {
    #[test]
    fn a_pixel_reports_what_the_core_reports(
        settings in settings(),
        photons in photons(),
        taken in prop::collection::vec(any::<bool>(), CYCLES),
        in_batches in any::<bool>(),
    ) {
        let Some(config) = config_of(&settings) else {
            prop_assert!(checked(&settings).is_err());
            return Ok(());
        };
        let checked = checked(&settings).unwrap();
        let (mut mine, mut done) = ([pixel(5), pixel(6)], statistics());
        let mut others = [5, 6].map(|address| AsyncPixel::<128>::new(PixelAddress::new(address)));
        let mut statistics = Statistics::new();
        // SAFETY: each pointer leads to an object of its type.
        unsafe {
            for ((cycle, codes), taken) in (0..).zip(&photons).zip(taken) {
                for (mine, other) in mine.iter_mut().zip(&mut others) {
                    if in_batches {
                        let (first, number) = (codes.as_ptr(), codes.len());
                        let status = dtof_pixel_count_batch(mine, &checked, first, number);
                        prop_assert_eq!(status, OK);
                    } else {
                        for &code in codes {
                            prop_assert_eq!(dtof_pixel_count(mine, &checked, code), OK);
                        }
                    }
                    other.count_batch(&config, codes);
                }
                for (mine, other) in mine.iter_mut().zip(&mut others) {
                    let look = other.end_laser_cycle(&config, &mut statistics, LaserCycle::new(cycle));
                    let mut outcome = dtof_look_t::DTOF_LOOK_NOT_DUE;
                    let status = dtof_pixel_end_laser_cycles(
                        mine, &checked, cycle, &mut done, 1, &mut outcome,
                    );
                    prop_assert_eq!((status, outcome), (OK, look.into()));
                }
                for (mine, other) in mine.iter_mut().zip(&mut others).filter(|_| taken) {
                    let mut event = dtof_event_t::default();
                    let status = dtof_pixel_take_event(mine, &mut event);
                    let expected = other.take_event();
                    prop_assert_eq!(status == OK, expected.is_some());
                    prop_assert_eq!(event, expected.as_ref().map(plain).unwrap_or_default());
                }
            }
            for (mine, other) in mine.iter().zip(&others) {
                prop_assert_eq!(dtof_pixel_add_photons(mine, &mut done), OK);
                other.add_photons_to(&mut statistics);
            }
        }
        prop_assert_eq!(read(&done), numbers(&statistics));
    }

    #[test]
    fn a_whole_histogram_has_the_echoes_that_the_core_finds(
        settings in settings(),
        background in prop::collection::vec(0u32..40, 128),
        pulses in prop::collection::vec((0usize..128, 0u32..40_000_000), 0..4),
        exposure in prop_oneof![1u32..100_000, 1u32..=u32::MAX],
    ) {
        let Some(config) = config_of(&settings) else {
            return Ok(());
        };
        let checked = checked(&settings).unwrap();
        let mut counts: [u32; 128] = background.try_into().unwrap();
        for (bin, photons) in pulses {
            counts[bin] += photons;
        }
        let mut statistics = Statistics::new();
        let mut expected = Vec::new();
        let held = u16::try_from(exposure).unwrap_or(u16::MAX);
        let mut whole = WholeHistogram::<128>::new();
        whole.decide(&config, &counts, exposure.into(), &mut statistics, |echo, detection| {
            let event = detection.event(PixelAddress::new(9), LaserCycle::new(1 << 40), held);
            expected.push(plain(&DepthEvent { echo, ..event }));
        });

        let mut done = crate::statistics();
        let (mut events, mut found) = ([dtof_event_t::default(); DTOF_ECHOES], 9);
        let (first, counts) = (events.as_mut_ptr(), counts.as_ptr());
        // SAFETY: each pointer leads to an object of its type.
        let status = unsafe {
            dtof_histogram_decide(
                &checked, counts, 9, 1 << 40, exposure, &mut done, first, &mut found,
            )
        };
        prop_assert_eq!(status, OK);
        prop_assert_eq!(&events[..found], &expected[..]);
        prop_assert_eq!(read(&done), numbers(&statistics));
    }

    #[test]
    fn ranges_are_those_of_the_core(
        width in 1u32..2_000_000_000,
        offset in -2_000_000i32..2_000_000,
        position in -512i32..=262_399,
    ) {
        let scale = RangeScale::new(U16F16::from_bits(width), I24F8::from_bits(offset));
        let mut mine = zeroed();
        // SAFETY: the pointer leads to a scale.
        let status = unsafe { dtof_scale_init(&mut mine, width, offset) };
        prop_assert_eq!(status == OK, scale.is_ok());
        if let Ok(scale) = scale {
            let (mut range, place) = (0, BinPosition::new(position).unwrap());
            // SAFETY: both pointers lead to objects of their types.
            prop_assert_eq!(unsafe { dtof_range(&mine, position, &mut range) }, OK);
            prop_assert_eq!(range, scale.range(place).to_bits());
        }
    }
}

#[test]
fn the_papers_settings_are_those_of_the_core() {
    let config = config_of(&paper()).unwrap();
    let expected = PixelConfig::<128>::paper().build().unwrap();
    assert_eq!(config.rule(), &AnyRule::Paper(*expected.rule()));
    let of = |x, l1, l2| (x, l1, l2);
    assert_eq!(
        of(config.x(), config.l1(), config.l2()),
        of(expected.x(), expected.l1(), expected.l2())
    );
    assert_eq!(config.gate(), expected.gate());
    assert_eq!(config.estimator(), expected.estimator());
    assert_eq!(config.echo_wait(), expected.echo_wait());
}

#[test]
fn z_and_windows_are_those_of_the_core() {
    let mut config = paper();
    // SAFETY: the pointer leads to a configuration.
    unsafe {
        assert_eq!(dtof_config_false_alarms(&mut config, 100), OK);
        assert_eq!(dtof_config_for_pulse(&mut config, 384), OK);
    }
    let z = z_for(100, &RangeGate::<128>::full(), 4, 40, 2000);
    let window = CentredWindow::for_pulse(U8F8::from_bits(384));
    assert_eq!(config.z_q12, z.to_bits());
    assert_eq!(
        config.window,
        WindowRule::width_for_pulse(U8F8::from_bits(384))
    );
    assert_eq!(config.before_q8, window.before().to_bits());
    assert_eq!(config.after_q8, window.after().to_bits());
}
