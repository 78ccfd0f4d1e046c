//! `dtof monitor` on the firmware's sidecar with a simulated sensor, behind a TCP
//! port of this computer.

use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::{Duration, Instant};

use crate::common::port;
use crate::common::sensed::Photons;
use crate::common::{Scratch, assert_contains, names};
use crate::device::{Closing, client, listen, serve, settings};
use anyhow::Result;
use dtof_core::events::{DynamicDepthPixel, Reference};
use dtof_core::fixed::types::{U16F16, U24F8};
use dtof_core::{Array, DepthEvent, PixelAddress};
use dtof_data::events::{aer_file, events_csv};
use dtof_device::monitor::{Outputs, monitor};
use dtof_device::{Client, HostTimeout, Task};
use dtof_engine::host::host_engine;
use dtof_engine::settings::{Settings, SettingsFile};
use dtof_firmware::sidecar::Sidecar;
use dtof_link::DynamicDepth;
use dtof_sensors::dither::Dither;
use dtof_sensors::simulated::Simulated;
use dtof_sensors::{PhotonSink, Polled, Sensor, SensorFault, SensorInfo};

const PIXELS: u16 = 4;
/// Longer than any test.
pub const LONG: Duration = Duration::from_secs(60);

/// Four pixels, slow enough that no pause of this computer delays a decision.
fn sensor() -> Simulated<'static> {
    port::sensor(PIXELS, 20, 500)
}

/// A sensor, if there is one on the bus, and whether it has been polled.
struct Noted {
    sensor: Option<Simulated<'static>>,
    asked: bool,
}

impl Sensor for Noted {
    type Error = SensorFault;

    fn info(&self) -> SensorInfo {
        let sensor = self.sensor.as_ref();
        sensor.map_or(SensorInfo::new(PIXELS), Simulated::info)
    }

    fn start(&mut self, bin_width: U16F16, dither: Dither) {
        self.sensor
            .iter_mut()
            .for_each(|sensor| sensor.start(bin_width, dither));
    }

    fn stop(&mut self) {}

    fn poll(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, SensorFault> {
        self.asked = true;
        let sensor = self.sensor.as_mut().ok_or(SensorFault::NoAnswer)?;
        let Ok(polled) = sensor.poll(now_ms, sink);
        Ok(polled)
    }
}

/// A device that hangs up after `lives`.
pub fn device(has_sensor: bool, lives: Duration) -> String {
    device_of(Some(sensor()), has_sensor, lives).0
}

/// A device with this sensor, and whether it stops polling the sensor when the host is gone.
fn device_of(
    sensor: Option<Simulated<'static>>,
    has_sensor: bool,
    lives: Duration,
) -> (String, Receiver<bool>) {
    let (sender, rests) = mpsc::channel();
    let mut sensor = Noted {
        sensor,
        asked: false,
    };
    let name = listen(move |stream| {
        let mut pixels = heapless::Vec::<_, { PIXELS as usize }>::new();
        let mut blocks = heapless::Vec::<_, 1>::new();
        let info = has_sensor.then(|| sensor.info());
        let mut sidecar = Sidecar::new(&mut pixels, &mut blocks, info);
        let poll = |sidecar: &mut Sidecar<'_>, now| {
            sensor.asked = false;
            sidecar.poll_sensor(&mut sensor, now);
        };
        if let Ok(false) = serve(stream, &mut sidecar, lives, poll) {
            let _ = sender.send(!sensor.asked);
        }
        false
    });
    (name, rests)
}

/// The events of the first 5,000 laser cycles.
fn reference_events() -> Vec<DepthEvent> {
    let addresses: Vec<_> = (0..PIXELS).map(PixelAddress::new).collect();
    let mut photons = Photons::new(PIXELS);
    sensor().laser_cycles(5_000, &mut photons);
    let mut engine = host_engine(&settings(), Array::new(4, 1).unwrap(), &addresses).unwrap();
    engine.run(&photons.slice(0)).unwrap()
}

/// The same as CSV.
pub fn reference() -> String {
    let mut csv = Vec::new();
    let ranges = settings().ranges(Array::new(4, 1).unwrap()).unwrap();
    writeln!(csv, "{}", events_csv::HEADER).unwrap();
    for event in &reference_events() {
        events_csv::write(&mut csv, event, &ranges).unwrap();
    }
    String::from_utf8(csv).unwrap()
}

