use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{
    AnyRule, AverageRule, BlockLevel, Count, DetectionRule, EchoNumber, Neighbours, PaperRule,
    WindowRule,
};
use dtof_data::photons::source::{Photon, PixelPhotons};
use dtof_link::AdaptiveBinning;
use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;

use super::*;
use dtof_core::{DepthEvent, Statistics};
use dtof_data::photons::source::Slice;

const ARRAY: Array = Array::new(5, 4).unwrap();
const BINS: u16 = 16;

/// A photon: laser cycle, place of its pixel, bin.
type Row = (u64, usize, u16);

/// What an engine does with photons.
#[derive(Debug, PartialEq)]
struct Outcome {
    events: Vec<DepthEvent>,
    statistics: [Statistics; 2],
    decisions: Vec<DepthEvent>,
}

/// The engine of `settings` with `photons` in slices of these lengths, again and again. The recording of pixel number `n`
/// ends with laser cycle `ends[n]`.
fn run(settings: &Settings, photons: &[Row], ends: &[u64], lengths: &[u16]) -> Outcome {
    // One address is not in the recording.
    let addresses: Vec<PixelAddress> = (0..20)
        .filter(|&raw| raw != 6)
        .map(PixelAddress::new)
        .collect();
    let mut engine = host_engine(settings, ARRAY, &addresses).unwrap();
    engine.keep_decisions(&|pixel| pixel.raw() % 2 == 0);
    let all = ends.iter().copied().max().unwrap();
    let (mut events, mut left, mut first_cycle) = (Vec::new(), photons, 0);
    for &length in lengths.iter().cycle() {
        let of_slice = |&end: &u64| PixelPhotons {
            cycles: u16::try_from(end.saturating_sub(first_cycle))
                .unwrap_or(length)
                .min(length),
            photons: Vec::new(),
        };
        let mut pixels: Vec<PixelPhotons> = ends.iter().map(of_slice).collect();
        while let Some((&(cycle, pixel, code), rest)) = left.split_first()
            && cycle < first_cycle + u64::from(length)
        {
            left = rest;
            if cycle < ends[pixel] {
                let cycle = u16::try_from(cycle - first_cycle).unwrap();
                pixels[pixel].photons.push(Photon { cycle, code });
            }
        }
        events.extend(
            engine
                .run(&Slice {
                    first_cycle,
                    pixels,
                })
                .unwrap(),
        );
        first_cycle += u64::from(length);
        if first_cycle >= all {
            break;
        }
    }
    events.extend(engine.finish());
    let decisions = engine.decisions().into_iter();
    Outcome {
        events,
        statistics: engine.statistics(),
        decisions: decisions.map(|decision| decision.event).collect(),
    }
}

fn rule(number: u8, minimum: u32, level: f64) -> AnyRule {
    let (least, alpha) = (Count::saturating(minimum), U8F8::from_num(level));
    match number {
        0 => PaperRule::new(alpha, least).into(),
        1 => AverageRule::new(alpha, least).into(),
        _ => WindowRule::new(3, U4F12::from_num(level), least)
            .unwrap()
            .into(),
    }
}

/// All that a decision depends on.
fn all_settings() -> impl Strategy<Value = Settings> {
    let looks = (
        1u16..12,
        0u16..60,
        1u16..150,
        prop_oneof![Just(0.0), 1.0..4.0],
        0u32..6,
    );
    let pixels = (
        0u8..3,
        any::<bool>(),
        (1u8..=4, option::of(1u8..6)),
        prop_oneof![2 => Just(0u16), 1 => 1u16..=BINS],
        option::of(Just((3u16, 12u16))),
        prop_oneof![Just(8u8), Just(10u8)],
    );
    let mode = (0u8..6, 1u8..=3, 1u16..300, any::<bool>(), 1u16..200);
    (looks, pixels, mode).prop_map(|((x, l1, more, level, minimum), pixels, mode)| {
        let (number, tracks, (echoes, echo_wait), dead_time, gate, counter_bits) = pixels;
        let (mode, levels, patience, eight, frame) = mode;
        let l1 = l1.max(x);
        let (number, dead_time) = if mode == 2 {
            (2, 0)
        } else {
            (number, dead_time)
        };
        // Only the window rule, and no block, weighs bins by less than all of a histogram.
        let dead_time = match dead_time {
            BINS => BINS,
            _ if mode == 1 => 0,
            dead_time => dead_time,
        };
        let plain = Settings::static_scene(1)
            .with_bins(BINS.into())
            .configured(|array| {
                array.rule = rule(number, minimum, level);
                (array.x, array.l1, array.l2) = (x, l1, l1 + x + more);
                array.tracking = tracks && number == 2 && mode != 3;
                array.echoes = EchoNumber::new(echoes).unwrap();
                array.echo_wait = echo_wait.unwrap_or(u8::MAX);
                let is_weighed = array.rule.weighs_dead_time() || dead_time == BINS;
                array.dead_time = Some(if is_weighed { dead_time } else { 0 });
                array.gate = gate.unwrap_or(array.gate);
            });
        let plain = Settings {
            counter_bits,
            ..plain
        };
        match mode {
            1 => plain.configured(|array| {
                let levels = BlockLevel::saturating(levels);
                array.binning = Some(AdaptiveBinning { levels, patience });
            }),
            2 => plain
                .configured(|array| array.neighbours = Neighbours::new(if eight { 8 } else { 4 })),
            3 => Settings {
                frame: Some(frame),
                ..plain
            },
            4 => Settings {
                decide_once: true,
                ..plain
            },
            5 => plain.configured(|array| array.once_per_bin = true),
            _ => plain,
        }
    })
}

