//! The sidecar with adaptive binning, tracking and several echoes: the same events and counts
//! as pixels and blocks run by hand, whatever the host does.

use std::collections::{BTreeMap, VecDeque};

use crate::common::host::{CONFIGURATION, Call, Host, Scripted, device_with_blocks, scripted};
use crate::common::script::{messages, photons};
use crate::common::sharing::{Expected, configs, expected, script};
use dtof_core::events::{DynamicDepthConfig, DynamicDepthEvent, DynamicDepthPixel, Reference};
use dtof_core::fixed::types::{I24F8, U4F12, U8F8, U16F16, U24F8};
use dtof_core::rule::{ExcludedBins, detect};
use dtof_core::{
    BlockLevel, CentredWindow, Count, Count24, DepthEstimator, DepthEvent, EchoNumber, Flags,
    Histogram, LaserCycle, PixelAddress, RangeGate, RangeScale, WindowRule,
};
use dtof_firmware::sidecar::Sidecar;
use dtof_link::message;
use dtof_link::{AdaptiveBinning, Configuration, DynamicDepth, Report, Source};
use dtof_sensors::SensorInfo;
use rand_core::SeedableRng;
use rand_pcg::Pcg32;

/// Blocks of three levels, tracking and two echoes, for photons of the link.
fn requested(columns: u16, rows: u16) -> Configuration {
    let rule = WindowRule::new(3, U4F12::lit("4.5"), Count::saturating(5)).unwrap();
    let centred = CentredWindow::new(U8F8::lit("2.5")).unwrap();
    Configuration {
        rule: rule.into(),
        estimator: DepthEstimator::CentredWindow(centred),
        l2: 400,
        pixels: columns * rows,
        columns,
        binning: Some(AdaptiveBinning {
            levels: BlockLevel::saturating(3),
            patience: 50,
        }),
        tracking: true,
        echoes: EchoNumber::new(2).unwrap(),
        echo_guard_bins: 4,
        echo_wait: 8,
        source: Source::Link,
        ..CONFIGURATION
    }
}

/// A device with room for 8x8 pixels and their blocks, and a host that has configured it.
fn configured(requested: &Configuration) -> (Sidecar<'static>, Host) {
    let mut device = device_with_blocks::<64, 21>(Some(SensorInfo::new(256)));
    let mut host = Host::new(1, 0);
    host.configure(&mut device, 0, requested);
    (device, host)
}

fn sensor(script: &[Vec<Call>]) -> Scripted<impl Iterator<Item = Option<Vec<Call>>>> {
    scripted(script.iter().cloned().map(Some))
}

/// Photons over the link to a host that takes one message in so many milliseconds.
fn over_link(requested: &Configuration, script: &[Vec<Call>], reads_one_in: u32) -> (Host, Report) {
    let (mut device, mut host) = configured(requested);
    let mut to_send = VecDeque::from(messages(script));
    let mut now_ms = 0;
    while !to_send.is_empty() {
        while host.endpoint.has_room()
            && let Some(body) = to_send.pop_front()
        {
            host.ask(message::PHOTONS, &body);
        }
        host.exchange(&mut device, now_ms);
        if now_ms.is_multiple_of(reads_one_in) {
            host.read(1);
        }
        now_ms += 1;
    }
    let report = host.report(&mut device, now_ms);
    (host, report)
}

/// Pixels, blocks of each level, second echoes and photons held: nothing is left out.
#[track_caller]
fn has_all(expected: &Expected, levels: u8) {
    for level in 0..=levels {
        let of_level = expected.events.iter();
        let of_level = of_level.filter(|event| event.level.raw() == level);
        assert!(of_level.count() > 3, "level {level}");
    }
    let second = |event: &&DepthEvent| event.echo.raw() == 2;
    assert!(expected.events.iter().filter(second).count() > 50);
    assert!(expected.pixels.excluded > 0 && expected.blocks.excluded > 0);
}

