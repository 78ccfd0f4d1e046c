use dtof_core::{Count24, WindowRule};
use dtof_data::photons::histograms::Histograms;
use dtof_data::photons::pixel_counts::RecordedCounts;
use dtof_data::photons::source::{Photon, PixelPhotons};
use proptest::prelude::*;
use rand_distr::{Distribution, Poisson, Uniform};

use super::*;
use crate::host::host_engine;

fn settings(bins: usize) -> Settings {
    let rule = WindowRule::new(3, "4".parse().unwrap(), Count::saturating(5)).unwrap();
    Settings {
        decide_once: true,
        ..Settings::static_scene(0)
            .with_bins(bins)
            .for_pulse("1".parse().unwrap())
            .configured(|array| array.rule = rule.into())
    }
}

/// Each photon of `counts` in the laser cycle of its number, modulo `cycles`.
fn photons(counts: &[u32], cycles: u16) -> Vec<Photon> {
    let codes = (0..).zip(counts);
    let codes = codes.flat_map(|(code, &count)| (0..count).map(move |_| code));
    let mut photons: Vec<Photon> = (0..)
        .zip(codes)
        .map(|(number, code): (u32, u16)| Photon {
            cycle: u16::try_from(number % u32::from(cycles)).unwrap(),
            code,
        })
        .collect();
    photons.sort_by_key(|photon| photon.cycle);
    photons
}

/// One slice of as many laser cycles for all pixels.
fn slice(histograms: &[Vec<u32>], cycles: u16) -> Slice {
    let pixels = histograms.iter().map(|counts| PixelPhotons {
        cycles,
        photons: photons(counts, cycles),
    });
    Slice {
        first_cycle: 0,
        pixels: pixels.collect(),
    }
}

fn addresses(pixels: usize) -> Vec<PixelAddress> {
    (0..=u16::MAX).take(pixels).map(PixelAddress::new).collect()
}

/// The events of histograms of 100 laser cycles, and the engine.
fn decided(
    settings: &Settings,
    array: Array,
    histograms: &[Vec<u32>],
) -> (Vec<DepthEvent>, Box<dyn Engine>) {
    let addresses = addresses(histograms.len());
    let mut engine = host_engine(settings, array, &addresses).unwrap();
    engine.keep_decisions(&|_| true);
    engine.run(&slice(histograms, 100)).unwrap();
    (engine.finish(), engine)
}

/// The confidence of each of these pixels.
fn confidence(settings: &Settings, array: Array, histograms: &[Vec<u32>]) -> Vec<f64> {
    let mut counts = PixelCounts::new(histograms.len(), settings.bins);
    counts.add(&slice(histograms, 100));
    let addresses = addresses(histograms.len());
    let decided = decide_once(settings, array, &addresses, &counts, |_| false).unwrap();
    decided.iter().map(|decision| decision.confidence).collect()
}

/// Histograms of so many laser cycles each.
fn recorded(histograms: Vec<Vec<u64>>, cycles: u64) -> RecordedCounts {
    RecordedCounts {
        cycles: vec![cycles; histograms.len()],
        histograms: Histograms::of(histograms).unwrap(),
    }
}

fn line(pixels: usize) -> Array {
    Array::new(u32::try_from(pixels).unwrap(), 1).unwrap()
}

/// 20 photons a bin, and a pulse of 5, 30 and 10 photons.
fn wall(at: usize) -> Vec<u32> {
    let mut counts = vec![20; 128];
    counts[at - 1] += 5;
    counts[at] += 30;
    counts[at + 1] += 10;
    counts
}

fn counts() -> impl Strategy<Value = Vec<u32>> {
    let counts = prop::collection::vec(0..30_u32, 128);
    (counts, 4..124_usize, 0..90_u32).prop_map(|(mut counts, bin, more)| {
        counts[bin] += more;
        counts
    })
}

