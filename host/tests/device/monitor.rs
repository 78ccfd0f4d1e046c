//! `dtof monitor` on the firmware's sidecar with a simulated sensor, behind a TCP
//! port of this computer.

use std::io::{BufRead, BufReader, Read, Write};
use std::num::NonZeroU16;
use std::process::{Command, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::{Duration, Instant};

use crate::{Closing, listen, serve, settings};
use anyhow::Result;
use dtof::device::monitor::{Outputs, Task, losses, monitor};
use dtof::device::{self, Client};
use dtof::events::events_csv;
use dtof_core::fixed::types::{U0F32, U8F24, U16F16, U24F8};
use dtof_core::{
    AnyRule, AsyncPixel, DepthEvent, DynamicDepthPixel, LaserCycle, PixelAddress, PixelConfig,
    Reference, Statistics,
};
use dtof_firmware::sidecar::Sidecar;
use dtof_link::endpoint::LinkCounters;
use dtof_link::{DynamicDepth, Report};
use dtof_sensors::simulated::{self, Pulse, Simulated, SimulatedPixel};
use dtof_sensors::{About, PhotonSink, Polled, Sensor, SensorFault};

const PIXELS: u16 = 4;
const PULSE: Pulse = Pulse::new(&[U0F32::lit("0.25"), U0F32::lit("0.5")]);

fn scene() -> Vec<SimulatedPixel> {
    let (signal, background) = (U8F24::lit("0.5"), U8F24::lit("0.5"));
    (0..PIXELS)
        .map(|address| {
            let position = 20 + 20 * address;
            SimulatedPixel::new(PixelAddress(address), position, signal, background).unwrap()
        })
        .collect()
}

fn sensor(pixels: &[SimulatedPixel]) -> Simulated<'_> {
    // Slow enough that no hiccup of this computer puts a decision off.
    let settings = simulated::Settings {
        seed: 1,
        bins: 128,
        cycles_per_second: 500,
        cycles_per_poll: NonZeroU16::new(50).unwrap(),
    };
    Simulated::new(pixels, PULSE, settings)
}

/// A sensor, and whether it has been asked.
struct Noted<S> {
    sensor: S,
    asked: bool,
}

impl<S: Sensor> Sensor for Noted<S> {
    type Error = S::Error;

    fn about(&self) -> About {
        self.sensor.about()
    }

    fn start(&mut self, bin_width: U16F16) {
        self.sensor.start(bin_width);
    }

    fn stop(&mut self) {
        self.sensor.stop();
    }

    fn poll(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, S::Error> {
        self.asked = true;
        self.sensor.poll(now_ms, sink)
    }
}

/// A sensor nobody finds on its bus.
struct Unplugged;

impl Sensor for Unplugged {
    type Error = SensorFault;

    fn about(&self) -> About {
        About::new(PIXELS)
    }

    fn start(&mut self, _: U16F16) {}

    fn stop(&mut self) {}