#[test]
fn pixels_and_blocks_report_what_they_do_by_hand_however_seldom_the_host_reads() {
    for (columns, rows, cycles) in [(8, 8, 2_000), (5, 3, 4_000)] {
        let script = script(cycles, columns * rows, &mut Pcg32::seed_from_u64(1));
        let requested = requested(columns, rows);
        let expected = expected(&script, &requested);
        has_all(&expected, 3);
        for reads_one_in in [1, 40] {
            let (host, report) = over_link(&requested, &script, reads_one_in);
            assert_eq!(host.events.len(), expected.events.len());
            assert!(host.events == expected.events, "{columns}x{rows}");
            assert_eq!(report.statistics, expected.pixels);
            assert_eq!(report.blocks, expected.blocks);
            assert_eq!(report.statistics.photons(), photons(&script));
            assert_eq!(report.unaddressed, 0);
        }
    }
}

#[test]
fn each_of_the_three_makes_other_events() {
    let script = script(2_000, 15, &mut Pcg32::seed_from_u64(2));
    let all = requested(5, 3);
    let (of_all, _) = over_link(&all, &script, 1);
    let binning = |levels, patience| {
        let levels = BlockLevel::saturating(levels);
        Some(AdaptiveBinning { levels, patience })
    };
    let with = |change: &dyn Fn(&mut Configuration)| {
        let mut other = all;
        change(&mut other);
        other
    };
    let others = [
        with(&|other| other.binning = binning(1, 50)),
        with(&|other| other.binning = binning(3, 53)),
        with(&|other| other.tracking = false),
        with(&|other| other.echoes = EchoNumber::FIRST),
        with(&|other| other.echo_guard_bins = 5),
        with(&|other| other.echo_wait = 2),
        // Three rows of five lie otherwise.
        with(&|other| other.columns = 3),
    ];
    for other in others {
        let (host, report) = over_link(&other, &script, 1);
        let expected = expected(&script, &other);
        assert!(host.events == expected.events && host.events != of_all.events);
        assert_eq!(report.blocks, expected.blocks);
    }
    // Without blocks there is nothing of them, whatever the columns say.
    let without = Configuration {
        binning: None,
        columns: 0,
        ..all
    };
    let (host, report) = over_link(&without, &script, 1);
    let pixel = |event: &DepthEvent| event.level == BlockLevel::PIXEL;
    assert!(!host.events.is_empty() && host.events.iter().all(pixel));
    assert_eq!(report.blocks, dtof_core::Statistics::default());
}

#[test]
fn photons_of_a_sensor_reach_blocks_too() {
    let script = script(4_000, 15, &mut Pcg32::seed_from_u64(3));
    let requested = Configuration {
        source: Source::Sensor,
        ..requested(5, 3)
    };
    let expected = expected(&script, &requested);
    let (mut device, mut host) = configured(&requested);
    host.run(&mut device, &mut sensor(&script), 0..4_000, 4);
    let report = host.report(&mut device, 4_000);
    assert!(host.events == expected.events && host.events.len() > 500);
    assert_eq!(report.statistics, expected.pixels);
    assert_eq!(report.blocks, expected.blocks);
}

#[test]
fn a_host_that_does_not_read_a_sensor_loses_no_event_of_pixels_and_blocks() {
    let script = script(12_000, 15, &mut Pcg32::seed_from_u64(4));
    let requested = Configuration {
        source: Source::Sensor,
        ..requested(5, 3)
    };
    let (mut device, mut host) = configured(&requested);
    let mut sensor = sensor(&script);
    for begin in (0..12_000).step_by(3_000) {
        host.run(&mut device, &mut sensor, begin..begin + 1_500, 4);
        host.run(&mut device, &mut sensor, begin + 1_500..begin + 3_000, 0);
    }
    let report = host.report(&mut device, 12_000);
    let sent = report.statistics.events + report.blocks.events;
    assert_eq!(sent, host.events.len() as u64);
    let deferred = [report.statistics.deferred, report.blocks.deferred];
    assert!(deferred.iter().all(|&count| count > 100), "{deferred:?}");
    assert_eq!(report.statistics.photons(), photons(&script));
    // Echoes of an exposure stay together: a second one has its first before it.
    let mut last = BTreeMap::new();
    for event in &host.events {
        let before = last.insert((event.level, event.pixel), *event);
        if event.echo.raw() == 2 {
            let first = before.unwrap();
            assert_eq!(first.echo, EchoNumber::FIRST);
            assert!(first.exposure < event.exposure);
        }
    }
}

