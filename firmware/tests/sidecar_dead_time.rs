//! The dead time of a TDC: whose it is, and what a sidecar makes of it.

use crate::common::host::{
    CONFIGURATION, Call, Host, configured_with, device_with_blocks, scripted,
};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{
    AnyRule, AsyncPixel, AverageRule, BlockLevel, Count, DepthEvent, EchoNumber, Flags, LaserCycle,
    PixelAddress, PixelConfig, RangeGate, Statistics, WholeHistogram, WindowRule,
};
use dtof_link::{AdaptiveBinning, Configuration, Refusal, Source, message};
use dtof_sensors::SensorInfo;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// A gate with bins before it, and two echoes.
fn with_window() -> Configuration {
    let rule = WindowRule::new(3, U4F12::lit("4.5"), Count::saturating(5)).unwrap();
    Configuration {
        rule: rule.into(),
        l2: 400,
        gate: (10, 119),
        pixels: 1,
        columns: 1,
        echoes: EchoNumber::new(2).unwrap(),
        echo_guard_bins: 4,
        ..CONFIGURATION
    }
}

fn with_average() -> Configuration {
    let rule = AverageRule::new(U8F8::lit("4"), Count::saturating(5));
    Configuration {
        rule: rule.into(),
        ..with_window()
    }
}

fn with_blocks() -> Configuration {
    Configuration {
        binning: Some(AdaptiveBinning {
            levels: BlockLevel::saturating(1),
            patience: 50,
        }),
        ..with_window()
    }
}

fn sensor(dead_time: u16) -> SensorInfo {
    SensorInfo {
        dead_time,
        ..SensorInfo::new(1)
    }
}

/// The configuration of a pixel.
fn config(requested: &Configuration, dead_time: u16) -> PixelConfig<128, AnyRule> {
    let (first, last) = requested.gate;
    let config = PixelConfig::with_rule(requested.rule)
        .x(requested.x)
        .l1(requested.l1)
        .l2(requested.l2)
        .gate(RangeGate::new(first, last).unwrap())
        .estimator(requested.estimator)
        .echoes(requested.echoes, requested.echo_guard_bins)
        .echo_wait(requested.echo_wait);
    config.dead_time(dead_time).build().unwrap()
}

/// The photons of a TDC that takes the first photon of a laser cycle. One in 40 laser cycles has a
/// photon of the background in each bin, one in 6 a photon of a target in bins 70 and 71.
fn first_photons(cycles: usize, seed: u64) -> Vec<Option<u16>> {
    let mut random = Pcg32::seed_from_u64(seed);
    let mut arrives = |bin| {
        let one_in = if (70..72).contains(&bin) { 6 } else { 40 };
        random.next_u32().is_multiple_of(one_in)
    };
    (0..cycles)
        .map(|_| (0..128).find(|&bin| arrives(bin)))
        .collect()
}

fn calls(photons: &[Option<u16>]) -> impl Iterator<Item = Option<Vec<Call>>> {
    photons.iter().map(|photon| {
        let photon = photon.iter().map(|&code| Call::Photon(0, code));
        Some(photon.chain([Call::End(1)]).collect())
    })
}

/// What a pixel of the core reports.
fn of_core(
    config: &PixelConfig<128, AnyRule>,
    photons: &[Option<u16>],
) -> (Vec<DepthEvent>, Statistics) {
    let mut pixel = AsyncPixel::<128>::new(PixelAddress::new(0));
    let (mut events, mut statistics) = (Vec::new(), Statistics::new());
    for (cycle, photon) in (0..).zip(photons) {
        if let Some(code) = *photon {
            pixel.count(config, code);
        }
        pixel.end_laser_cycle(config, &mut statistics, LaserCycle::new(cycle));
        events.extend(pixel.take_event());
    }
    pixel.add_photons_to(&mut statistics);
    (events, statistics)
}

