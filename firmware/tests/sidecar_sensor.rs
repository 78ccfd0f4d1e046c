//! The sidecar with photons and histograms of a sensor: the same events as a
//! pixel's, longer exposures for a host that does not read, and nothing lost
//! that is not counted.

use crate::common::host::{CONFIGURATION, Call, Host, Scripted, configured, device, scripted};
use crate::common::{scene, script};
use dtof_core::events::{DynamicDepthConfig, DynamicDepthEvent, DynamicDepthPixel, Reference};
use dtof_core::fixed::types::{I24F8, U4F12, U8F8, U16F16, U24F8};
use dtof_core::rule::detect;
use dtof_core::{
    AnyRule, CentredWindow, Count, Count24, DepthEstimator, DepthEvent, Flags, Histogram,
    LaserCycle, PixelAddress, PixelConfig, RangeGate, RangeScale, WindowRule,
};
use dtof_link::frame::WIRE_BYTES;
use dtof_link::{Configuration, DynamicDepth, FaultRecord, Report, Source, message};
use dtof_sensors::dither::Dither;
use dtof_sensors::{PhotonSink, Polled, Sensor, SensorFault, SensorInfo};
use rand_core::SeedableRng;
use rand_pcg::Pcg32;

/// A configuration with each rule and estimator, and the same as the core takes it.
fn configurations() -> [(Configuration, PixelConfig<128, AnyRule>); 2] {
    let window = WindowRule::new(3, U4F12::lit("4.5"), Count::saturating(5)).unwrap();
    let centred = CentredWindow::new(U8F8::lit("2.5")).unwrap();
    let with_windows = Configuration {
        rule: window.into(),
        estimator: DepthEstimator::CentredWindow(centred),
        ..CONFIGURATION
    };
    [CONFIGURATION, with_windows].map(|requested| (requested, script::config(&requested)))
}

fn sensor(script: &[Vec<Call>]) -> Scripted<impl Iterator<Item = Option<Vec<Call>>>> {
    scripted(script.iter().cloned().map(Some))
}

#[test]
fn a_host_that_reads_gets_the_events_of_the_pixels() {
    let script = script::script(5_000, &mut Pcg32::seed_from_u64(1));
    for (requested, config) in configurations() {
        let (mut device, mut host) = configured::<8>(&requested);
        host.run(&mut device, &mut sensor(&script), 0..5_000, 4);
        let report = host.report(&mut device, 5_000);
        let expected = script::reference(&script, &config);
        assert!(expected.len() > 500 && host.events == expected);
        assert_eq!(report.statistics.events, expected.len() as u64);
        assert_eq!(report.statistics.deferred, 0);
        assert_eq!(report.statistics.photons(), script::photons(&script));
    }
}

#[test]
fn dynamic_depth_sends_what_the_core_makes_of_the_events() {
    let script = script::script(5_000, &mut Pcg32::seed_from_u64(1));
    let (requested, config) = configurations()[0];
    let scale = RangeScale::new(U16F16::from_num(250), I24F8::ZERO).unwrap();
    // A twentieth of a bin, so that there are many.
    let threshold_mm = U24F8::lit("2");
    for reference in [Reference::Previous, Reference::Reported] {
        let requested = Configuration {
            dynamic_depth: Some(DynamicDepth {
                threshold_mm,
                reference,
            }),
            ..requested
        };
        let (mut device, mut host) = configured::<8>(&requested);
        host.run(&mut device, &mut sensor(&script), 0..5_000, 4);
        let report = host.report(&mut device, 5_000);
        let dynamic_depth = DynamicDepthConfig::new(threshold_mm, &scale, reference).unwrap();
        let mut observers = [const { DynamicDepthPixel::<3>::new() }; 8];
        let events = script::reference(&script, &config);
        let observe = |event: &DepthEvent| {
            observers[usize::from(event.pixel.raw())].observe(&dynamic_depth, event)
        };
        let expected: Vec<DynamicDepthEvent> = events.iter().filter_map(observe).collect();
        assert!(expected.len() > 30, "{}", expected.len());
        assert!(host.changes == expected && host.events.is_empty());
        // Depth events are counted all the same.
        assert_eq!(report.statistics.events, events.len() as u64);
    }
}