/// A pixel whose event the host does not take is not silent: nobody feeds the block.
#[test]
fn a_pixel_whose_event_waits_feeds_no_block() {
    let requested = Configuration {
        l2: 20_000,
        echoes: EchoNumber::FIRST,
        source: Source::Sensor,
        ..requested(2, 2)
    };
    let bright = [
        (0..4).map(|pixel| Call::Photon(pixel, 40)).collect(),
        vec![Call::End(1)],
    ]
    .concat();
    let (mut device, mut host) = configured(&requested);
    let mut sensor = scripted((0..5_000).map(|_| Some(bright.clone())));
    host.run(&mut device, &mut sensor, 0..5_000, 0);
    let report = host.report(&mut device, 5_000);
    assert!(report.statistics.deferred > 4_000, "{report:?}");
    assert_eq!(report.blocks.photons(), 0, "{report:?}");
}

#[test]
fn dynamic_depth_follows_the_first_echoes_of_pixels_and_blocks() {
    let script = script(6_000, 15, &mut Pcg32::seed_from_u64(5));
    // A tenth of a bin.
    let threshold_mm = U24F8::lit("4");
    let reference = Reference::Reported;
    let requested = Configuration {
        dynamic_depth: Some(DynamicDepth {
            threshold_mm,
            reference,
        }),
        ..requested(5, 3)
    };
    let scale = RangeScale::new(U16F16::from_num(250), I24F8::ZERO).unwrap();
    let config = DynamicDepthConfig::new(threshold_mm, &scale, reference).unwrap();
    let mut observers = BTreeMap::new();
    let all = expected(&script, &requested);
    let first = all.events.iter().filter(|event| event.echo.raw() == 1);
    let changes: Vec<DynamicDepthEvent> = first
        .filter_map(|event| {
            let observer = observers.entry((event.level, event.pixel));
            let observer = observer.or_insert_with(DynamicDepthPixel::<3>::new);
            observer.observe(&config, event)
        })
        .collect();
    for level in 0..=3 {
        assert!(changes.iter().any(|change| change.level.raw() == level));
    }
    for reads_one_in in [1, 40] {
        let (host, report) = over_link(&requested, &script, reads_one_in);
        assert!(host.changes == changes && host.events.is_empty());
        // Events are counted all the same.
        assert_eq!(report.statistics, all.pixels);
        assert_eq!(report.blocks, all.blocks);
    }
}

/// Peaks in two bins on a level background.
fn two_peaks(near: usize) -> Box<[u32; 128]> {
    let mut counts = [100; 128];
    for (bin, height) in [(near, 70_000), (90, 30_000)] {
        counts[bin - 1] = height / 10;
        counts[bin] = height;
        counts[bin + 1] = height / 8;
    }
    Box::new(counts)
}

#[test]
fn a_whole_histogram_has_several_echoes_and_no_block() {
    let requested = Configuration {
        source: Source::Sensor,
        gate: (10, 99),
        ..requested(4, 2)
    };
    let [config, _] = configs(&requested);
    let (mut device, mut host) = configured(&requested);
    let calls = vec![
        Call::Frame(9),
        Call::Histogram(3, two_peaks(40)),
        // The tail of the near peak is not left over, and the far one is outside of none.
        Call::Histogram(5, two_peaks(41)),
        Call::Histogram(3, Box::new([100; 128])),
    ];
    host.run(
        &mut device,
        &mut scripted([Some(calls)].into_iter()),
        0..10,
        4,
    );
    let report = host.report(&mut device, 10);

    let gate = RangeGate::new(10, 99).unwrap();
    let by_hand = |pixel: u16, near: usize| {
        let mut histogram = Histogram::<128, Count24>::new();
        histogram.add_frame(&two_peaks(near), &gate);
        let first = detect(&histogram, &gate, config.rule(), config.estimator()).unwrap();
        let (pixel, cycle) = (PixelAddress::new(pixel), LaserCycle::new(8));
        let mut excluded = ExcludedBins::new(4);
        excluded.push(first.peak.bin);
        assert_eq!(excluded.empty(&mut histogram), 70_000 * 49 / 40 + 600);
        (first.event(pixel, cycle, 9), histogram.peak())
    };
    let mut events = host.events.iter();
    for (pixel, near) in [(3, 40), (5, 41)] {
        let (first, peak) = by_hand(pixel, near);
        assert_eq!(events.next(), Some(&first));
        let second = events.next().unwrap();
        assert_eq!((second.pixel, second.cycle), (first.pixel, first.cycle));
        assert_eq!((second.peak_bin, second.peak_count), (peak.bin, peak.count));
        assert_eq!((second.echo.raw(), second.exposure), (2, 9));
        assert_eq!((second.peak_bin.raw(), second.background.raw()), (90, 100));
        assert_eq!(second.flags, Flags::NONE);
    }
    assert_eq!(events.next(), None);
    let statistics = report.statistics;
    assert_eq!((statistics.events, statistics.expired), (4, 1));
    assert_eq!(statistics.photons(), histogram_photons());
    assert_eq!(report.blocks, dtof_core::Statistics::default());
}

