//! Four seconds of a device are four seconds in every export. The clock of the device is simulated:
//! each time the host reads, a millisecond passes.

use std::fs;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, UNIX_EPOCH};

use crate::device::settings;
use dtof_core::PixelAddress;
use dtof_core::fixed::types::{U16F16, U24F8};
use dtof_data::events::aer_file::Reader;
use dtof_data::events::clock::LaserClock;
use dtof_device::monitor::{EventFile, Outputs, monitor};
use dtof_device::{Client, HostTimeout, Port, Setup};
use dtof_engine::settings::SettingsFile;
use dtof_firmware::sidecar::Sidecar;
use dtof_link::DynamicDepth;
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_run::export::{Format, Options, export};
use dtof_sensors::dither::Dither;
use dtof_sensors::{PhotonSink, Polled, Sensor, SensorFault, SensorInfo, simulated};

const PIXELS: u16 = 16;
const SECONDS: u32 = 4;
/// When the device was configured, in microseconds.
const START_US: u64 = 1_790_000_000_123_456;

/// A device in this process.
struct Device<S> {
    sidecar: Sidecar<'static>,
    sensor: S,
    deframer: Deframer,
    now_ms: Arc<AtomicU32>,
}

impl<S: Sensor> Device<S> {
    fn new(sensor: S, now_ms: &Arc<AtomicU32>) -> Self {
        let pixels = Box::leak(Box::new(heapless::Vec::<_, { PIXELS as usize }>::new()));
        let blocks = Box::leak(Box::new(heapless::Vec::<_, 1>::new()));
        Self {
            sidecar: Sidecar::new(pixels, blocks, Some(sensor.info())),
            sensor,
            deframer: Deframer::new(),
            now_ms: Arc::clone(now_ms),
        }
    }
}

impl<S: Sensor + Send> Port for Device<S> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let now_ms = self.now_ms.load(Ordering::Relaxed);
        for &byte in bytes {
            if let Some(frame) = self.deframer.push(byte) {
                self.sidecar.receive(frame, now_ms);
            }
        }
        Ok(())
    }

    fn receive(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let now_ms = self.now_ms.fetch_add(1, Ordering::Relaxed) + 1;
        self.sidecar.work(0);
        self.sidecar.poll_sensor(&mut self.sensor, now_ms);
        self.sidecar.work(0);
        let (mut length, mut wire) = (0, [0; WIRE_BYTES]);
        while let more @ 1.. = self.sidecar.transmit(now_ms, &mut wire) {
            bytes[length..length + more].copy_from_slice(&wire[..more]);
            length += more;
        }
        Ok(length)
    }
}

/// Gives a histogram each 100 ms, of as many laser cycles as a TMF8820 integrates.
#[derive(Default)]
struct HistogramSensor {
    last_ms: Option<u32>,
}

impl HistogramSensor {
    const PERIOD_MS: u32 = 100;
    const CYCLES: u32 = 537 * 1024;
}

impl Sensor for HistogramSensor {
    type Error = SensorFault;

    fn info(&self) -> SensorInfo {
        SensorInfo {
            gives_histograms: true,
            laser_millihertz: u64::from(Self::CYCLES) * 1_000_000 / u64::from(Self::PERIOD_MS),
            ..SensorInfo::new(1)
        }
    }

    fn start(&mut self, _: U16F16, _: Dither) {
        self.last_ms = None;
    }

    fn stop(&mut self) {}