#[test]
fn a_host_that_does_not_read_for_ten_seconds_lengthens_exposures_and_loses_no_event() {
    let script = script::script(20_000, &mut Pcg32::seed_from_u64(1));
    let requested = Configuration {
        l2: 60_000,
        ..CONFIGURATION
    };
    let (mut device, mut host) = configured::<8>(&requested);
    let mut sensor = sensor(&script);
    for (milliseconds, messages) in [(0..2_000, 4), (2_000..12_000, 0), (12_000..20_000, 4)] {
        host.run(&mut device, &mut sensor, milliseconds, messages);
    }
    let report = host.report(&mut device, 20_000);
    // Questions do not empty slots; what is still in them comes after.
    assert_eq!(report.statistics.events, host.events.len() as u64);
    assert!(report.statistics.deferred > 100, "{report:?}");
    assert_eq!(report.statistics.photons(), script::photons(&script));
    assert_eq!(report.statistics.expired, 0);
    // Each laser cycle was part of one exposure: no event of any pixel is missing.
    for pixel in 0..8 {
        let of_pixel = || {
            host.events
                .iter()
                .filter(|event| event.pixel.raw() == pixel)
        };
        let mut end = 0;
        for event in of_pixel() {
            assert_eq!(event.cycle.raw() + 1, end + u64::from(event.exposure));
            end = event.cycle.raw() + 1;
        }
        let deferred = of_pixel().filter(|event| event.flags.contains(Flags::DEFERRED));
        let longest = deferred.map(|event| event.exposure).max().unwrap();
        assert!(longest > 10_000, "pixel {pixel}: {longest}");
    }
}

#[test]
fn questions_are_answered_though_the_sensor_fills_the_link() {
    let script = script::script(20_000, &mut Pcg32::seed_from_u64(1));
    let (mut device, mut host) = configured::<8>(&CONFIGURATION);
    let mut sensor = sensor(&script);
    let mut asked = 0;
    for now_ms in 0..20_000 {
        device.poll_sensor(&mut sensor, now_ms);
        host.exchange(&mut device, now_ms);
        if now_ms % 100 == 0 {
            host.read(1);
        }
        if now_ms % 5_000 == 2_500 {
            host.ask(message::STATISTICS_REQUEST, &[]);
            asked += 1;
        }
    }
    let last = host.report(&mut device, 20_000);
    let reports: Vec<_> = host
        .answers
        .iter()
        .filter(|(kind, ..)| *kind == message::STATISTICS)
        .map(|(_, body, events)| (Report::from_le_bytes(body).unwrap(), *events))
        .collect();
    assert_eq!(reports.len(), asked + 1);
    for (report, events) in reports {
        assert_eq!(report.statistics.events, events as u64);
    }
    assert!(last.statistics.deferred > 1_000, "{last:?}");
    // No pixel keeps the others from the link.
    let mut counts = [0; 8];
    for event in &host.events {
        counts[usize::from(event.pixel.raw())] += 1;
    }
    let (least, most) = (counts.iter().min(), counts.iter().max());
    assert!(least.unwrap() * 2 > *most.unwrap(), "{counts:?}");
}

/// Gives data in each of its polls as long as it has some.
struct Ready {
    polls: u32,
    left: u32,
}

impl Sensor for Ready {
    type Error = SensorFault;

    fn info(&self) -> SensorInfo {
        SensorInfo::new(1)
    }

    fn start(&mut self, _: U16F16, _: Dither) {}

    fn stop(&mut self) {}

