//! The sidecar with photons and histograms of a sensor: the same events as a
//! pixel's, longer exposures for a host that does not read, and nothing lost
//! that is not counted.

mod common;

use common::host::{CONFIGURATION, Call, Host, Scripted};
use dtof_core::fixed::types::{I24F8, U4F12, U8F8, U16F16, U24F8};
use dtof_core::{
    AnyRule, AsyncPixel, CentredWindow, Count, Count24, DepthEstimator, DepthEvent,
    DynamicDepthConfig, DynamicDepthEvent, DynamicDepthPixel, Flags, Histogram, LaserCycle,
    PaperRule, PixelAddress, PixelConfig, RangeGate, RangeScale, Reference, Statistics, WindowRule,
    detect,
};
use dtof_firmware::sidecar::{Pixel, Sidecar};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::message;
use dtof_link::{Configuration, DynamicDepth, FaultRecord, Refusal, Report, SensorRecord, Source};
use dtof_sensors::{About, PhotonSink, Polled, Sensor, SensorFault, simulated};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// Room for the bytes of a few milliseconds.
type Buffers = dtof_firmware::serial::Buffers<512, 1024>;
type Pixels = heapless::Vec<Pixel, 8>;

/// A configuration with each rule and estimator, and the same as the core takes it.
fn configurations() -> [(Configuration, PixelConfig<128, AnyRule>); 2] {
    let minimum_count = Count::saturating(5);
    let config = |rule| PixelConfig::with_rule(rule).x(4).l1(20).l2(200);
    let paper = PaperRule::new(U8F8::lit("4"), minimum_count);
    let window = WindowRule::new(3, U4F12::lit("4.5"), minimum_count).unwrap();
    let centred = CentredWindow::new(U8F8::lit("2.5")).unwrap();
    let with_windows = Configuration {
        rule: window.into(),
        estimator: DepthEstimator::CentredWindow(centred),
        ..CONFIGURATION
    };
    [
        (CONFIGURATION, config(paper.into()).build().unwrap()),
        (
            with_windows,
            config(window.into())
                .estimator(DepthEstimator::CentredWindow(centred))
                .build()
                .unwrap(),
        ),
    ]
}

/// Photons of one laser cycle and, now and then, of a few empty ones after it.
fn calls(rng: &mut Pcg32) -> Vec<Call> {
    let mut calls = Vec::new();
    for pixel in 0..8 {
        for _ in 0..rng.next_u32() % 3 {
            let random = (rng.next_u32() % 130) as u16;
            let signal = rng.next_u32() & 1 == 0;
            let code = if signal { 20 + 10 * pixel } else { random };
            calls.push(Call::Photon(pixel, code));
        }
    }
    let cycles = if rng.next_u32().is_multiple_of(10) {
        7
    } else {
        1
    };
    calls.push(Call::End(cycles));
    calls
}

fn script(length: usize) -> Vec<Vec<Call>> {
    let mut rng = Pcg32::seed_from_u64(1);
    (0..length).map(|_| calls(&mut rng)).collect()
}

fn sensor(script: &[Vec<Call>]) -> Scripted<impl Iterator<Item = Option<Vec<Call>>>> {
    Scripted(script.iter().cloned().map(Some))
}

/// What pixels with a link that takes every event at once report.
fn reference(script: &[Vec<Call>], config: &PixelConfig<128, AnyRule>) -> Vec<DepthEvent> {
    let mut pixels: Vec<_> = (0..8)
        .map(|address| AsyncPixel::<128>::new(PixelAddress(address)))
        .collect();
    let mut events = Vec::new();
    let mut statistics = Statistics::default();
    let mut cycle = 0;
    for call in script.iter().flatten() {
        match *call {
            Call::Photon(pixel, code) => pixels[usize::from(pixel)].count(config, code),
            Call::End(cycles) => {
                for _ in 0..cycles {
                    for pixel in &mut pixels {
                        pixel.end_laser_cycle(config, &mut statistics, LaserCycle(cycle));
                        events.extend(pixel.acknowledge());
                    }
                    cycle += 1;
                }
            }
            Call::Histogram(..) => unreachable!(),
        }
    }
    events
}