proptest! {
    /// An event is what the core finds in the whole histogram, if no slope reaches into the gate. Every photon is accounted
    /// for, however many slices they come in.
    #[test]
    fn a_pixel_decides_as_the_core_on_its_histogram(
        mut counts in counts(), first in 0..60_u16, past in 0..5_u32, cut in 1..100_u16, echoes in 1..=3_u8
    ) {
        if let Some(before) = first.checked_sub(1) {
            counts[usize::from(before)] = 0;
        }
        let settings = settings(128).configured(|array| { array.gate = (first, 127); array.echoes = EchoNumber::new(echoes).unwrap(); });
        let config = settings.config::<128>().unwrap();
        let mut histogram = Histogram::<128, Count24>::new();
        let all: [u32; 128] = counts.clone().try_into().unwrap();
        let gated_out = config.add_frame(&mut histogram, &all);
        let mut expected = Vec::new();
        config.detect_echoes(&mut histogram.clone(), 100, |echo, detection| {
            let event = detection.event(PixelAddress::new(0), LaserCycle::new(99), 100);
            expected.push(DepthEvent { echo, ..event });
        });

        let mut with_past = counts.clone();
        with_past.push(past);
        let [whole] = slice(&[with_past], 100).pixels.try_into().unwrap();
        let (before, after): (Vec<Photon>, Vec<Photon>) = whole.photons.iter().partition(|photon| photon.cycle < cut);
        let after = after.iter().map(|photon| Photon { cycle: photon.cycle - cut, ..*photon });
        let mut engine = host_engine(&settings, line(1), &addresses(1)).unwrap();
        for (first_cycle, cycles, photons) in [(0, cut, before), (cut.into(), 100 - cut, after.collect())] {
            let slice = Slice { first_cycle, pixels: vec![PixelPhotons { cycles, photons }] };
            prop_assert!(engine.run(&slice).unwrap().is_empty());
        }
        prop_assert_eq!(engine.finish(), expected.clone());

        let [statistics, _] = engine.statistics();
        prop_assert_eq!(statistics.photons(), u64::from(counts.iter().sum::<u32>() + past));
        prop_assert_eq!((statistics.rejected, statistics.gated_out), (past.into(), gated_out.into()));
        prop_assert_eq!((statistics.events, statistics.expired), (expected.len() as u64, expected.is_empty().into()));
    }

    /// The confidence is the highest z with an event, but for the rounding of the rule.
    #[test]
    fn the_confidence_agrees_with_the_decision(counts in counts(), shift in 0..8_u32, more in 0..100_u32) {
        let counts: Vec<u32> = counts.iter().map(|count| (count + more) >> shift).collect();
        let (events, _) = decided(&settings(128), line(1), std::slice::from_ref(&counts));
        let confidence = confidence(&settings(128), line(1), std::slice::from_ref(&counts))[0];
        if confidence < 3.9 {
            prop_assert!(events.is_empty(), "{}", confidence);
        }
        let photons = counts.windows(3).map(|window| window.iter().sum::<u32>()).max().unwrap();
        // The photons of the rule's minimum, and more.
        if confidence > 4.1 && photons > 9 {
            prop_assert!(!events.is_empty(), "{}", confidence);
        }
    }
}

#[test]
fn the_confidence_is_that_of_the_formula() {
    // 30 more than 10 a bin, and 7 more than none: in 3 of 128 bins.
    for (level, more, total) in [(10, 30, 1310.0), (0, 7, 7.0)] {
        let mut counts = vec![level; 128];
        counts[40] += more;
        counts[100] += u32::from(level == 0);
        let total = total + f64::from(level == 0);
        let inside = f64::from(3 * level + more);
        let z = confidence(&settings(128), line(1), &[counts])[0];
        let p = 3.0 / 128.0;
        let variance = p * (1.0 - p) * total;
        let level = total * p
            + z * variance / f64::sqrt(variance + z * z / 36.0)
            + z * z / 6.0 * (1.0 - 2.0 * p);
        assert!((inside - level).abs() < 1e-9, "{z}: {inside} {level}");
    }
}

#[test]
fn without_photons_the_confidence_is_0_and_of_pixels_left_out_unknown() {
    let settings = Settings {
        masked: vec![1],
        ..settings(128).configured(|array| array.gate = (20, 127))
    };
    let histograms = [vec![0; 128], vec![0; 128], wall(50)];
    let (events, engine) = decided(&settings, line(3), &histograms);
    assert_eq!(events.len(), 1);
    let confidence = confidence(&settings, line(3), &histograms);
    assert_eq!(confidence[0], 0.0);
    assert!(confidence[1].is_nan() && confidence[2] > 4.0);
    let [statistics, _] = engine.statistics();
    assert_eq!(statistics.expired, 1);
    // The histogram of the event, for the report.
    let [decision] = engine.decisions().try_into().unwrap();
    assert_eq!(decision.counts[20..], wall(50)[20..]);
    assert_eq!(decision.cycles, 100);
}