/// What a sidecar reports, whose host takes every event at once.
fn of_sidecar(
    requested: &Configuration,
    of_sensor: u16,
    photons: &[Option<u16>],
) -> (Vec<DepthEvent>, Statistics) {
    let (mut device, mut host) = configured_with::<1>(sensor(of_sensor), requested);
    let end_ms = u32::try_from(photons.len()).unwrap();
    let mut sensor = scripted(calls(photons));
    host.run(&mut device, &mut sensor, 0..end_ms, usize::MAX);
    host.run(&mut device, &mut sensor, end_ms..end_ms + 10, usize::MAX);
    let report = host.report(&mut device, end_ms + 10);
    (host.events, report.statistics)
}

#[test]
fn a_sidecar_reports_what_a_pixel_of_the_core_reports() {
    let photons = first_photons(8_000, 1);
    let mut all = Vec::new();
    for dead_time in [0, 20, 128] {
        let expected = of_core(&config(&with_window(), dead_time), &photons);
        assert!(expected.0.len() > 10, "{}", expected.0.len());
        let requested = Configuration {
            dead_time: Some(dead_time),
            ..with_window()
        };
        // The host's, whatever the sensor says; else the sensor's.
        assert_eq!(of_sidecar(&requested, 7, &photons), expected);
        assert_eq!(of_sidecar(&with_window(), dead_time, &photons), expected);
        all.push(expected.0);
    }
    // The dead time decides: the true one finds nothing but the target.
    let [none, short, first] = &all[..] else {
        unreachable!()
    };
    assert!(none != short && short != first && none != first);
    let is_target = |event: &DepthEvent| (69..=72).contains(&event.peak_bin.raw());
    assert!(first.iter().all(is_target) && !none.iter().all(is_target));
}

#[test]
fn a_dead_time_that_has_no_effect_is_refused_and_not_taken_from_the_sensor() {
    let answer = |requested: &Configuration, of_sensor| {
        let mut device = device_with_blocks::<1, 1>(Some(sensor(of_sensor)));
        let body = requested.to_le_bytes();
        Host::new(1, 0).answer(&mut device, 0, message::CONFIGURE, &body)
    };
    for base in [with_average(), with_blocks(), with_window()] {
        let is_weighed = base == with_window();
        for source in [Source::Link, Source::Sensor] {
            for dead_time in [0, 1, 127, 128, u16::MAX] {
                let requested = Configuration {
                    dead_time: Some(dead_time),
                    source,
                    ..base
                };
                let is_refused = !is_weighed && (1..128).contains(&dead_time);
                let refusal = [Refusal::DeadTime as u8];
                let expected = &refusal[..usize::from(is_refused)];
                assert_eq!(answer(&requested, 20), expected, "{dead_time}");
                // One of a sensor is no reason to refuse.
                assert!(answer(&base, dead_time).is_empty());
            }
        }
    }
    // Then it is as if there was none.
    let photons = first_photons(2_000, 2);
    let expected = of_core(&config(&with_average(), 0), &photons);
    assert!(expected.0.len() > 10);
    assert_eq!(of_sidecar(&with_average(), 127, &photons), expected);
}

/// A photon in 20 of 24 laser cycles, then in 11 of 24.
#[test]
fn events_of_other_rules_say_that_a_tdc_of_the_first_photon_has_piled_up() {
    let photons: Vec<_> = (0..48)
        .map(|cycle| {
            let is_dark = if cycle < 24 { cycle < 4 } else { cycle < 37 };
            (!is_dark).then_some(40)
        })
        .collect();
    let requested = |dead_time| Configuration {
        dead_time,
        pixels: 1,
        ..CONFIGURATION
    };
    for (given, of_sensor, piles_up) in [
        (None, 0, false),
        (None, u16::MAX, true),
        (Some(128), 0, true),
        (Some(0), u16::MAX, false),
    ] {
        let (events, _) = of_sidecar(&requested(given), of_sensor, &photons);
        let flags: Vec<Flags> = events.iter().map(|event| event.flags).collect();
        let first = [Flags::NONE, Flags::PILE_UP][usize::from(piles_up)];
        assert_eq!(flags, [first, Flags::NONE]);
    }
}