fn photons(script: &[Vec<Call>]) -> u64 {
    let calls = script.iter().flatten();
    calls
        .map(|call| u64::from(matches!(call, Call::Photon(..))))
        .sum()
}

fn offered(report: &Report) -> u64 {
    let statistics = report.statistics;
    statistics.counted + statistics.saturated + statistics.rejected + statistics.gated_out
}

#[test]
fn a_host_that_reads_gets_the_events_of_the_pixels() {
    let script = script(5_000);
    for (wanted, config) in configurations() {
        let mut pixels = Pixels::new();
        let mut device = Sidecar::new(&mut pixels, Some(About::new(256)));
        let mut host = Host::new(1, 0);
        let mut sensor = sensor(&script);
        host.configure(&mut device, 0, &wanted);
        for now_ms in 0..5_000 {
            device.poll_sensor(&mut sensor, now_ms);
            host.exchange(&mut device, now_ms);
            host.read(4);
        }
        let report = host.report(&mut device, 5_000);
        let expected = reference(&script, &config);
        assert!(expected.len() > 500 && host.events == expected);
        assert_eq!(report.statistics.events, expected.len() as u64);
        assert_eq!(report.statistics.deferred, 0);
        assert_eq!(offered(&report), photons(&script));
    }
}

#[test]
fn dynamic_depth_sends_what_the_core_makes_of_the_events() {
    let script = script(5_000);
    let (wanted, config) = configurations()[0];
    let scale = RangeScale::new(U16F16::from_num(250), I24F8::ZERO).unwrap();
    // A twentieth of a bin, so that there are many.
    let threshold_mm = U24F8::lit("2");
    for reference in [Reference::Previous, Reference::Reported] {
        let mut pixels = Pixels::new();
        let mut device = Sidecar::new(&mut pixels, Some(About::new(256)));
        let mut host = Host::new(1, 0);
        let mut sensor = sensor(&script);
        let wanted = Configuration {
            dynamic_depth: Some(DynamicDepth {
                threshold_mm,
                reference,
            }),
            ..wanted
        };
        host.configure(&mut device, 0, &wanted);
        for now_ms in 0..5_000 {
            device.poll_sensor(&mut sensor, now_ms);
            host.exchange(&mut device, now_ms);
            host.read(4);
        }
        let report = host.report(&mut device, 5_000);
        let dynamic_depth = DynamicDepthConfig::new(threshold_mm, &scale, reference).unwrap();
        let mut observers = [const { DynamicDepthPixel::<3>::new() }; 8];
        let events = self::reference(&script, &config);
        let expected: Vec<DynamicDepthEvent> = events
            .iter()
            .filter_map(|event| {
                observers[usize::from(event.pixel.0)].observe(&dynamic_depth, event)
            })
            .collect();
        assert!(expected.len() > 30, "{}", expected.len());
        assert!(host.changes == expected && host.events.is_empty());
        // Depth events are counted all the same.
        assert_eq!(report.statistics.events, events.len() as u64);
    }
}