    fn poll(&mut self, _: u32, _: &mut impl PhotonSink) -> Result<Polled, SensorFault> {
        Err(SensorFault::NoAnswer)
    }
}

/// A device that hangs up after `lives`.
fn device(has_sensor: bool, lives: Duration) -> String {
    device_of(sensor(scene().leak()), has_sensor, lives).0
}

/// A device with this sensor, and whether it asks the sensor no more when the host
/// is gone.
fn device_of(
    sensor: impl Sensor + Send + 'static,
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
        let mut sidecar = Sidecar::new(&mut pixels, has_sensor.then(|| sensor.about()));
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

/// Pixels whose link takes every event at once.
struct Pixels {
    config: PixelConfig<128, AnyRule>,
    pixels: Vec<AsyncPixel<128>>,
    cycle: u64,
    events: Vec<DepthEvent>,
}

impl PhotonSink for Pixels {
    fn photon(&mut self, pixel: PixelAddress, code: u16) {
        self.pixels[usize::from(pixel.0)].count(&self.config, code);
    }
    fn end_laser_cycles(&mut self, cycles: u16) {
        for _ in 0..cycles {
            for pixel in &mut self.pixels {
                pixel.end_laser_cycle(&self.config, &mut Statistics::new(), LaserCycle(self.cycle));
                self.events.extend(pixel.acknowledge());
            }
            self.cycle += 1;
        }
    }
    fn histogram(&mut self, _: PixelAddress, _: &[u32; 128]) {
        panic!("a histogram");
    }
}

/// The events of the first `cycles` laser cycles.
fn reference_events(cycles: u64) -> Vec<DepthEvent> {
    let mut reference = Pixels {
        config: settings().config().unwrap(),
        pixels: (0..PIXELS)
            .map(|address| AsyncPixel::new(PixelAddress(address)))
            .collect(),
        cycle: 0,
        events: Vec::new(),
    };
    let scene = scene();
    let mut sensor = sensor(&scene);
    let mut now_ms = 0;
    while reference.cycle < cycles {
        let Ok(_) = sensor.poll(now_ms, &mut reference);
        now_ms += 10;
    }
    reference.events
}

/// The same as CSV.
fn reference(cycles: u64) -> String {
    let mut csv = Vec::new();
    let scale = settings().range_scale().unwrap();
    writeln!(csv, "{}", events_csv::HEADER).unwrap();
    for event in &reference_events(cycles) {
        events_csv::write(&mut csv, event, &scale).unwrap();
    }
    String::from_utf8(csv).unwrap()
}

/// What the device does for so long, without a picture: events, statistics, and how it ended.
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
    let task = Task {
        settings: &settings(),
        pixels: PIXELS,
        dynamic_depth,
    };
    let mut outputs = Outputs {
        events,
        statistics,
        map: None,
        recording: None,
    };
    monitor(client, &task, |elapsed| elapsed >= length, &mut outputs)
}

fn client(name: &str) -> Client {
    Client::new(device::open(name, None).unwrap()).unwrap()
}

#[test]
fn events_come_out_as_the_pixels_report_them_and_statistics_once_a_second() {
    let mut client = client(&device(true, Duration::from_secs(60)));
    let started = Instant::now();
    let (events, statistics, ended) = watched(&mut client, None, Duration::from_millis(3_800));
    ended.unwrap();
    assert!((3.8..8.0).contains(&started.elapsed().as_secs_f64()));
    assert!(events.lines().count() > 50, "{events}");
    assert!(reference(5_000).starts_with(&events), "{events}");
    let lines = statistics.lines().count();
    assert!((3..=4).contains(&lines), "{statistics}");
    for line in statistics.lines() {
        let rates = line.strip_prefix("events/s ").unwrap();
        let rate: u32 = rates.split(',').next().unwrap().parse().unwrap();
        assert!(rate > 0 && line.contains("photons/s "), "{line}");
        // A pause of this computer may repeat a message, but nothing else.
        for loss in line.split(", ").skip(2) {
            assert!(
                loss.starts_with("retransmissions ") || loss.starts_with("duplicates "),
                "{line}"
            );
        }
    }
    // The sensor rests.
    thread::sleep(Duration::from_millis(100));
    assert_eq!(client.report().unwrap().cycles, 0);
}

#[test]
fn every_loss_is_shown_and_only_losses() {
    // A report whose numbers are `number` in one field after the other, little-endian.
    let report = |number: fn(u64) -> u64| {
        let wide = (0..10).flat_map(|at| number(at).to_le_bytes());
        let narrow = (10..20).flat_map(|at| u32::try_from(number(at)).unwrap().to_le_bytes());
        let bytes: Vec<u8> = wide.chain(narrow).chain([1]).collect();
        Report::from_le_bytes(&bytes).unwrap()
    };
    let none = LinkCounters::default();
    assert_eq!(losses(&report(|_| 0), &report(|_| 0), &none), "");
    // The counts of the link and of the sensor began before.
    assert_eq!(
        losses(&report(|at| 101 + at), &report(|_| 100), &none),
        ", saturated 103, rejected 104, gated out 105, unaddressed 110, deferred 107, expired 108, \
         expired and deferred 109, lost bytes 11, corrupt frames 15, oversized frames 16, \
         foreign frames 17, out of order 18, duplicates 19, retransmissions 20, \
         unknown messages 12, sensor errors 13 (last: no answer)"
    );
    // Errors of before are not this one's.
    assert_eq!(losses(&report(|_| 0), &Report::default(), &none), "");

    // Each end sees other frames.
    let here = LinkCounters {
        frames: 1,
        corrupt: 2,
        oversized: 3,
        foreign: 4,
        out_of_order: 5,
        duplicate: 6,
        retransmitted: 7,
    };
    assert_eq!(
        losses(&report(|_| 0), &report(|_| 0), &here),
        ", corrupt frames 2, oversized frames 3, foreign frames 4, out of order 5, duplicates 6, \
         retransmissions 7"
    );
}

#[test]
fn a_sensor_that_does_not_answer_is_named() {
    let (name, _rests) = device_of(Unplugged, true, Duration::from_secs(60));
    let (_, statistics, ended) = watched(&mut client(&name), None, Duration::from_secs(1));
    ended.unwrap();
    let line = statistics.lines().next().unwrap();
    assert!(line.starts_with("events/s 0, photons/s 0, "), "{line}");
    assert!(line.contains(", sensor errors "), "{line}");
    assert!(line.ends_with(" (last: no answer)"), "{line}");
}

#[test]
fn a_reader_that_has_seen_enough_ends_it() {
    for (events, statistics) in [(10, 10_000), (500, 10_000), (100_000, 10)] {
        let mut client = client(&device(true, Duration::from_secs(60)));
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
    let error = format!("{:#}", error.unwrap_err());
    assert!(error.contains("the device cannot be"), "{error}");
    // What came before is there.
    assert!(events.len() > 200);

    let mut without = client(&device(false, Duration::from_secs(60)));
    let (.., error) = watched(&mut without, None, Duration::MAX);
    let error = format!("{:#}", error.unwrap_err());
    assert!(error.contains("the device has no sensor"), "{error}");
}

#[test]
fn changes_of_depth_are_those_of_the_events() {
    let threshold_mm = U24F8::lit("5");
    let wanted = DynamicDepth {
        threshold_mm,
        reference: Reference::Reported,
    };
    let name = device(true, Duration::from_secs(60));
    let (events, _, ended) = watched(&mut client(&name), Some(wanted), Duration::from_secs(2));
    ended.unwrap();
    let scale = settings().range_scale().unwrap();
    let config = wanted.config(&scale).unwrap();
    let mut pixels = [const { DynamicDepthPixel::<{ DynamicDepth::MEAN_OF }>::new() }; 4];
    let mut csv = Vec::new();
    writeln!(csv, "{}", events_csv::DYNAMIC_DEPTH_HEADER).unwrap();
    for event in reference_events(5_000) {
        if let Some(change) = pixels[usize::from(event.pixel.0)].observe(&config, &event) {
            events_csv::write_dynamic_depth(&mut csv, &change, &scale).unwrap();
        }
    }
    assert!(events.lines().count() > 5);
    assert!(csv.starts_with(events.as_bytes()), "{events}");
}

/// `dtof LINE`.
fn dtof(line: &str) -> Command {
    let mut dtof = Command::new(env!("CARGO_BIN_EXE_dtof"));
    dtof.args(line.split(' '));
    dtof
}

#[cfg(unix)]
#[test]
fn ctrl_c_stops_the_sensor() {
    for signal in ["-INT", "-TERM"] {
        let lives = Duration::from_secs(60);
        let (name, rests) = device_of(sensor(scene().leak()), true, lives);
        let mut monitor = dtof(&format!("monitor --pixels 4 --device {name}"))
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut events = BufReader::new(monitor.stdout.take().unwrap()).lines();
        for _ in 0..10 {
            events.next().unwrap().unwrap();
        }
        let id = monitor.id().to_string();
        let sent = Command::new("kill").args([signal, &id]).status().unwrap();
        assert!(sent.success());
        // What comes until then is whole.
        for row in events {
            assert_eq!(row.unwrap().split(',').count(), 9);
        }
        assert!(monitor.wait().unwrap().success());
        assert!(rests.recv_timeout(lives).unwrap());
    }
}

#[test]
fn what_is_recorded_is_what_is_printed_also_when_the_device_is_gone() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("events.aer");
    for (lives, seconds, whole) in [(60_000, "1", true), (1_000, "30", false)] {
        let name = device(true, Duration::from_millis(lives));
        let line = format!("monitor --pixels 4 --columns 2 --device {name} --seconds {seconds}");
        let output = dtof(&line).arg("--record").arg(&file).output().unwrap();
        assert_eq!(output.status.success(), whole, "{output:?}");
        let decoded = dtof("decode").arg(&file).output().unwrap();
        assert!(decoded.status.success(), "{decoded:?}");
        assert!(decoded.stdout == output.stdout && decoded.stdout.len() > 500);
    }
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
    assert_eq!(left.len(), 1);
}

#[test]
fn a_device_that_refuses_leaves_an_older_recording_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("events.aer");
    std::fs::write(&file, b"older").unwrap();
    let name = device(false, Duration::from_secs(60));
    let mut monitor = dtof(&format!("monitor --device {name} --record"));
    let output = monitor.arg(&file).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert_eq!(std::fs::read(&file).unwrap(), b"older");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn the_command_prints_rows_and_says_when_the_device_is_gone() {
    let run = |lives, seconds| {
        let name = device(true, Duration::from_millis(lives));
        let line = format!("monitor --device {name} --pixels {PIXELS} --seconds {seconds}");
        dtof(&line).output().unwrap()
    };
    let output = run(60_000, "1");
    assert!(output.status.success(), "{output:?}");
    let events = String::from_utf8(output.stdout).unwrap();
    assert!(events.lines().count() > 10 && reference(5_000).starts_with(&events));
    assert!(output.stderr.starts_with(b"events/s "));

    let output = run(700, "60");
    assert_eq!(output.status.code(), Some(1));
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(error.contains("error: tcp:127.0.0.1:"), "{error}");
    assert!(output.stdout.len() > 200);
}

#[test]
fn a_map_needs_a_terminal() {
    let mut monitor = dtof("monitor --device tcp:127.0.0.1:1 --map");
    let output = monitor.output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(
        String::from_utf8(output.stderr).unwrap(),
        "error: --map draws on standard error, which is no terminal here\n"
    );
}

/// `script` of util-linux gives the command a terminal. Its shell is replaced by the
/// command: some, interrupted with it, say so whatever the command returns.
#[cfg(target_os = "linux")]
#[test]
fn a_map_is_drawn_on_a_terminal_and_ctrl_c_gives_the_cursor_back() {
    let name = device(true, Duration::from_secs(60));
    let dtof = env!("CARGO_BIN_EXE_dtof");
    let command = format!("exec '{dtof}' monitor --pixels 4 --map --device {name}");
    let mut terminal = Command::new("script")
        .args(["--quiet", "--return", "--flush", "--command"])
        .args([&command, "/dev/null"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut screen = BufReader::new(terminal.stdout.take().unwrap());
    let mut drawn = String::new();
    // Until a second has passed.
    while !drawn.contains("events/s ") {
        assert!(screen.read_line(&mut drawn).unwrap() > 0, "{drawn}");
    }
    // Ctrl-C.
    terminal.stdin.as_mut().unwrap().write_all(b"\x03").unwrap();
    screen.read_to_string(&mut drawn).unwrap();
    let status = terminal.wait().unwrap();
    assert!(status.success(), "{status}: {drawn}");

    assert!(drawn.contains("4 of 4 pixels"), "{drawn}");
    assert!(drawn.contains("\x1b[3A"), "drawn in place: {drawn}");
    assert!(drawn.contains('▀') && !drawn.contains("cycle,pixel"));
    let (_, end) = drawn.rsplit_once("\x1b[?25l").unwrap();
    assert!(end.ends_with("\x1b[?25h"), "{end}");
}