#[test]
fn full_counters_and_bins_that_are_never_live_are_reported() {
    // No bin behind bin 3 is ever live, and its counter is full after 1023 laser cycles.
    let photons = vec![Some(3); 2_100];
    let requested = Configuration {
        l2: 5_000,
        gate: (0, 127),
        dead_time: Some(u16::MAX),
        ..with_window()
    };
    let expected = of_core(&config(&requested, u16::MAX), &photons);
    let found = of_sidecar(&requested, 0, &photons);
    assert_eq!(found, expected);
    let (events, statistics) = found;
    // A detection in bin 3 is one, but says that it did not see everything.
    let is_piled_up = |event: &DepthEvent| event.flags.contains(Flags::PILE_UP);
    assert!(events.iter().all(is_piled_up));
    assert!(statistics.blind_looks > 0);

    // Photons before the gate are no detection.
    let requested = Configuration {
        gate: (10, 127),
        ..requested
    };
    let (events, statistics) = of_sidecar(&requested, 0, &photons);
    // The first look after 1023 laser cycles is after 1024.
    assert_eq!((events.len(), statistics.ended_full), (0, 2));
    assert_eq!(statistics.expired, 2);
    assert!(statistics.blind_looks > 400, "{}", statistics.blind_looks);
}

#[test]
fn whole_histograms_are_weighed_by_their_laser_cycles() {
    let (mut counts, cycles) = ([0u32; 128], 100_000);
    for bin in first_photons(100_000, 3).into_iter().flatten() {
        counts[usize::from(bin)] += 1;
    }
    // More photons than laser cycles: no TDC of the first photon has these.
    let contradicting = counts.map(|count| 2 * count);
    let requested = Configuration {
        rule: WindowRule::new(3, U4F12::lit("6"), Count::saturating(5))
            .unwrap()
            .into(),
        ..with_window()
    };
    // More than a counter of 24 bits holds.
    let many = counts.map(|count| count << 13);
    for (dead_time, counts, cycles, blind_looks) in [
        (0, counts, cycles, 0),
        (u16::MAX, counts, cycles, 0),
        (u16::MAX, many, cycles << 13, 0),
        (u16::MAX, contradicting, cycles, 1),
    ] {
        let config = config(&requested, dead_time);
        let (mut expected, mut statistics) = (Vec::new(), Statistics::new());
        let mut whole = WholeHistogram::<128>::new();
        whole.decide(
            &config,
            &counts,
            cycles.into(),
            &mut statistics,
            |echo, detection| {
                let last = LaserCycle::new(u64::from(cycles) - 1);
                let event = detection.event(PixelAddress::new(0), last, u16::MAX);
                expected.push(DepthEvent { echo, ..event });
            },
        );

        let info = SensorInfo {
            gives_histograms: true,
            ..sensor(dead_time)
        };
        let (mut device, mut host) = configured_with::<1>(info, &requested);
        let calls = vec![Call::Frame(cycles), Call::Histogram(0, Box::new(counts))];
        let mut sensor = scripted([Some(calls)].into_iter());
        host.run(&mut device, &mut sensor, 0..2, usize::MAX);
        let report = host.report(&mut device, 2);
        assert_eq!((&host.events, report.statistics), (&expected, statistics));
        assert_eq!(statistics.blind_looks, blind_looks);
        if dead_time > 0 {
            let bins: Vec<u16> = expected.iter().map(|event| event.peak_bin.raw()).collect();
            assert_eq!(bins.is_empty(), blind_looks > 0, "{bins:?}");
            // Noise exceeds the background, too, where it is counted 8,192 times.
            let sure = if cycles > 100_000 { 1 } else { bins.len() };
            assert!(bins.iter().take(sure).all(|bin| (70..=71).contains(bin)));
        }
    }
}