#[test]
fn a_host_that_does_not_read_for_ten_seconds_lengthens_exposures_and_loses_no_event() {
    let script = script(20_000);
    let mut pixels = Pixels::new();
    let mut device = Sidecar::new(&mut pixels, Some(About::new(256)));
    let mut host = Host::new(1, 0);
    let mut sensor = sensor(&script);
    host.configure(
        &mut device,
        0,
        &Configuration {
            l2: 60_000,
            ..CONFIGURATION
        },
    );
    for now_ms in 0..20_000 {
        device.poll_sensor(&mut sensor, now_ms);
        host.exchange(&mut device, now_ms);
        // Reads for a while, stops for ten seconds, reads again.
        if !(2_000..12_000).contains(&now_ms) {
            host.read(4);
        }
    }
    let report = host.report(&mut device, 20_000);
    // Questions do not empty slots; what is still in them comes after.
    assert_eq!(report.statistics.events, host.events.len() as u64);
    assert!(report.statistics.deferred > 100, "{report:?}");
    assert_eq!(offered(&report), photons(&script));
    assert_eq!(report.statistics.expired, 0);
    // Each laser cycle was part of one exposure: no event of any pixel is missing.
    for pixel in 0..8 {
        let of_pixel = || host.events.iter().filter(|event| event.pixel.0 == pixel);
        let mut end = 0;
        for event in of_pixel() {
            assert_eq!(event.cycle.0 + 1, end + u64::from(event.exposure));
            end = event.cycle.0 + 1;
        }
        let deferred = of_pixel().filter(|event| event.flags.contains(Flags::DEFERRED));
        let longest = deferred.map(|event| event.exposure).max().unwrap();
        assert!(longest > 10_000, "pixel {pixel}: {longest}");
    }
}

#[test]
fn questions_are_answered_though_the_sensor_fills_the_link() {
    let script = script(20_000);
    let mut pixels = Pixels::new();
    let mut device = Sidecar::new(&mut pixels, Some(About::new(256)));
    let mut host = Host::new(1, 0);
    let mut sensor = sensor(&script);
    host.configure(&mut device, 0, &CONFIGURATION);
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
    let count = |pixel| {
        host.events
            .iter()
            .filter(|event| event.pixel.0 == pixel)
            .count()
    };
    let counts: Vec<_> = (0..8).map(count).collect();
    let (least, most) = (counts.iter().min().unwrap(), counts.iter().max().unwrap());
    assert!(least * 2 > *most, "{counts:?}");
}

#[test]
fn without_a_host_nothing_is_counted_or_sent_and_nothing_hangs() {
    let script = script(10_000);
    let mut pixels = Pixels::new();
    let mut device = Sidecar::new(&mut pixels, Some(About::new(256)));
    let mut unused = sensor(&script);
    let mut wire = [0; WIRE_BYTES];
    for now_ms in 0..10_000 {
        device.poll_sensor(&mut unused, now_ms);
        device.work(0);
        assert_eq!(device.transmit(now_ms, &mut wire), 0);
    }
    // It was not even asked.
    assert!(unused.0.next().is_some());

    // A configuration that takes photons from the link keeps the sensor's out.
    let mut host = Host::new(1, 10_000);
    host.configure(
        &mut device,
        10_000,
        &Configuration {
            source: Source::Link,
            ..CONFIGURATION
        },
    );
    device.poll_sensor(&mut unused, 10_000);
    let report = host.report(&mut device, 10_000);
    assert_eq!((report.cycles, offered(&report)), (0, 0));

    // A host that goes away keeps the device from nothing, and finds the events
    // when it comes back.
    host.configure(&mut device, 10_001, &CONFIGURATION);
    let mut sensor = sensor(&script);
    for now_ms in 10_001..110_001 {
        device.poll_sensor(&mut sensor, now_ms);
        device.work(0);
        while device.transmit(now_ms, &mut wire) > 0 {}
    }
    // What was lost on the way is sent again by now.
    let report = host.report(&mut device, 112_000);
    assert_eq!(offered(&report), photons(&script));
    assert_eq!(report.statistics.events, host.events.len() as u64);
    assert!(report.statistics.deferred > 0 && !host.events.is_empty());
}

#[test]
fn a_configuration_waits_for_the_events_of_the_one_before() {
    let script = script(3_000);
    let mut pixels = Pixels::new();
    let mut device = Sidecar::new(&mut pixels, Some(About::new(256)));
    let mut host = Host::new(1, 0);
    let mut sensor = sensor(&script);
    host.configure(&mut device, 0, &CONFIGURATION);
    for now_ms in 0..2_000 {
        device.poll_sensor(&mut sensor, now_ms);
        host.exchange(&mut device, now_ms);
    }
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
    for (wanted, config) in configurations() {
        is_decided_once_within_the_gate(wanted, &config);
    }
}