    fn poll(&mut self, _: u32, sink: &mut impl PhotonSink) -> Result<Polled, SensorFault> {
        self.polls += 1;
        let Some(left) = self.left.checked_sub(1) else {
            return Ok(Polled::Idle);
        };
        self.left = left;
        sink.end_laser_cycles(1);
        Ok(Polled::Data)
    }
}

#[test]
fn a_sensor_that_has_more_is_polled_on_but_not_without_end() {
    let (mut runs, _) = configured::<8>(&CONFIGURATION);
    let mut sensor = Ready { polls: 0, left: 10 };
    let has_more = [0; 4].map(|now_ms| {
        runs.poll_sensor(&mut sensor, now_ms);
        runs.sensor_has_more()
    });
    assert_eq!(has_more, [true, true, false, false]);
    // Four each, the third ends with an idle one.
    assert_eq!(sensor.polls, 4 + 4 + 3 + 1);

    // A sensor whose photons do not count keeps nobody awake.
    let mut rests = device::<8>(Some(SensorInfo::new(1)));
    let mut sensor = Ready { polls: 0, left: 10 };
    rests.poll_sensor(&mut sensor, 0);
    assert!(!rests.sensor_has_more());
    assert_eq!(sensor.polls, 0);
}

#[test]
fn without_a_host_nothing_is_counted_or_sent_and_nothing_hangs() {
    let script = script::script(10_000, &mut Pcg32::seed_from_u64(1));
    let mut device = device::<8>(Some(SensorInfo::new(256)));
    let mut unused = sensor(&script);
    let mut wire = [0; WIRE_BYTES];
    for now_ms in 0..10_000 {
        device.poll_sensor(&mut unused, now_ms);
        device.work(0);
        assert_eq!(device.transmit(now_ms, &mut wire), 0);
    }
    // It was not even asked.
    assert!(unused.calls.next().is_some());

    // A configuration that takes photons from the link keeps the sensor's out.
    let mut host = Host::new(1, 10_000);
    let requested = Configuration {
        source: Source::Link,
        ..CONFIGURATION
    };
    host.configure(&mut device, 10_000, &requested);
    device.poll_sensor(&mut unused, 10_000);
    let report = host.report(&mut device, 10_000);
    assert_eq!((report.cycles, report.statistics.photons()), (0, 0));

    // A host that goes away keeps the device from nothing until it is taken for silent, and
    // finds the events when it comes back.
    host.configure(&mut device, 10_001, &CONFIGURATION);
    let mut sensor = sensor(&script);
    for now_ms in 10_001..110_001 {
        device.poll_sensor(&mut sensor, now_ms);
        device.work(0);
        while device.transmit(now_ms, &mut wire) > 0 {}
    }
    // What was lost on the way is sent again by now.
    let report = host.report(&mut device, 112_000);
    let heard = usize::from(CONFIGURATION.host_timeout_ms);
    assert_eq!(
        report.statistics.photons(),
        script::photons(&script[..heard])
    );
    assert_eq!(report.statistics.events, host.events.len() as u64);
    assert!(report.statistics.deferred > 0 && !host.events.is_empty());
}

#[test]
fn a_configuration_waits_for_the_events_of_the_one_before() {
    let script = script::script(3_000, &mut Pcg32::seed_from_u64(1));
    let (mut device, mut host) = configured::<8>(&CONFIGURATION);
    let mut sensor = sensor(&script);
    host.run(&mut device, &mut sensor, 0..2_000, 0);
    let report = host.report(&mut device, 2_000);
    assert!(report.statistics.deferred > 0);
    assert_eq!(report.statistics.events, host.events.len() as u64);
    // Every slot has been full all the while.
    host.configure(&mut device, 2_000, &CONFIGURATION);
    assert_eq!(host.events.len() as u64, report.statistics.events + 8);
    assert_eq!(host.report(&mut device, 2_000).statistics.events, 0);
}

