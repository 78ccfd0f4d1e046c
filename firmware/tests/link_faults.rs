//! A host and a device with a bad wire between them: over ten thousand faults,
//! every event arrives once, in order and as it was.

mod common;

use std::collections::VecDeque;

use common::host::{CONFIGURATION, Host, deliver, device};
use common::script;
use dtof_core::DepthEvent;
use dtof_firmware::sidecar::Sidecar;
use dtof_link::endpoint::{BODY_BYTES, Endpoint, LinkCounters};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::message::{self, greeting};
use dtof_link::{Configuration, Report, Source};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

const PIXELS: usize = 8;
/// One direction of the wire.
struct Wire {
    bytes: VecDeque<u8>,
    /// One fault in so many bytes; none if 0.
    one_in: u32,
    pulled_until: u32,
    faults: u32,
}

impl Wire {
    fn new(one_in: u32) -> Self {
        Self {
            bytes: VecDeque::new(),
            one_in,
            pulled_until: 0,
            faults: 0,
        }
    }

    fn carry(&mut self, bytes: &[u8], now: u32, rng: &mut Pcg32) {
        for &byte in bytes {
            if now < self.pulled_until {
                continue;
            }
            if self.one_in == 0 || !rng.next_u32().is_multiple_of(self.one_in) {
                self.bytes.push_back(byte);
                continue;
            }
            self.faults += 1;
            match rng.next_u32() % 100 {
                0..30 => self.bytes.push_back(byte ^ (1 << (rng.next_u32() % 8))),
                30..60 => {}
                60..80 => self.bytes.extend([byte, byte]),
                80..99 => {
                    let before = self.bytes.pop_back();
                    self.bytes.push_back(byte);
                    self.bytes.extend(before);
                }
                _ => self.pulled_until = now + 1000,
            }
        }
    }
}

/// What the host sends, and what it should get.
struct Script {
    messages: Vec<Vec<u8>>,
    events: Vec<DepthEvent>,
    photons: u64,
}

fn script(cycles: usize, rng: &mut Pcg32) -> Script {
    let calls = script::script(cycles, rng);
    Script {
        messages: script::messages(&calls),
        events: script::reference(&calls, &script::config(&CONFIGURATION)),
        photons: script::photons(&calls),
    }
}

/// What came of a session.
struct Outcome {
    events: Vec<DepthEvent>,
    /// None if the session did not get so far.
    report: Option<Report>,
    is_lost: bool,
    host: LinkCounters,
    device: LinkCounters,
    faults: u32,
    milliseconds: u32,
}

/// How a session goes.
struct Line<'a> {
    /// One fault in so many bytes; none if 0.
    one_in: u32,
    /// The host takes messages in one of so many milliseconds.
    reads_one_in: u32,
    milliseconds: u32,
    rng: &'a mut Pcg32,
}

/// A good wire for as long as it takes.
fn good(rng: &mut Pcg32) -> Line<'_> {
    Line {
        one_in: 0,
        reads_one_in: 1,
        milliseconds: 10_000_000,
        rng,
    }
}