/// Events and statistics of a device for some time, without a picture, and the result.
fn watched(
    client: &mut Client,
    dynamic_depth: Option<DynamicDepth>,
    length: Duration,
) -> (String, String, Result<()>) {
    let (mut events, mut statistics) = (Vec::new(), Vec::new());
    let ended = watch(client, dynamic_depth, length, &mut events, &mut statistics);
    let [events, statistics] = [events, statistics].map(|text| String::from_utf8(text).unwrap());
    (events, statistics, ended)
}

fn watch(
    client: &mut Client,
    dynamic_depth: Option<DynamicDepth>,
    length: Duration,
    events: &mut dyn Write,
    statistics: &mut dyn Write,
) -> Result<()> {
    watch_with(
        &settings(),
        client,
        dynamic_depth,
        length,
        [events, statistics],
    )
}

pub fn watch_with(
    settings: &Settings,
    client: &mut Client,
    dynamic_depth: Option<DynamicDepth>,
    length: Duration,
    [events, statistics]: [&mut dyn Write; 2],
) -> Result<()> {
    let task = Task {
        settings,
        pixels: PIXELS,
        columns: 2,
        dynamic_depth,
        host_timeout: HostTimeout::default(),
    };
    let mut outputs = Outputs {
        events,
        statistics,
        recording: None,
        masked: 0,
    };
    monitor(client, &task, |elapsed| elapsed >= length, &mut outputs)
}

#[test]
fn events_come_out_as_the_pixels_report_them_and_statistics_once_a_second() {
    let mut client = client(&device(true, LONG));
    let started = Instant::now();
    let (events, statistics, ended) = watched(&mut client, None, Duration::from_millis(3_800));
    ended.unwrap();
    assert!((3.8..8.0).contains(&started.elapsed().as_secs_f64()));
    assert!(events.lines().count() > 50, "{events}");
    assert!(reference().starts_with(&events), "{events}");
    let lines = statistics.lines().count();
    assert!((3..=4).contains(&lines), "{statistics}");
    for line in statistics.lines() {
        let rates = line.strip_prefix("events/s ").unwrap();
        let rate: u32 = rates.split(',').next().unwrap().parse().unwrap();
        assert!(rate > 0 && line.contains("photons/s "), "{line}");
        // A pause of this computer may repeat a message, but nothing else.
        let repeats =
            |loss: &str| loss.starts_with("retransmissions ") || loss.starts_with("duplicates ");
        assert!(line.split(", ").skip(2).all(repeats), "{line}");
    }
    // The sensor is off.
    thread::sleep(Duration::from_millis(100));
    assert_eq!(client.report().unwrap().cycles, 0);
}

#[test]
fn a_sensor_that_does_not_answer_is_named() {
    let (name, _rests) = device_of(None, true, LONG);
    let (_, statistics, ended) = watched(&mut client(&name), None, Duration::from_secs(1));
    ended.unwrap();
    let line = statistics.lines().next().unwrap();
    assert!(line.starts_with("events/s 0, photons/s 0, "), "{line}");
    assert_contains(line, ", sensor errors ");
    assert!(line.ends_with(" (last: no answer)"), "{line}");
}

#[test]
fn losses_shortly_before_the_end_are_reported() {
    let (name, _rests) = device_of(None, true, LONG);
    let (_, statistics, ended) = watched(&mut client(&name), None, Duration::from_millis(300));
    ended.unwrap();
    assert_eq!(statistics.lines().count(), 1);
    assert_contains(&statistics, ", sensor errors ");
}

#[test]
fn a_reader_that_has_seen_enough_ends_it() {
    for (events, statistics) in [(10, 10_000), (500, 10_000), (100_000, 10)] {
        let mut client = client(&device(true, LONG));
        let (mut events, mut statistics) = (Closing(events), Closing(statistics));
        watch(
            &mut client,
            None,
            Duration::MAX,
            &mut events,
            &mut statistics,
        )
        .unwrap();
    }
}

#[test]
fn a_device_that_goes_or_has_no_sensor_is_an_error() {
    let mut gone = client(&device(true, Duration::from_millis(700)));
    let (events, _, error) = watched(&mut gone, None, Duration::MAX);
    assert_contains(&format!("{:#}", error.unwrap_err()), "the device cannot be");
    // Earlier events are there.
    assert!(events.len() > 200);

    let mut without = client(&device(false, LONG));
    let (.., error) = watched(&mut without, None, Duration::MAX);
    assert_contains(
        &format!("{:#}", error.unwrap_err()),
        "the device has no sensor",
    );
}