    fn poll(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, SensorFault> {
        let last_ms = *self.last_ms.get_or_insert(now_ms);
        if now_ms.wrapping_sub(last_ms) < Self::PERIOD_MS {
            return Ok(Polled::Idle);
        }
        self.last_ms = Some(now_ms);
        // The target moves back and forth, which gives changes of depth.
        let bin = if now_ms % 400 < 200 { 40 } else { 60 };
        let counts = std::array::from_fn(|at| if at == bin { 90_000 } else { 100 });
        sink.begin_frame(Self::CYCLES);
        sink.histogram(PixelAddress::new(0), &counts);
        Ok(Polled::Data)
    }
}

/// Records four seconds.
fn recorded(path: &Path, sensor: impl Sensor + Send + 'static) {
    let now_ms = Arc::new(AtomicU32::new(7));
    let mut client = Client::new(Box::new(Device::new(sensor, &now_ms))).unwrap();
    let mut setup = Setup::of(&mut client, SettingsFile::default(), None).unwrap();
    setup.began = UNIX_EPOCH + Duration::from_micros(START_US);
    setup.settings = settings();
    let mut recording = EventFile::new(path, &[], &setup.header(), "").unwrap();
    // The device's clock is faster than this computer's.
    let host_timeout = HostTimeout::from_milliseconds(60_000).unwrap();
    let task = setup.task(None, host_timeout);
    let end_ms = now_ms.load(Ordering::Relaxed) + 1000 * SECONDS;
    let ended = monitor(
        &mut client,
        &task,
        |_| now_ms.load(Ordering::Relaxed) >= end_ms,
        &mut Outputs {
            events: &mut io::sink(),
            statistics: &mut io::sink(),
            recording: Some(&mut recording),
            masked: 0,
        },
    );
    ended.unwrap();
    recording.finish().unwrap();
}

/// The microseconds of an EVT2 file's last event.
fn last_of_evt2(raw: &[u8]) -> u64 {
    let end = b"% end\n";
    let header = raw.windows(end.len()).position(|part| part == end).unwrap();
    let (mut high, mut last) = (0, None);
    for word in raw[header + end.len()..].as_chunks::<4>().0 {
        let word = u64::from(u32::from_le_bytes(*word));
        match word >> 28 {
            0 | 1 => last = Some(high << 6 | word >> 22 & 0x3f),
            8 => high = word & 0xfff_ffff,
            kind => panic!("kind {kind}"),
        }
    }
    last.unwrap()
}

/// The first and the last log time of a file of point clouds, and the time stamps in their messages.
fn log_times(file: &[u8]) -> [u64; 2] {
    let messages = mcap::MessageStream::new(file).unwrap();
    let times: Vec<u64> = messages.map(|message| message.unwrap().log_time).collect();
    [times[0], *times.last().unwrap()]
}

/// Largest deviation of the end of four seconds of events, in seconds.
fn lasts_four_seconds(sensor: impl Sensor + Send + 'static, within: f64) {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("events.aer");
    recorded(&recording, sensor);
    let reader = Reader::new(fs::File::open(&recording).unwrap()).unwrap();
    assert_eq!(reader.header().start_us, i64::try_from(START_US).unwrap());

    let out = folder.path().join("out");
    let exported = |format, options: &Options| {
        let exported = export(&recording, &out, format, options, &mut ()).unwrap();
        assert!(exported.written > 9, "{format:?}: {}", exported.written);
        let file = fs::read(&out).unwrap();
        // Files of other formats are not replaced.
        fs::remove_file(&out).unwrap();
        (file, exported.warnings)
    };
    let plain = |format| {
        let (file, warnings) = exported(format, &Options::default());
        assert!(warnings.is_empty(), "{warnings:?}");
        file
    };
    let ends_within = |what: &str, seconds: f64, within: f64| {
        let off = seconds - f64::from(SECONDS);
        assert!(off.abs() < within, "{what}: {seconds} s");
    };
    let ends = |what: &str, seconds: f64| ends_within(what, seconds, within);

    let csv = String::from_utf8(plain(Format::Csv)).unwrap();
    let last = csv.lines().last().unwrap().split(',').next().unwrap();
    ends("CSV", last.parse::<f64>().unwrap() / 1e6);

    let ply = plain(Format::Ply);
    let last = ply.last_chunk::<8>().unwrap();
    ends("PLY", f64::from_le_bytes(*last) / 1e9);

    let changes = Options {
        dynamic_depth: DynamicDepth {
            threshold_mm: U24F8::lit("2"),
            ..DynamicDepth::default()
        },
        ..Options::default()
    };
    let (evt2, _) = exported(Format::Evt2, &changes);
    // It has only the changes of depth, each 200 ms.
    ends_within("EVT2", last_of_evt2(&evt2) as f64 / 1e6, within + 0.3);

    for format in [Format::Mcap, Format::Ros2] {
        let [first, last] = log_times(&plain(format));
        let start_ns = START_US * 1000;
        let since = |time: u64| (time - start_ns) as f64 / 1e9;
        ends("MCAP", since(last));
        assert!((0.0..0.2).contains(&since(first)), "{first}");
    }

    // A rate that differs from the file's is used, with a warning.
    let options = Options {
        clock: Some(LaserClock::new(1).unwrap()),
        ..Options::default()
    };
    let (_, warnings) = exported(Format::Csv, &options);
    let warning = &warnings[0];
    assert!(warning.starts_with("the file has a laser of "), "{warning}");
}

#[test]
fn four_seconds_of_photons_are_four_seconds() {
    lasts_four_seconds(simulated::scene(), 0.05);
}

#[test]
fn four_seconds_of_whole_histograms_are_four_seconds() {
    lasts_four_seconds(HistogramSensor::default(), 0.11);
}