fn is_decided_once_within_the_gate(wanted: Configuration, config: &PixelConfig<128, AnyRule>) {
    let mut pixels = Pixels::new();
    let mut device = Sidecar::new(&mut pixels, Some(About::new(256)));
    let mut host = Host::new(1, 0);
    let wanted = Configuration {
        gate: (10, 99),
        ..wanted
    };
    host.configure(&mut device, 0, &wanted);
    let mut outside = histogram(40);
    outside[120] = 100_000;
    let calls = vec![
        Call::Histogram(3, outside.clone()),
        Call::Histogram(4, Box::new([100; 128])),
        Call::Histogram(8, Box::new([1; 128])),
        Call::Histogram(3, histogram(41)),
    ];
    let mut sensor = Scripted([None, Some(calls), None].into_iter());
    for now_ms in 0..3 {
        device.poll_sensor(&mut sensor, now_ms);
    }
    let report = host.report(&mut device, 3);
    assert_eq!(report.sensor_errors, 2);
    assert_eq!(report.last_sensor_error, FaultRecord::Data as u8);
    assert_eq!((report.cycles, report.unaddressed), (4, 128));
    let statistics = report.statistics;
    assert_eq!(
        (statistics.events, statistics.expired, statistics.deferred),
        (2, 1, 0)
    );
    assert_eq!(statistics.gated_out, 38 * 100 * 3 + 100_000 - 100);

    let gate = RangeGate::new(10, 99).unwrap();
    let expected = |counts: &[u32; 128], cycle| {
        let mut histogram = Histogram::<128, Count24>::new();
        histogram.add_frame(counts, &gate);
        let detection = detect(&histogram, &gate, config.rule(), config.estimator()).unwrap();
        detection.event(PixelAddress(3), LaserCycle(cycle), 1)
    };
    assert_eq!(
        host.events,
        [expected(&outside, 0), expected(&histogram(41), 3)]
    );
}

#[test]
fn histograms_without_room_for_an_event_are_counted_as_deferred() {
    let mut pixels = Pixels::new();
    let mut device = Sidecar::new(&mut pixels, Some(About::new(256)));
    let mut host = Host::new(1, 0);
    host.configure(&mut device, 0, &CONFIGURATION);
    let mut sensor = Scripted((0..1_000).map(|_| Some(vec![Call::Histogram(0, histogram(40))])));
    for now_ms in 0..1_000 {
        device.poll_sensor(&mut sensor, now_ms);
        host.exchange(&mut device, now_ms);
    }
    let report = host.report(&mut device, 1_000);
    let statistics = report.statistics;
    assert_eq!(statistics.events, host.events.len() as u64);
    assert!(statistics.events > 60 && statistics.deferred > 500);
    assert_eq!(statistics.events + statistics.deferred, 1_000);
    // Those that were not looked at are counted all the same.
    assert_eq!(offered(&report), 1_000 * (125 * 100 + 84_000));
}