/// Of the three above.
fn histogram_photons() -> u64 {
    let of = |counts: &[u32; 128]| counts.iter().map(|&count| u64::from(count)).sum::<u64>();
    of(&two_peaks(40)) + of(&two_peaks(41)) + 128 * 100
}

#[test]
fn without_room_for_all_echoes_of_a_histogram_it_is_put_off() {
    let requested = Configuration {
        source: Source::Sensor,
        ..requested(4, 2)
    };
    let (mut device, mut host) = configured(&requested);
    let mut sensor = scripted((0..1_000).map(|_| Some(vec![Call::Histogram(0, two_peaks(40))])));
    host.run(&mut device, &mut sensor, 0..1_000, 0);
    let report = host.report(&mut device, 1_000);
    let statistics = report.statistics;
    assert_eq!(statistics.events, host.events.len() as u64);
    assert!(statistics.events > 60 && statistics.deferred > 500);
    assert_eq!(statistics.events / 2 + statistics.deferred, 1_000);
    for pair in host.events.chunks(2) {
        let [first, second] = pair else {
            panic!("half of a pair")
        };
        assert_eq!((first.echo.raw(), second.echo.raw()), (1, 2));
        assert_eq!(first.cycle, second.cycle);
    }
}

/// A block has as many photons as its pixels together. That is no pile-up.
#[test]
fn photons_of_several_pixels_are_no_pile_up_of_their_block() {
    // Of four pixels in turns one in each laser cycle, then all of them in each.
    for (all, flags) in [(false, Flags::NONE), (true, Flags::PILE_UP)] {
        let calls = (0..1_000u16).map(|cycle| {
            let of_cycle = (0..4u16).filter(|pixel| all || cycle % 4 == *pixel);
            let photons = of_cycle.map(|pixel| Call::Photon(pixel, 40));
            Some(photons.chain([Call::End(1)]).collect())
        });
        // No pixel has so many, unless it has one in each laser cycle.
        let rule = WindowRule::new(3, U4F12::lit("4.5"), Count::saturating(600)).unwrap();
        let base = requested(2, 2);
        let requested = Configuration {
            rule: rule.into(),
            tracking: false,
            echoes: EchoNumber::FIRST,
            l2: 2_000,
            source: Source::Sensor,
            binning: Some(AdaptiveBinning {
                levels: BlockLevel::saturating(1),
                patience: 4,
            }),
            ..base
        };
        let mut device = device_with_blocks::<64, 21>(Some(SensorInfo {
            dead_time: u16::MAX,
            ..SensorInfo::new(256)
        }));
        let mut host = Host::new(1, 0);
        host.configure(&mut device, 0, &requested);
        let mut sensor = scripted(calls);
        host.run(&mut device, &mut sensor, 0..1_000, 4);
        let of_block = host.events.iter().find(|event| event.level.raw() == 1);
        let event = of_block.expect("an event of the block");
        assert_eq!(event.flags, flags, "{event:?}");
    }
}