#[test]
fn changes_of_depth_are_those_of_the_events() {
    let threshold_mm = U24F8::lit("5");
    let dynamic_depth = DynamicDepth {
        threshold_mm,
        reference: Reference::Reported,
    };
    let name = device(true, LONG);
    let (events, _, ended) = watched(
        &mut client(&name),
        Some(dynamic_depth),
        Duration::from_secs(2),
    );
    ended.unwrap();
    let ranges = settings().ranges(Array::new(4, 1).unwrap()).unwrap();
    let config = dynamic_depth.config(ranges.scale()).unwrap();
    let mut pixels = [const { DynamicDepthPixel::<{ DynamicDepth::MEAN_OF }>::new() }; 4];
    let mut csv = Vec::new();
    writeln!(csv, "{}", events_csv::DYNAMIC_DEPTH_HEADER).unwrap();
    for event in reference_events() {
        if let Some(change) = pixels[usize::from(event.pixel.raw())].observe(&config, &event) {
            events_csv::write_dynamic_depth(&mut csv, &change, &ranges).unwrap();
        }
    }
    assert!(events.lines().count() > 5);
    assert!(csv.starts_with(events.as_bytes()), "{events}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_stops_the_sensor() {
    let scratch = Scratch::new();
    for signal in ["-INT", "-TERM"] {
        let (name, rests) = device_of(Some(sensor()), true, LONG);
        let mut monitor = scratch.command(&format!("monitor --pixels 4 --device {name}"));
        let mut monitor = monitor.stdout(Stdio::piped()).spawn().unwrap();
        let mut events = BufReader::new(monitor.stdout.take().unwrap()).lines();
        for _ in 0..10 {
            events.next().unwrap().unwrap();
        }
        let id = monitor.id().to_string();
        let sent = Command::new("kill").args([signal, &id]).status().unwrap();
        assert!(sent.success());
        // Earlier output is complete.
        for row in events {
            assert_eq!(row.unwrap().split(',').count(), 11);
        }
        assert!(monitor.wait().unwrap().success());
        assert!(rests.recv_timeout(LONG).unwrap());
    }
}

#[test]
fn what_is_recorded_is_what_is_printed_also_when_the_device_is_gone() {
    let scratch = Scratch::new();
    for (lives, seconds, whole) in [(60_000, "1", true), (1_000, "30", false)] {
        let name = device(true, Duration::from_millis(lives));
        let line = format!("monitor --pixels 4 --columns 2 --device {name} --seconds {seconds}");
        let output = scratch.run(&format!("{line} --record events.aer"));
        assert_eq!(output.status.success(), whole, "{output:?}");
        let decoded = scratch.printed("decode events.aer");
        assert!(decoded.as_bytes() == output.stdout && decoded.len() > 500);
        let recorded = aer_file::open(&scratch.path("events.aer")).unwrap();
        let settings = SettingsFile::parse(recorded.settings()).unwrap();
        assert_eq!(
            (settings.sensor.bins, settings.sensor.columns),
            (Some(128), Some(2))
        );
        assert_eq!(settings.detection.l1, Some(40));
    }
    assert_eq!(names(&scratch.path("")), ["events.aer"]);
}

#[test]
fn a_device_that_refuses_leaves_an_older_recording_as_it_is() {
    let scratch = Scratch::new();
    scratch.file("events.aer", "older");
    let name = device(false, LONG);
    let output = scratch.run(&format!("monitor --device {name} --record events.aer"));
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert_eq!(scratch.read("events.aer"), "older");
    assert_eq!(names(&scratch.path("")), ["events.aer"]);
}

#[test]
fn the_command_prints_rows_and_says_when_the_device_is_gone() {
    let run = |lives, seconds| {
        let name = device(true, Duration::from_millis(lives));
        let line = format!("monitor --device {name} --pixels {PIXELS} --seconds {seconds}");
        Scratch::new().run(&line)
    };
    let output = run(60_000, "1");
    assert!(output.status.success(), "{output:?}");
    let events = String::from_utf8(output.stdout).unwrap();
    assert!(events.lines().count() > 10 && reference().starts_with(&events));
    assert!(output.stderr.starts_with(b"events/s "));

    let output = run(700, "60");
    assert_eq!(output.status.code(), Some(1));
    let error = String::from_utf8(output.stderr).unwrap();
    assert_contains(&error, "error: tcp:127.0.0.1:");
    assert!(output.stdout.len() > 200);
}