/// The main loop of an image, and 100 bytes a millisecond on the wire.
#[test]
fn the_simulated_scene_comes_over_a_serial_port() {
    let mut buffers = Buffers::new();
    let (mut interrupt, mut serial) = buffers.split(|| {});
    let mut pixels = heapless::Vec::<Pixel, 16>::new();
    let mut device = Sidecar::new(&mut pixels, Some(About::new(256)));
    let mut sensor = simulated::scene();
    let mut host = Host::new(1, 0);
    let mut frames = Deframer::new();
    let mut wire = [0; WIRE_BYTES];
    for now_ms in 0..5_000 {
        if now_ms == 10 {
            let wanted = Configuration {
                pixels: 16,
                l1: 40,
                l2: 2_000,
                ..CONFIGURATION
            };
            host.ask(message::CONFIGURE, &wanted.to_le_bytes());
        }
        let length = host.endpoint.transmit(now_ms, &mut wire);
        wire[..length]
            .iter()
            .for_each(|&byte| interrupt.on_receive(byte));
        let lost = serial.lost();
        let Ok(()) = device.poll_with(&mut sensor, &mut serial, lost, now_ms);
        for byte in std::iter::from_fn(|| interrupt.next_to_send()).take(100) {
            if let Some(frame) = frames.push(byte) {
                host.endpoint.receive(frame, now_ms);
            }
        }
        host.read(4);
    }
    assert_eq!(host.answers.len(), 1);
    assert_eq!(host.answers[0].0, message::CONFIGURED);
    assert_eq!(serial.lost(), 0);
    // All pixels report, and most of the time the right bins.
    assert!(host.events.len() > 2_000, "{}", host.events.len());
    let right = |event: &&DepthEvent| {
        let pulse = 20 + 6 * event.pixel.0;
        (pulse..pulse + 3).contains(&event.peak_bin.raw())
    };
    let count = host.events.iter().filter(right).count();
    assert!(
        count * 100 > host.events.len() * 95,
        "{count} of {}",
        host.events.len()
    );
    for pixel in 0..16 {
        assert!(host.events.iter().any(|event| event.pixel.0 == pixel));
    }
}

/// A sensor that notes what it is told.
#[derive(Default)]
struct Told(Vec<Order>);

#[derive(Debug, PartialEq)]
enum Order {
    Start(U16F16),
    Poll,
    Stop,
}

impl Sensor for Told {
    type Error = SensorFault;

    fn about(&self) -> About {
        About {
            bin_width: Some(U16F16::lit("160")),
            ..About::new(3)
        }
    }

    fn start(&mut self, bin_width: U16F16) {
        self.0.push(Order::Start(bin_width));
    }

    fn stop(&mut self) {
        self.0.push(Order::Stop);
    }

    fn poll(&mut self, _: u32, _: &mut impl PhotonSink) -> Result<Polled, SensorFault> {
        self.0.push(Order::Poll);
        Ok(Polled::Idle)
    }
}

#[test]
fn a_sensor_is_started_for_each_configuration_and_stopped_once() {
    let mut pixels = Pixels::new();
    let mut sensor = Told::default();
    let mut device = Sidecar::new(&mut pixels, Some(sensor.about()));
    let mut host = Host::new(1, 0);
    device.poll_sensor(&mut sensor, 0);
    let wanted = |bin_width: u32, source| Configuration {
        bin_width_ps: U16F16::from_num(bin_width),
        source,
        ..CONFIGURATION
    };
    for configuration in [
        wanted(160, Source::Sensor),
        wanted(150, Source::Sensor),
        wanted(250, Source::Link),
        wanted(250, Source::Link),
    ] {
        host.configure(&mut device, 0, &configuration);
        device.poll_sensor(&mut sensor, 0);
        device.poll_sensor(&mut sensor, 1);
    }
    let start = |bin_width| Order::Start(U16F16::from_num(bin_width));
    let (poll, stop) = (|| Order::Poll, Order::Stop);
    let expected = [start(160), poll(), poll(), start(150), poll(), poll(), stop];
    assert_eq!(sensor.0, expected);

    // A new session stops it, too.
    host.configure(&mut device, 0, &wanted(160, Source::Sensor));
    device.poll_sensor(&mut sensor, 2);
    sensor.0.clear();
    let mut next = Host::new(2, 0);
    next.report(&mut device, 3);
    device.poll_sensor(&mut sensor, 3);
    assert_eq!(sensor.0, [Order::Stop]);
}