/// Runs a session until the host has its statistics and knows that everything has
/// arrived, or the device has forgotten the session, or its time is over.
fn session(device: &mut Sidecar, number: u16, script: &Script, line: &mut Line) -> Outcome {
    let mut host = Host::new(number, 0);
    let (mut up, mut down) = (Wire::new(line.one_in), Wire::new(line.one_in));
    let mut frames = Deframer::new();
    let mut wire = [0; WIRE_BYTES];
    let wanted = Configuration {
        source: Source::Link,
        ..CONFIGURATION
    };
    let configuration = wanted.to_le_bytes();
    let photons = script.messages.iter();
    let photons = photons.map(|body| (message::PHOTONS, &body[..]));
    let mut to_send: VecDeque<(u8, &[u8])> = [(message::CONFIGURE, &configuration[..])]
        .into_iter()
        .chain(photons)
        .chain([
            (message::SYNCHRONISE, &b"done"[..]),
            (message::STATISTICS_REQUEST, &[]),
        ])
        .collect();
    let (mut now, mut report) = (0, None);
    while now < line.milliseconds && !host.endpoint.is_lost() {
        while host.endpoint.is_open() && host.endpoint.has_room() {
            let Some((kind, body)) = to_send.pop_front() else {
                break;
            };
            host.ask(kind, body);
        }
        while let length @ 1.. = host.endpoint.transmit(now, &mut wire) {
            down.carry(&wire[..length], now, line.rng);
        }
        deliver(&mut frames, &down.bytes, |frame| {
            device.receive(frame, now);
        });
        down.bytes.clear();
        device.work(0);
        while let length @ 1.. = device.transmit(now, &mut wire) {
            up.carry(&wire[..length], now, line.rng);
        }
        host.hear(&up.bytes, now);
        up.bytes.clear();
        if now.is_multiple_of(line.reads_one_in) {
            host.read(usize::MAX);
            if let [.., (message::STATISTICS, body, _)] = &host.answers[..]
                && host.endpoint.is_settled()
            {
                let kinds: Vec<u8> = host.answers.iter().map(|&(kind, ..)| kind).collect();
                let before = [message::CONFIGURED, message::SYNCHRONISED];
                assert_eq!(kinds[..kinds.len() - 1], before);
                report = Report::from_le_bytes(body);
                break;
            }
        }
        now += 1;
    }
    assert!(host.changes.is_empty());
    Outcome {
        report,
        is_lost: host.endpoint.is_lost(),
        host: *host.endpoint.counters(),
        device: *device.endpoint().counters(),
        events: host.events,
        faults: up.faults + down.faults,
        milliseconds: now,
    }
}

#[track_caller]
fn check(script: &Script, outcome: &Outcome) {
    let Outcome { host, device, .. } = outcome;
    let Some(report) = outcome.report else {
        panic!("out of step: {host:?} {device:?}");
    };
    let (got, wanted) = (outcome.events.len(), script.events.len());
    assert!(outcome.events == script.events, "{got} of {wanted} events");
    let statistics = report.statistics;
    assert_eq!(statistics.photons(), script.photons);
    assert!(statistics.rejected > 0 && !outcome.is_lost);
    assert_eq!(statistics.events, script.events.len() as u64);
    assert_eq!(statistics.deferred, 0);
}