#[test]
fn counts_that_do_not_fit_a_counter_are_divided() {
    // 1024 bins have counters of 20 bits.
    let mut counts = vec![20; 1024];
    counts[40] = (1 << 20) - 2;
    let (events, _) = decided(&settings(1024), line(1), &[counts.clone()]);
    assert_eq!(events[0].peak_count.raw(), (1 << 20) - 2);
    counts[40] += 2;
    let (events, engine) = decided(&settings(1024), line(1), &[counts.clone()]);
    assert_eq!((events.len(), events[0].peak_bin.raw()), (1, 40));
    assert_eq!(events[0].peak_count.raw(), counts[40] / 2);
    let [statistics, _] = engine.statistics();
    assert_eq!((statistics.ended_full, statistics.saturated), (0, 0));
    assert_eq!(statistics.photons(), u64::from(counts.iter().sum::<u32>()));
}

/// Of 4,000 histograms without a target at most as many have an event as the rule's z allows for counts that fit.
#[test]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a number of photons"
)]
fn divided_counts_have_no_more_false_alarms() {
    let mut random = dtof_data::random::pixel_rng(5, PixelAddress::new(0));
    let array = line(4000);
    let mut share = |mean: f64| {
        let poisson = Poisson::new(mean).unwrap();
        let pixels = (0..4000).map(|_| {
            let mut pixel: Vec<u64> = (0..128)
                .map(|_| poisson.sample(&mut random) as u64)
                .collect();
            // A bin outside the gate does not fit.
            pixel[0] = if mean > 1000.0 { 1 << 32 } else { 0 };
            pixel
        });
        let counts = recorded(pixels.collect(), 1 << 20);
        let settings = settings(128).configured(|array| {
            array.gate = (1, 127);
            array.rule = WindowRule::new(3, "3".parse().unwrap(), Count::saturating(5))
                .unwrap()
                .into();
        });
        let decided = decide_once(&settings, array, &addresses(4000), &counts, |_| false).unwrap();
        decided
            .iter()
            .filter(|decision| !decision.echoes.is_empty())
            .count()
    };
    let fits = share(20.0);
    assert!(fits > 100, "{fits}");
    // 256 times as many, divided by 512.
    let divided = share(5120.0);
    assert!(divided <= fits, "{divided} {fits}");
}

/// The first photon of each laser cycle, of 0.01 background photons a bin and a pulse: the laser cycles that are left say how
/// bright a late bin is.
#[test]
fn counts_past_32_bits_and_their_laser_cycles_are_divided_alike() {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a number of photons"
    )]
    let decided = |times: u32| {
        let cycles = 1_u64 << 33;
        let mut left = cycles as f64;
        let photons = (0..128).map(|bin| {
            let count = (left * if bin == 90 { 0.05 } else { 0.01 }) as u64;
            left -= count as f64;
            count << times
        });
        let counts = recorded(vec![photons.collect()], cycles << times);
        let settings = settings(128).configured(|array| array.dead_time = Some(128));
        let decided = decide_once(&settings, line(1), &addresses(1), &counts, |_| false).unwrap();
        let [decided] = decided.try_into().ok().unwrap();
        (decided.echoes, decided.confidence.to_bits(), decided.best)
    };
    let fits = decided(0);
    assert_eq!(fits.0[0].1.peak.bin.raw(), 90);
    for times in 1..20 {
        assert_eq!(decided(times), fits, "{times}");
    }
}

proptest! {
    /// A decision on counts is the event of an engine, and the best window is that of the event.
    #[test]
    fn the_engine_decides_as_the_function_does(
        levels in prop::collection::vec(0_u32..60, 6), neighbours in prop::sample::select(vec![0, 4, 8]),
    ) {
        let settings = settings(128).configured(|array| array.neighbours = Neighbours::new(neighbours));
        let pixels: Vec<Vec<u32>> = levels.iter().map(|&level| {
            let mut counts: Vec<u32> = (0..128).map(|bin| 20 + bin * level % 5).collect();
            counts[70] += level;
            counts
        }).collect();
        let array = Array::new(3, 2).unwrap();
        let (events, _) = decided(&settings, array, &pixels);
        let mut counts = PixelCounts::new(6, 128);
        counts.add(&slice(&pixels, 100));
        let decisions = decide_once(&settings, array, &addresses(6), &counts, |_| true).unwrap();
        let positions = decisions.iter().zip(addresses(6)).filter_map(|(decision, pixel)| {
            let (_, first) = decision.echoes.first()?;
            assert_eq!(decision.best, Some(first.position()));
            Some((pixel, first.position()))
        });
        prop_assert!(positions.eq(events.iter().map(|event| (event.pixel, event.position()))));
    }

    /// The best window of a pixel with photons is within the gate, whatever the counts are.
    #[test]
    fn every_pixel_with_a_photon_has_a_best_window(
        mut counts in prop::collection::vec(0_u64..3, 128), many in 0_u32..40, dead_time in 0_u16..40,
    ) {
        counts[30] <<= many;
        let settings = settings(128).configured(|array| { array.gate = (10, 99); array.dead_time = Some(dead_time); });
        let has_photon = counts[10..=99].iter().any(|&count| count > 0);
        let counts = recorded(vec![counts], 1000);
        let decided = decide_once(&settings, line(1), &addresses(1), &counts, |_| false).unwrap();
        let best = decided[0].best.map(|best| f64::from(best.raw()) / 256.0);
        prop_assert_eq!(best.is_some(), has_photon);
        prop_assert!(best.is_none_or(|best| (8.0..=102.0).contains(&best)));
    }
}

