//! `dtof monitor --record` on a device that plays a part: events at awkward moments, and
//! readers that have seen enough.

use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::common::aer::{HEADER, depth_event};
use crate::common::assert_contains;
use crate::device::{Closing, settings};
use dtof_core::{AER_VERSION, AerEncoder};
use dtof_data::events::aer_file::{Event, Header, Reader};
use dtof_data::events::events_csv;
use dtof_device::monitor::{EventFile, Outputs, array, monitor};
use dtof_device::{Client, HostTimeout, Port, Task};
use dtof_link::endpoint::Endpoint;
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::message::{LINK_VERSION, greeting};
use dtof_link::{Configuration, Report, Source, message};

const PIXELS: u16 = 4;

/// A device that sends an event of `pixel` with each report, and one of pixel 0 when it is told to
/// stop. After `lives` events it is gone.
struct Device {
    endpoint: Endpoint,
    deframer: Deframer,
    encoder: AerEncoder,
    pixel: u16,
    lives: u64,
    answers: VecDeque<(u8, Vec<u8>)>,
    now_ms: u32,
    sent: Arc<Mutex<Vec<Event>>>,
}

impl Device {
    fn event(&mut self, pixel: u16) {
        let cycle = self.sent.lock().unwrap().len() as u64;
        let event = depth_event(pixel, 100 * cycle, 20);
        let (time, word) = self.encoder.encode(&event);
        let words = time.into_iter().chain([word]);
        let body: Vec<u8> = words.flat_map(|word| word.to_le_bytes()).collect();
        self.answers.push_back((message::EVENTS, body));
        self.sent.lock().unwrap().push(Event::Depth(event));
    }

    fn answer(&mut self, kind: u8, body: &[u8]) {
        let answer = match kind {
            message::CONFIGURE => {
                if Configuration::from_le_bytes(body).unwrap().source == Source::Link {
                    self.event(0);
                }
                (message::CONFIGURED, Vec::new())
            }
            message::STATISTICS_REQUEST => {
                self.event(self.pixel);
                let report = Report::default().to_le_bytes();
                (message::STATISTICS, report.to_vec())
            }
            kind => panic!("message {kind:#04x}"),
        };
        self.answers.push_back(answer);
    }
}

impl Port for Device {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        for &byte in bytes {
            if let Some(frame) = self.deframer.push(byte) {
                self.endpoint.receive(frame, self.now_ms);
            }
        }
        while let Some(message) = self.endpoint.take() {
            self.answer(message.kind, &message.body);
        }
        Ok(())
    }

    fn receive(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.now_ms += 1;
        std::thread::sleep(Duration::from_millis(1));
        let gone = self.sent.lock().unwrap().len() as u64 >= self.lives;
        while let Some((kind, body)) = self.answers.front() {
            // Its last message is an event.
            if gone && *kind != message::EVENTS || self.endpoint.offer(*kind, body).is_err() {
                break;
            }
            self.answers.pop_front();
        }
        let mut length = 0;
        let mut wire = [0; WIRE_BYTES];
        loop {
            let more = self.endpoint.transmit(self.now_ms, &mut wire);
            if more == 0 {
                break;
            }
            bytes[length..length + more].copy_from_slice(&wire[..more]);
            length += more;
        }
        match (gone, length) {
            (true, 0) => Err(ErrorKind::UnexpectedEof.into()),
            _ => Ok(length),
        }
    }
}

/// The events the device sent, the recording, and the error.
struct Monitored {
    sent: Vec<Event>,
    recorded: Vec<Event>,
    statistics: String,
    error: Option<String>,
}

/// A device of these versions that sends events from `pixel`.
fn device(versions: [u16; 2], pixel: u16, lives: u64) -> Device {
    let mut greeting = greeting(128, PIXELS);
    for (place, version) in greeting.chunks_exact_mut(2).zip(versions) {
        place.copy_from_slice(&version.to_le_bytes());
    }
    Device {
        endpoint: Endpoint::device(greeting),
        deframer: Deframer::new(),
        encoder: AerEncoder::new(),
        pixel,
        lives,
        answers: VecDeque::new(),
        now_ms: 0,
        sent: Arc::default(),
    }
}