/// A device that was just switched on, and a script of so many laser cycles.
fn run(seed: u64, cycles: usize, change: impl FnOnce(&mut Line<'_>)) -> Outcome {
    let mut rng = Pcg32::seed_from_u64(seed);
    let script = script(cycles, &mut rng);
    let mut line = good(&mut rng);
    change(&mut line);
    let outcome = session(&mut device::<PIXELS>(None), 7, &script, &mut line);
    check(&script, &outcome);
    outcome
}

#[test]
fn a_good_wire_needs_no_repetition() {
    let outcome = run(1, 5_000, |_| {});
    for end in [outcome.host, outcome.device] {
        let expected = LinkCounters {
            frames: end.frames,
            ..LinkCounters::default()
        };
        assert_eq!(end, expected);
    }
}

#[test]
fn a_slow_reader_changes_no_event() {
    let outcome = run(2, 2_000, |line| line.reads_one_in = 500);
    println!("slow reader: {} ms", outcome.milliseconds);
}

#[test]
fn ten_thousand_faults_change_no_event_and_are_counted() {
    let mut faults = 0;
    for (seed, one_in) in (3..).zip([5_000, 1_000, 400].into_iter().cycle()) {
        if faults >= 10_000 {
            break;
        }
        let outcome = run(seed, 4_000, |line| line.one_in = one_in);
        let Outcome { host, device, .. } = outcome;
        println!(
            "{} faults in {} ms: host {host:?} device {device:?}",
            outcome.faults, outcome.milliseconds
        );
        assert!(host.corrupt + device.corrupt > 0);
        assert!(host.retransmitted + device.retransmitted > 0);
        faults += outcome.faults;
    }
    println!("{faults} faults");
}

/// Gone in the middle of it, with messages on their way.
fn interrupted(device: &mut Sidecar<'_>, number: u16, script: &Script, rng: &mut Pcg32) {
    let mut line = Line {
        milliseconds: 20,
        ..good(rng)
    };
    let outcome = session(device, number, script, &mut line);
    assert!(outcome.report.is_none() && outcome.events.len() < script.events.len());
    assert!(!outcome.events.is_empty() && script.events.starts_with(&outcome.events));
}

#[test]
fn a_host_that_restarts_begins_anew_and_gets_every_event() {
    let mut rng = Pcg32::seed_from_u64(4);
    let script = script(2_000, &mut rng);
    let mut device = device::<PIXELS>(None);
    for number in 1..20 {
        interrupted(&mut device, number, &script, &mut rng);
    }
    let outcome = session(&mut device, 20, &script, &mut good(&mut rng));
    check(&script, &outcome);
}

#[test]
fn the_same_session_number_drawn_again_begins_anew() {
    let mut rng = Pcg32::seed_from_u64(6);
    let script = script(2_000, &mut rng);
    let mut device = device::<PIXELS>(None);
    interrupted(&mut device, 7, &script, &mut rng);
    let outcome = session(&mut device, 7, &script, &mut good(&mut rng));
    check(&script, &outcome);
}

#[test]
fn a_device_that_restarts_is_noticed_and_serves_the_next_session() {
    let mut rng = Pcg32::seed_from_u64(5);
    let script = script(2_000, &mut rng);
    // A session of the device's earlier life, which another stands for.
    let [mut device, mut earlier] = [(); 2].map(|()| device::<PIXELS>(None));
    let mut host = Host::new(1, 0);
    host.exchange(&mut earlier, 0);
    assert!(host.endpoint.is_open() && !host.endpoint.is_lost());
    host.ask(message::STATISTICS_REQUEST, &[]);
    host.exchange(&mut device, 0);
    assert!(host.endpoint.is_lost());
    assert_eq!(device.endpoint().counters().foreign, 1);
    let outcome = session(&mut device, 2, &script, &mut good(&mut rng));
    check(&script, &outcome);
}

/// Milliseconds until a hundred messages have crossed a line of so many bytes a
/// second that has stood still for a quarter of a second.
fn slow_line(bytes_a_second: usize) -> u32 {
    let mut host = Endpoint::host(1, greeting(0, 0), 0);
    let mut device = Endpoint::device(greeting(128, 8));
    let (mut up, mut down) = (Deframer::new(), Deframer::new());
    let mut line: VecDeque<u8> = VecDeque::new();
    let mut wire = [0; WIRE_BYTES];
    let mut arrived = 0;
    let mut credit = 0;
    for now in 0..1_000_000 {
        while host.is_open() && host.offer(message::PHOTONS, &[1; BODY_BYTES]).is_ok() {}
        // What the line has not carried waits in front of it, unseen.
        while let length @ 1.. = host.transmit(now, &mut wire) {
            line.extend(&wire[..length]);
        }
        if !(5_000..5_250).contains(&now) {
            credit += bytes_a_second;
        }
        while credit >= 1000 {
            credit -= 1000;
            deliver(&mut down, line.pop_front().as_ref(), |frame| {
                device.receive(frame, now);
            });
        }
        while device.take().is_some() {
            arrived += u32::from(now > 10_000);
        }
        let length = device.transmit(now, &mut wire);
        deliver(&mut up, &wire[..length], |frame| host.receive(frame, now));
        if arrived >= 100 {
            return now - 10_000;
        }
    }
    panic!("{bytes_a_second} bytes a second: {arrived} messages");
}

#[test]
fn a_slow_line_is_not_filled_with_repetitions() {
    for bytes_a_second in [5_000, 7_000, 9_000, 11_000, 20_000] {
        // 256 bytes a message; as long again is allowed for what is repeated.
        let ideal = 100 * 256 * 1000 / bytes_a_second;
        let took = slow_line(bytes_a_second);
        println!("{bytes_a_second} B/s: {took} ms for 100 messages, {ideal} ms at best");
        assert!(
            took as usize <= ideal * 2,
            "{bytes_a_second} B/s: {took} ms"
        );
    }
}