#[test]
fn a_recording_that_ends_early_decides_at_its_end() {
    let mut engine = host_engine(&settings(128), line(2), &addresses(2)).unwrap();
    let mut slice = slice(&[wall(50), wall(60)], 100);
    slice.pixels[0].cycles = 150;
    engine.run(&slice).unwrap();
    let events = engine.finish();
    let of: Vec<_> = events
        .iter()
        .map(|event| (event.pixel.raw(), event.cycle.raw(), event.exposure))
        .collect();
    assert_eq!(of, [(1, 99, 100), (0, 149, 150)]);
}

/// Pixels of a wall that are too dim by themselves, around `middle`.
fn around(middle: Vec<u32>) -> Vec<Vec<u32>> {
    let mut dim = vec![20; 128];
    (dim[49], dim[50], dim[51]) = (24, 38, 26);
    let mut all = vec![dim; 9];
    all[4] = middle;
    all
}

#[test]
fn the_confidence_is_of_the_sum_only_where_the_sum_was_used() {
    let with = settings(128).configured(|array| array.neighbours = Neighbours::new(8));
    let array = Array::new(3, 3).unwrap();
    let of_middle = |settings: &Settings, middle: &[u32]| {
        confidence(settings, array, &around(middle.to_vec()))[4]
    };
    // Another surface, and nothing.
    for middle in [wall(90), vec![20; 128]] {
        assert_eq!(
            of_middle(&with, &middle),
            of_middle(&settings(128), &middle)
        );
    }
    // The same surface.
    let dim = around(Vec::new()).remove(0);
    assert!(of_middle(&with, &dim) > of_middle(&settings(128), &dim));
}

#[test]
fn neighbours_confirm_a_surface_that_the_pixel_sees() {
    let with = settings(128).configured(|array| array.neighbours = Neighbours::new(8));
    let array = Array::new(3, 3).unwrap();
    let of_middle = |settings: &Settings, middle: Vec<u32>| {
        let (events, _) = decided(settings, array, &around(middle));
        events
            .into_iter()
            .find(|event| event.pixel == PixelAddress::new(4))
    };
    // As dim as the others.
    let dim = around(Vec::new()).remove(0);
    assert_eq!(of_middle(&settings(128), dim.clone()), None);
    let event = of_middle(&with, dim).unwrap();
    assert!(event.flags.contains(Flags::CONFIRMED));
    assert_eq!(event.peak_bin.raw(), 50);
    // Its own photons.
    assert_eq!((event.peak_count.raw(), event.background.raw()), (38, 20));
    // It sees nothing.
    assert_eq!(of_middle(&with, vec![20; 128]), None);
    // It sees something else, by itself.
    let event = of_middle(&with, wall(90)).unwrap();
    assert!(!event.flags.contains(Flags::CONFIRMED));
    let (alone, _) = decided(&settings(128), line(1), &[wall(90)]);
    assert_eq!(
        (event.peak_bin, event.offset, event.peak_count),
        (alone[0].peak_bin, alone[0].offset, alone[0].peak_count)
    );
    // It sees the same, half a bin off by chance: the depth is that of all.
    let mut off = wall(50);
    off.swap(49, 51);
    let event = of_middle(&with, off.clone()).unwrap();
    let (alone, _) = decided(&settings(128), line(1), &[off]);
    assert!(event.offset > alone[0].offset && !event.flags.contains(Flags::CONFIRMED));
    // A pixel that is left out has no say.
    let without: Vec<u16> = (0..9).filter(|&pixel| pixel != 4).collect();
    let masked = Settings {
        masked: without,
        ..with
    };
    assert_eq!(of_middle(&masked, around(Vec::new()).remove(0)), None);
}