fn monitored(pixel: u16, lives: u64, seconds: u64, events: usize) -> Monitored {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("events.aer");
    let array = array(PIXELS, None).unwrap();
    let header = Header { array, ..HEADER };
    let device = device([LINK_VERSION, AER_VERSION], pixel, lives);
    let sent = Arc::clone(&device.sent);
    let mut client = Client::new(Box::new(device)).unwrap();
    let mut recording = EventFile::new(&path, &[], &header, "").unwrap();
    let mut statistics = Vec::new();
    let task = Task {
        settings: &settings(),
        pixels: PIXELS,
        columns: 2,
        dynamic_depth: None,
        host_timeout: HostTimeout::default(),
    };
    let ended = monitor(
        &mut client,
        &task,
        |elapsed| elapsed >= Duration::from_secs(seconds),
        &mut Outputs {
            events: &mut Closing(events),
            statistics: &mut statistics,
            recording: Some(&mut recording),
            masked: 0,
        },
    );
    recording.finish().unwrap();
    Monitored {
        sent: std::mem::take(&mut sent.lock().unwrap()),
        recorded: recorded(&path),
        statistics: String::from_utf8(statistics).unwrap(),
        error: ended.err().map(|error| format!("{error:#}")),
    }
}

pub fn recorded(path: &Path) -> Vec<Event> {
    let file = std::fs::File::open(path).unwrap();
    let mut reader = Reader::new(io::BufReader::new(file)).unwrap();
    std::iter::from_fn(|| reader.next_event().unwrap()).collect()
}

#[test]
fn what_is_sent_is_recorded_also_when_nobody_reads_and_while_the_device_stops() {
    // Room for nothing, for the column names only, for everything.
    for room in [0, 100, 100_000] {
        let run = monitored(3, u64::MAX, 2, room);
        assert_eq!(run.error, None);
        assert!(run.sent.len() >= 3, "at first, after a second, at the end");
        assert_eq!(run.recorded, run.sent);
        // Each has a line of statistics, except the first, from which the others count, and the last.
        let lines = run.statistics.lines();
        assert!(lines.clone().all(|line| line.starts_with("events/s ")));
        assert_eq!(lines.count(), run.sent.len() - 2, "{}", run.statistics);
    }
}

#[test]
fn what_was_sent_before_the_device_is_gone_is_recorded() {
    for lives in [1, 2] {
        let run = monitored(3, lives, 30, 100_000);
        assert_contains(&run.error.unwrap(), "the device cannot be read from");
        assert_eq!(run.sent.len() as u64, lives);
        assert_eq!(run.recorded, run.sent);
    }
}

#[test]
fn events_before_the_first_report_have_their_header() {
    let device = device([LINK_VERSION, AER_VERSION], 3, 1);
    let mut client = Client::new(Box::new(device)).unwrap();
    let mut printed = Vec::new();
    let ended = monitor(
        &mut client,
        &Task {
            settings: &settings(),
            pixels: PIXELS,
            columns: 2,
            dynamic_depth: None,
            host_timeout: HostTimeout::default(),
        },
        |_| false,
        &mut Outputs {
            events: &mut printed,
            statistics: &mut io::sink(),
            recording: None,
            masked: 0,
        },
    );
    assert!(ended.is_err());
    let rows = String::from_utf8(printed).unwrap();
    let rows: Vec<&str> = rows.lines().collect();
    assert!(rows.len() == 2 && rows[0] == events_csv::HEADER, "{rows:?}");
}

#[test]
fn a_pixel_the_device_was_not_configured_for_ends_it() {
    let run = monitored(PIXELS, u64::MAX, 30, 100_000);
    let error = run.error.unwrap();
    assert_eq!(
        error,
        "the device sends an event of pixel 4, and has 4 pixels"
    );
    assert_eq!(run.recorded, []);
}

#[test]
fn a_device_of_another_version_is_refused_by_both_versions() {
    for versions in [[5, AER_VERSION], [LINK_VERSION, 2], [5, 3], [7, 5]] {
        let client = Client::new(Box::new(device(versions, 0, 1)));
        let [link, aer] = versions;
        let expected = format!(
            "the device speaks link version {link} and AER version {aer}, \
             this program {LINK_VERSION} and {AER_VERSION}"
        );
        assert_eq!(client.err().expect("refused").to_string(), expected);
    }
}