/// A peak in `bin` on a level background.
fn histogram(bin: usize) -> Box<[u32; 128]> {
    let mut counts = [100; 128];
    counts[bin - 1] = 5_000;
    counts[bin] = 70_000;
    counts[bin + 1] = 9_000;
    Box::new(counts)
}

#[test]
fn a_histogram_is_decided_once_within_the_gate() {
    for (requested, config) in configurations() {
        is_decided_once_within_the_gate(requested, &config);
    }
}

fn is_decided_once_within_the_gate(requested: Configuration, config: &PixelConfig<128, AnyRule>) {
    let requested = Configuration {
        gate: (10, 99),
        ..requested
    };
    let (mut device, mut host) = configured::<8>(&requested);
    let mut outside = histogram(40);
    outside[120] = 100_000;
    let calls = vec![
        Call::Frame(700),
        Call::Histogram(3, outside.clone()),
        Call::Histogram(4, Box::new([100; 128])),
        Call::Histogram(8, Box::new([1; 128])),
        // More than the exposure of an event holds.
        Call::Frame(100_000),
        Call::Histogram(3, histogram(41)),
    ];
    let mut sensor = scripted([None, Some(calls), None].into_iter());
    for now_ms in 0..3 {
        device.poll_sensor(&mut sensor, now_ms);
    }
    let report = host.report(&mut device, 3);
    assert_eq!(report.sensor_errors, 2);
    assert_eq!(report.last_sensor_error, FaultRecord::Data as u8);
    assert_eq!((report.cycles, report.unaddressed), (100_700, 128));
    let statistics = report.statistics;
    assert_eq!(
        (statistics.events, statistics.expired, statistics.deferred),
        (2, 1, 0)
    );
    assert_eq!(statistics.gated_out, 38 * 100 * 3 + 100_000 - 100);

    let gate = RangeGate::new(10, 99).unwrap();
    let expected = |counts: &[u32; 128], cycle, exposure| {
        let mut histogram = Histogram::<128, Count24>::new();
        histogram.add_frame(counts, &gate);
        let detection = detect(&histogram, &gate, config.rule(), config.estimator()).unwrap();
        detection.event(PixelAddress::new(3), LaserCycle::new(cycle), exposure)
    };
    assert_eq!(
        host.events,
        [
            expected(&outside, 699, 700),
            expected(&histogram(41), 100_699, u16::MAX)
        ]
    );
}

#[test]
fn histograms_without_room_for_an_event_are_counted_as_deferred() {
    let (mut device, mut host) = configured::<8>(&CONFIGURATION);
    let mut sensor = scripted((0..1_000).map(|_| Some(vec![Call::Histogram(0, histogram(40))])));
    host.run(&mut device, &mut sensor, 0..1_000, 0);
    let report = host.report(&mut device, 1_000);
    let statistics = report.statistics;
    assert_eq!(statistics.events, host.events.len() as u64);
    assert!(statistics.events > 60 && statistics.deferred > 500);
    assert_eq!(statistics.events + statistics.deferred, 1_000);
    // Those that were not looked at are counted all the same.
    assert_eq!(report.statistics.photons(), 1_000 * (125 * 100 + 84_000));
}

/// 100 bytes a millisecond on the wire.
#[test]
fn the_simulated_scene_comes_over_a_serial_port() {
    let (host, _) = scene::over_serial(0, 5_000, 100);
    // All pixels report, and most of the time the right bins.
    assert!(host.events.len() > 2_000, "{}", host.events.len());
    let right = |event: &&DepthEvent| {
        let pulse = 20 + 6 * event.pixel.raw();
        (pulse..pulse + 3).contains(&event.peak_bin.raw())
    };
    let (count, all) = (host.events.iter().filter(right).count(), host.events.len());
    assert!(count * 100 > all * 95, "{count} of {all}");
    for pixel in 0..16 {
        assert!(host.events.iter().any(|event| event.pixel.raw() == pixel));
    }
}
