//! A host and a device with a bad wire between them: over ten thousand faults,
//! every event arrives once, in order and as it was.

use std::collections::VecDeque;

use dtof_core::fixed::types::{I24F8, U8F8, U16F16};
use dtof_core::{
    AerDecoder, AerRecord, AerWord, AnyRule, AsyncPixel, Count, DepthEstimator, DepthEvent,
    LaserCycle, PaperRule, PixelAddress, PixelConfig, Statistics,
};
use dtof_firmware::sidecar::Sidecar;
use dtof_link::endpoint::{BODY_BYTES, Endpoint, LinkCounters};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::message;
use dtof_link::message::greeting;
use dtof_link::{Configuration, Report, Source, Token};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

const PIXELS: u16 = 8;

const CONFIGURATION: Configuration = Configuration {
    rule: AnyRule::Paper(PaperRule::new(U8F8::lit("4"), Count::saturating(5))),
    estimator: DepthEstimator::Centroid3,
    x: 4,
    l1: 20,
    l2: 200,
    gate: (0, 127),
    one_hit_tdc: false,
    pixels: PIXELS,
    bin_width_ps: U16F16::lit("250"),
    offset_mm: I24F8::ZERO,
    source: Source::Link,
    dynamic_depth: None,
};

/// Faults done to the bytes so far.
#[derive(Debug, Default, Clone, Copy)]
struct Faults {
    flipped: u32,
    dropped: u32,
    doubled: u32,
    swapped: u32,
    pulled: u32,
}

impl Faults {
    fn all(&self) -> u32 {
        self.flipped + self.dropped + self.doubled + self.swapped + self.pulled
    }
}

/// One direction of the wire.
struct Wire {
    bytes: VecDeque<u8>,
    /// One fault in so many bytes.
    one_in: u32,
    pulled_until: u32,
    faults: Faults,
}