/// Dense and sparse photons, with empty stretches as long as many exposures.
fn photons() -> impl Strategy<Value = Vec<Row>> {
    let wait = prop_oneof![
        20 => Just(0u64),
        20 => 0u64..3,
        10 => 0u64..40,
        1 => 0u64..1200,
    ];
    let bin = prop_oneof![2 => Just(7u16), 1 => 0..BINS + 2];
    vec((wait, 0usize..19, bin), 0..400).prop_map(|steps| {
        let mut cycle = 0;
        let rows = steps.into_iter().map(|(wait, pixel, bin)| {
            cycle += wait;
            (cycle, pixel, bin)
        });
        rows.collect()
    })
}

proptest! {
    // Slices of one laser cycle take long.
    #![proptest_config(ProptestConfig::with_cases(100))]

    /// In slices of one laser cycle no look is skipped.
    #[test]
    fn laser_cycles_without_photons_may_be_skipped(
        settings in all_settings(),
        photons in photons(),
        lengths in vec(prop_oneof![1u16..40, 1u16..3000, Just(u16::MAX)], 1..5),
        after in 0u64..1500,
        early in option::weighted(0.5, (0usize..19, 0u64..3000)),
    ) {
        let end = photons.last().map_or(0, |last| last.0) + 1 + after;
        let mut ends = vec![end; 19];
        if let Some((pixel, early)) = early {
            ends[pixel] = early.min(end);
        }
        let expected = run(&settings, &photons, &ends, &[1]);
        prop_assert_eq!(run(&settings, &photons, &ends, &lengths), expected);
    }
}

/// It ends between two looks, and the exposure would expire at the second.
#[test]
fn a_pixel_whose_recording_ends_takes_no_part_in_later_looks() {
    let neighbours = Settings::static_scene(1)
        .with_bins(BINS.into())
        .configured(|array| {
            array.rule = rule(2, 3, 2.0);
            array.neighbours = Some(Neighbours::Four);
            array.x = 6;
            array.l1 = 25;
            array.l2 = 55;
        });
    let binning = neighbours.clone().configured(|array| {
        array.neighbours = None;
        array.binning = Some(AdaptiveBinning {
            levels: BlockLevel::saturating(2),
            patience: 20,
        });
    });
    for settings in [neighbours, binning] {
        for early in 0..130 {
            let mut ends = vec![300; 19];
            ends[8] = early;
            let photons = [(31, 8, 3), (33, 2, 3)];
            let expected = run(&settings, &photons, &ends, &[1]);
            assert_eq!(
                run(&settings, &photons, &ends, &[u16::MAX]),
                expected,
                "{early}"
            );
        }
    }
}

/// No rule finds a peak among no photons, whatever its level and minimum. Exposures that expire in the dark count.
#[test]
fn exposures_without_photons_expire() {
    let counts = [2.0, 0.0]
        .into_iter()
        .flat_map(|level| (0..3).map(move |number| (number, level)));
    for (number, level) in counts {
        let settings = Settings::static_scene(1)
            .with_bins(BINS.into())
            .configured(|array| {
                array.rule = rule(number, 0, level);
                array.x = 10;
                array.l1 = 40;
                array.l2 = 95;
            });
        let ends = vec![100_000; 19];
        let outcome = run(&settings, &[], &ends, &[u16::MAX]);
        let found = (outcome.events, outcome.statistics[0].expired);
        assert_eq!(found, (Vec::new(), 19 * 1000), "{settings:?}");
        assert_eq!(
            run(&settings, &[], &ends, &[1]).statistics[0].expired,
            19_000
        );
    }
}