#[test]
fn bins_that_are_not_the_sensors_are_refused() {
    let mut pixels = Pixels::new();
    let mut device = Sidecar::new(&mut pixels, Some(Told::default().about()));
    let mut host = Host::new(1, 0);
    // A sixteenth of 160 ps to either side.
    for (bin_width, taken) in [(149, false), (150, true), (170, true), (171, false)] {
        let wanted = Configuration {
            bin_width_ps: U16F16::from_num(bin_width),
            source: Source::Sensor,
            ..CONFIGURATION
        };
        let answer = host.answer(&mut device, 0, message::CONFIGURE, &wanted.to_le_bytes());
        let expected = if taken {
            vec![]
        } else {
            vec![Refusal::BinWidth as u8]
        };
        assert_eq!(answer, expected, "{bin_width} ps");
        // Photons of the link have the bins of whoever sends them.
        let wanted = Configuration {
            source: Source::Link,
            ..wanted
        };
        host.configure(&mut device, 0, &wanted);
    }
}

#[test]
fn the_host_is_told_what_the_sensor_is() {
    let told = Told::default().about();
    let told_record = SensorRecord {
        pixels: told.pixels,
        bin_width: told.bin_width,
        offset: told.offset,
    };
    let mut pixels = Pixels::new();
    let mut host = Host::new(1, 0);
    let mut device = Sidecar::new(&mut pixels, Some(told));
    let body = host.answer(&mut device, 0, message::SENSOR_REQUEST, &[]);
    assert_eq!(body, [3, 0, 0, 0, 160, 0, 0, 0, 0, 0]);
    assert_eq!(SensorRecord::from_le_bytes(&body), Some(Some(told_record)));

    let mut pixels = Pixels::new();
    let mut host = Host::new(1, 0);
    let mut device = Sidecar::new(&mut pixels, None);
    let body = host.answer(&mut device, 0, message::SENSOR_REQUEST, &[]);
    assert_eq!(SensorRecord::from_le_bytes(&body), Some(None));
    assert_eq!(SensorRecord::from_le_bytes(&body[1..]), None);
}

/// A sensor that gives the first photon of a laser cycle only.
struct OneHit<'a, S>(&'a mut S);

impl<S: Sensor> Sensor for OneHit<'_, S> {
    type Error = S::Error;

    fn about(&self) -> About {
        self.0.about()
    }

    fn is_one_hit(&self) -> bool {
        true
    }

    fn start(&mut self, bin_width: U16F16) {
        self.0.start(bin_width);
    }

    fn stop(&mut self) {
        self.0.stop();
    }

    fn poll(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, S::Error> {
        self.0.poll(now_ms, sink)
    }
}

#[test]
fn events_of_a_sensor_that_gives_one_photon_a_laser_cycle_say_so_at_high_rates() {
    for is_one_hit in [false, true] {
        // A photon in 20 of 24 laser cycles, then in 11 of 24.
        let call = |cycle: u64| {
            let is_dark = if cycle < 24 { cycle < 4 } else { cycle < 37 };
            let mut calls = vec![Call::Photon(0, 40), Call::End(1)];
            calls.drain(..usize::from(is_dark));
            calls
        };
        let mut script = Scripted((0..48).map(call).map(Some));
        let mut pixels = Pixels::new();
        let mut device = Sidecar::new(&mut pixels, Some(About::new(256)));
        let mut host = Host::new(1, 0);
        host.configure(&mut device, 0, &CONFIGURATION);
        for now_ms in 0..100 {
            if is_one_hit {
                device.poll_sensor(&mut OneHit(&mut script), now_ms);
            } else {
                device.poll_sensor(&mut script, now_ms);
            }
            host.exchange(&mut device, now_ms);
            host.read(4);
        }
        let flags: Vec<Flags> = host.events.iter().map(|event| event.flags).collect();
        let first = if is_one_hit {
            Flags::PILE_UP
        } else {
            Flags::NONE
        };
        assert_eq!(flags, [first, Flags::NONE]);
    }
}