impl Wire {
    fn new(one_in: u32) -> Self {
        Self {
            bytes: VecDeque::new(),
            one_in,
            pulled_until: 0,
            faults: Faults::default(),
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
            match rng.next_u32() % 100 {
                0..30 => {
                    self.bytes.push_back(byte ^ (1 << (rng.next_u32() % 8)));
                    self.faults.flipped += 1;
                }
                30..60 => self.faults.dropped += 1,
                60..80 => {
                    self.bytes.extend([byte, byte]);
                    self.faults.doubled += 1;
                }
                80..99 => {
                    let before = self.bytes.pop_back();
                    self.bytes.push_back(byte);
                    self.bytes.extend(before);
                    self.faults.swapped += 1;
                }
                _ => {
                    self.pulled_until = now + 1000;
                    self.faults.pulled += 1;
                }
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

fn script(cycles: u64, rng: &mut Pcg32) -> Script {
    let rule = PaperRule::new(U8F8::lit("4"), Count::saturating(5));
    let config = PixelConfig::<128>::with_rule(rule)
        .x(4)
        .l1(20)
        .l2(200)
        .build()
        .unwrap();
    let mut pixels: Vec<_> = (0..PIXELS)
        .map(|address| AsyncPixel::<128>::new(PixelAddress(address)))
        .collect();
    let mut messages = vec![Vec::new()];
    let mut events = Vec::new();
    let mut photons = 0;
    let mut statistics = Statistics::default();
    for cycle in 0..cycles {
        // One laser cycle a piece, some of them a message.
        let mut piece = Vec::new();
        for (address, pixel) in (0..).zip(&mut pixels) {
            for _ in 0..rng.next_u32() % 3 {
                // Half of them in one bin; a few past the last.
                let random = (rng.next_u32() % 130) as u16;
                let code = if rng.next_u32() & 1 == 0 {
                    20 + 10 * address
                } else {
                    random
                };
                pixel.count(&config, code);
                photons += 1;
                piece.extend(Token::Photon { code }.to_bytes());
            }
            piece.extend(Token::Advance { pixels: 1 }.to_bytes());
        }
        piece.extend(Token::EndOfCycles { cycles: 1 }.to_bytes());
        for pixel in &mut pixels {
            pixel.end_laser_cycle(&config, &mut statistics, LaserCycle(cycle));
            events.extend(pixel.acknowledge());
        }
        if messages.last().unwrap().len() + piece.len() > BODY_BYTES {
            messages.push(Vec::new());
        }
        messages.last_mut().unwrap().extend(piece);
    }
    Script {
        messages,
        events,
        photons,
    }
}

/// The events of a message.
fn decode(decoder: &mut AerDecoder, body: &[u8]) -> Vec<DepthEvent> {
    let words = body
        .chunks(AerWord::BYTES)
        .map(|word| word.try_into().unwrap());
    words
        .filter_map(
            |word| match decoder.decode(AerWord::from_le_bytes(word)).unwrap() {
                AerRecord::Event(event) => Some(event),
                AerRecord::Time(_) => None,
                AerRecord::DynamicDepth(_) => panic!("dynamic depth is off"),
                AerRecord::End { .. } => panic!("a device ends no stream"),
            },
        )
        .collect()
}

struct Outcome {
    events: Vec<DepthEvent>,
    report: Report,
    host: LinkCounters,
    device: LinkCounters,
    faults: u32,
    milliseconds: u32,
}

/// Runs a session to its end. The host takes messages only in one of
/// `reads_one_in` milliseconds.
fn run(script: &Script, one_in: u32, reads_one_in: u32, rng: &mut Pcg32) -> Outcome {
    let mut pixels = heapless::Vec::<_, { PIXELS as usize }>::new();
    let mut device = Sidecar::new(&mut pixels, None);
    let mut host = Endpoint::host(7, greeting(0, 0), 0);
    let (mut up, mut down) = (Wire::new(one_in), Wire::new(one_in));
    let (mut up_frames, mut down_frames) = (Deframer::new(), Deframer::new());
    let mut wire = [0; WIRE_BYTES];
    let mut decoder = AerDecoder::new();
    let mut events = Vec::new();
    let mut report = None;
    let configuration = CONFIGURATION.to_le_bytes();
    let mut to_send: VecDeque<(u8, &[u8])> = [(message::CONFIGURE, &configuration[..])]
        .into_iter()
        .chain(
            script
                .messages
                .iter()
                .map(|body| (message::PHOTONS, &body[..])),
        )
        .chain([
            (message::SYNCHRONISE, &b"done"[..]),
            (message::STATISTICS_REQUEST, &[]),
        ])
        .collect();
    let mut answers = Vec::new();

    for now in 0..10_000_000 {
        while host.is_open() && host.has_room() {
            let Some((kind, body)) = to_send.pop_front() else {
                break;
            };
            host.offer(kind, body).unwrap();
        }
        loop {
            let length = host.transmit(now, &mut wire);
            if length == 0 {
                break;
            }
            down.carry(&wire[..length], now, rng);
        }
        while let Some(byte) = down.bytes.pop_front() {
            if let Some(frame) = down_frames.push(byte) {
                device.receive(frame, now);
            }
        }
        device.work(0);
        loop {
            let length = device.transmit(now, &mut wire);
            if length == 0 {
                break;
            }
            up.carry(&wire[..length], now, rng);
        }
        while let Some(byte) = up.bytes.pop_front() {
            if let Some(frame) = up_frames.push(byte) {
                host.receive(frame, now);
            }
        }
        if !now.is_multiple_of(reads_one_in) {
            continue;
        }
        while let Some(message) = host.take() {
            match message.kind {
                message::EVENTS => events.extend(decode(&mut decoder, &message.body)),
                message::STATISTICS => report = Report::from_le_bytes(&message.body),
                kind => answers.push(kind),
            }
        }
        if let Some(report) = report
            && host.is_settled()
        {
            assert_eq!(answers, [message::CONFIGURED, message::SYNCHRONISED]);
            return Outcome {
                events,
                report,
                host: *host.counters(),
                device: *device.endpoint().counters(),
                faults: up.faults.all() + down.faults.all(),
                milliseconds: now,
            };
        }
    }
    panic!(
        "out of step: {:?} {:?}",
        host.counters(),
        device.endpoint().counters()
    );
}

#[track_caller]
fn check(script: &Script, outcome: &Outcome) {
    assert!(
        outcome.events == script.events,
        "{} of {} events",
        outcome.events.len(),
        script.events.len()
    );
    let statistics = outcome.report.statistics;
    assert_eq!(
        statistics.counted + statistics.saturated + statistics.rejected + statistics.gated_out,
        script.photons
    );
    assert!(statistics.rejected > 0);
    assert_eq!(statistics.events, script.events.len() as u64);
    assert_eq!(statistics.deferred, 0);
}

#[test]
fn a_good_wire_needs_no_repetition() {
    let mut rng = Pcg32::seed_from_u64(1);
    let script = script(5_000, &mut rng);
    let outcome = run(&script, 0, 1, &mut rng);
    check(&script, &outcome);
    for end in [outcome.host, outcome.device] {
        assert_eq!(
            end,
            LinkCounters {
                frames: end.frames,
                ..LinkCounters::default()
            }
        );
    }
}

#[test]
fn a_slow_reader_changes_no_event() {
    let mut rng = Pcg32::seed_from_u64(2);
    let script = script(2_000, &mut rng);
    let outcome = run(&script, 0, 500, &mut rng);
    check(&script, &outcome);
    println!("slow reader: {} ms", outcome.milliseconds);
}

#[test]
fn ten_thousand_faults_change_no_event_and_are_counted() {
    let mut faults = 0;
    for (seed, one_in) in (3..).zip([5_000, 1_000, 400].into_iter().cycle()) {
        if faults >= 10_000 {
            break;
        }
        let mut rng = Pcg32::seed_from_u64(seed);
        let script = script(4_000, &mut rng);
        let outcome = run(&script, one_in, 1, &mut rng);
        check(&script, &outcome);
        println!(
            "{} faults in {} ms: host {:?} device {:?}",
            outcome.faults, outcome.milliseconds, outcome.host, outcome.device
        );
        assert!(outcome.host.corrupt + outcome.device.corrupt > 0);
        assert!(outcome.host.retransmitted + outcome.device.retransmitted > 0);
        faults += outcome.faults;
    }
    println!("{faults} faults");
}

/// Runs a good wire until the host has its statistics, or the device has
/// forgotten the session, or `milliseconds` are over.
fn session(
    device: &mut Sidecar<'_>,
    number: u16,
    script: &Script,
    milliseconds: u32,
) -> (Vec<DepthEvent>, Option<Report>, bool) {
    let mut host = Endpoint::host(number, greeting(0, 0), 0);
    let (mut up, mut down) = (Deframer::new(), Deframer::new());
    let mut wire = [0; WIRE_BYTES];
    let configuration = CONFIGURATION.to_le_bytes();
    let mut to_send: VecDeque<(u8, &[u8])> = [(message::CONFIGURE, &configuration[..])]
        .into_iter()
        .chain(
            script
                .messages
                .iter()
                .map(|body| (message::PHOTONS, &body[..])),
        )
        .chain([(message::STATISTICS_REQUEST, &[][..])])
        .collect();
    let mut decoder = AerDecoder::new();
    let mut events = Vec::new();
    for now in 0..milliseconds {
        while host.is_open() && host.has_room() {
            let Some((kind, body)) = to_send.pop_front() else {
                break;
            };
            host.offer(kind, body).unwrap();
        }
        let length = host.transmit(now, &mut wire);
        for &byte in &wire[..length] {
            if let Some(frame) = down.push(byte) {
                device.receive(frame, now);
            }
        }
        device.work(0);
        let length = device.transmit(now, &mut wire);
        for &byte in &wire[..length] {
            if let Some(frame) = up.push(byte) {
                host.receive(frame, now);
            }
        }
        while let Some(message) = host.take() {
            match message.kind {
                message::EVENTS => events.extend(decode(&mut decoder, &message.body)),
                message::STATISTICS => {
                    return (events, Report::from_le_bytes(&message.body), host.is_lost());
                }
                _ => {}
            }
        }
        if host.is_lost() {
            return (events, None, true);
        }
    }
    (events, None, false)
}

#[test]
fn a_host_that_restarts_begins_anew_and_gets_every_event() {
    let mut rng = Pcg32::seed_from_u64(4);
    let script = script(2_000, &mut rng);
    let mut pixels = heapless::Vec::<_, { PIXELS as usize }>::new();
    let mut device = Sidecar::new(&mut pixels, None);
    for number in 1..20 {
        // Gone in the middle of it, with messages on their way.
        let (events, report, _) = session(&mut device, number, &script, 40);
        assert!(report.is_none() && events.len() < script.events.len());
        assert!(script.events.starts_with(&events));
    }
    let (events, report, lost) = session(&mut device, 20, &script, 100_000);
    assert!(events == script.events && !lost);
    assert_eq!(
        report.unwrap().statistics.events,
        script.events.len() as u64
    );
}

#[test]
fn a_device_that_restarts_is_noticed_and_serves_the_next_session() {
    let mut rng = Pcg32::seed_from_u64(5);
    let script = script(2_000, &mut rng);
    let mut pixels = heapless::Vec::<_, { PIXELS as usize }>::new();
    let mut device = Sidecar::new(&mut pixels, None);
    let mut host = Endpoint::host(1, greeting(0, 0), 0);
    let mut wire = [0; WIRE_BYTES];
    let answer = |device: &mut Sidecar<'_>, host: &mut Endpoint, wire: &mut [u8; WIRE_BYTES]| {
        let mut up = Deframer::new();
        let length = device.transmit(0, wire);
        for &byte in &wire[..length] {
            if let Some(frame) = up.push(byte) {
                host.receive(frame, 0);
            }
        }
    };
    // A session of the device's earlier life, which another stands for.
    let mut earlier_pixels = heapless::Vec::<_, 1>::new();
    let mut earlier = Sidecar::new(&mut earlier_pixels, None);
    let mut down = Deframer::new();
    let length = host.transmit(0, &mut wire);
    for &byte in &wire[..length] {
        if let Some(frame) = down.push(byte) {
            earlier.receive(frame, 0);
        }
    }
    answer(&mut earlier, &mut host, &mut wire);
    assert!(host.is_open() && !host.is_lost());
    host.offer(message::STATISTICS_REQUEST, &[]).unwrap();
    let length = host.transmit(0, &mut wire);
    for &byte in &wire[..length] {
        if let Some(frame) = down.push(byte) {
            device.receive(frame, 0);
        }
    }
    answer(&mut device, &mut host, &mut wire);
    assert!(host.is_lost());
    assert_eq!(device.endpoint().counters().foreign, 1);

    let (events, report, _) = session(&mut device, 2, &script, 100_000);
    assert!(events == script.events && report.is_some());
}

#[test]
fn the_same_session_number_drawn_again_begins_anew() {
    let mut rng = Pcg32::seed_from_u64(6);
    let script = script(2_000, &mut rng);
    let mut pixels = heapless::Vec::<_, { PIXELS as usize }>::new();
    let mut device = Sidecar::new(&mut pixels, None);
    session(&mut device, 7, &script, 40);
    let (events, report, lost) = session(&mut device, 7, &script, 100_000);
    assert!(events == script.events && report.is_some() && !lost);
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
        loop {
            // What the line has not carried waits in front of it, unseen.
            let length = host.transmit(now, &mut wire);
            line.extend(&wire[..length]);
            if length == 0 {
                break;
            }
        }
        credit += if (5_000..5_250).contains(&now) {
            0
        } else {
            bytes_a_second
        };
        while credit >= 1000 {
            credit -= 1000;
            let Some(byte) = line.pop_front() else {
                continue;
            };
            if let Some(frame) = down.push(byte) {
                device.receive(frame, now);
            }
        }
        while device.take().is_some() {
            arrived += u32::from(now > 10_000);
        }
        let length = device.transmit(now, &mut wire);
        for &byte in &wire[..length] {
            if let Some(frame) = up.push(byte) {
                host.receive(frame, now);
            }
        }
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