/// The sum of nine bright pixels is more than a counter of 16 bits holds.
#[test]
fn bright_neighbours_confirm_with_any_number_of_bins() {
    for bins in [128, 512, 1024] {
        let mut dim = vec![0; bins];
        dim[..32].fill(8000);
        for (bin, more) in [(14, 100), (15, 200), (16, 100)] {
            dim[bin] += more;
        }
        let alone = settings(bins).configured(|array| array.gate = (0, 31));
        let with = alone
            .clone()
            .configured(|array| array.neighbours = Neighbours::new(8));
        let array = Array::new(3, 3).unwrap();
        let pixels = vec![dim; 9];
        assert!(decided(&alone, array, &pixels).0.is_empty());
        let (events, _) = decided(&with, array, &pixels);
        let bins_of: Vec<u16> = events.iter().map(|event| event.peak_bin.raw()).collect();
        assert_eq!(bins_of[4], 15, "{bins} bins: {bins_of:?}");
    }
}

#[test]
fn what_needs_looks_is_refused() {
    let with = |change: fn(&mut Settings)| {
        let mut settings = settings(128);
        change(&mut settings);
        let refused = host_engine(&settings, line(1), &addresses(1));
        refused.err().unwrap().to_string()
    };
    let blocks = with(|settings| {
        settings.configuration.binning = Some(crate::settings::AdaptiveBinning {
            levels: dtof_core::BlockLevel::new(1).unwrap(),
            patience: 64,
        });
    });
    assert_eq!(blocks, "decide_once cannot be used with binning");
    let dead = with(|settings| {
        let window = WindowRule::new(3, U4F12::lit("4"), Count::saturating(5));
        settings.configuration.rule = window.unwrap().into();
        settings.configuration.neighbours = Neighbours::new(8);
        settings.configuration.dead_time = Some(20);
    });
    assert!(
        dead.starts_with("neighbours cannot be used with a dead time"),
        "{dead}"
    );
}

/// The tail of a bright pulse before the gate, or behind it: from a tenth of the noise of the background at the edge to a
/// hundred times as much. A dimmer target behind it is seen as well as without it.
#[test]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a number of photons"
)]
fn the_slope_of_what_lies_outside_of_the_gate_is_no_surface() {
    const DRAWS: u32 = 4000;
    let mut random = dtof_data::random::pixel_rng(6, PixelAddress::new(0));
    for has_target in [false, true] {
        let (mut seen, mut right) = (0, 0);
        for draw in 0..DRAWS {
            let mut between =
                |from: f64, to: f64| Uniform::new(from, to).unwrap().sample(&mut random);
            let background = 10_f64.powf(between(0.5, 4.5));
            let slope = between(1.0, 6.0);
            let edge = background.sqrt() * 10_f64.powf(between(-1.0, 2.0));
            let target = between(70.0, 120.0).floor();
            let mean = |bin: u32| {
                let bin = f64::from(bin);
                let tail = if bin < 3.0 {
                    0.0
                } else {
                    edge * ((8.0 - bin) / slope).exp()
                };
                let is_target = has_target && (bin - target).abs() < 2.0;
                background
                    + tail
                    + if is_target {
                        6.0 * background.sqrt()
                    } else {
                        0.0
                    }
            };
            let mut histogram: Vec<u64> = (0..128)
                .map(|bin| Poisson::new(mean(bin)).unwrap().sample(&mut random) as u64)
                .collect();
            let is_mirrored = draw % 2 == 1;
            if is_mirrored {
                histogram.reverse();
            }
            let counts = recorded(vec![histogram], 1 << 20);
            let settings = settings(128)
                .configured(|array| array.gate = if is_mirrored { (0, 119) } else { (8, 127) });
            let decided =
                decide_once(&settings, line(1), &addresses(1), &counts, |_| false).unwrap();
            if let Some((_, echo)) = decided[0].echoes.first() {
                let bin = f64::from(echo.peak.bin.raw());
                let bin = if is_mirrored { 127.0 - bin } else { bin };
                seen += 1;
                right += u32::from((bin - target).abs() < 2.0);
            }
        }
        if has_target {
            assert!(right > DRAWS * 99 / 100, "{right}");
        } else {
            // Without a look beyond the gate 988 have one.
            assert!(seen < DRAWS / 50, "{seen}");
        }
    }
}
