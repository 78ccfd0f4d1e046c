//! Sessions of a host and a device with a bad wire between them.

use std::collections::VecDeque;

use dtof_core::DepthEvent;
use dtof_firmware::sidecar::Sidecar;
use dtof_link::endpoint::{Endpoint, LinkCounters};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::{Configuration, Report, Source, message};
use rand_core::SeedableRng;
use rand_pcg::Pcg32;

use super::host::{CONFIGURATION, Host, deliver, device};
use super::script;
use super::wire::{Tap, Wire};

/// A host takes a device that says nothing for so long, or answers nothing, as gone. As
/// `dtof` does.
const SILENCE_MS: u32 = 5_000;
const ANSWER_MS: u32 = 30_000;

/// What the host sends, and what it should get.
pub struct Script {
    messages: Vec<Vec<u8>>,
    pub events: Vec<DepthEvent>,
    photons: u64,
}

pub fn script(cycles: usize, rng: &mut Pcg32) -> Script {
    let calls = script::script(cycles, rng);
    Script {
        messages: script::messages(&calls),
        events: script::reference(&calls, &script::config(&CONFIGURATION)),
        photons: script::photons(&calls),
    }
}

/// A device with eight pixels, the wire to it, and the time. They outlive a session.
pub struct Line {
    pub device: Sidecar<'static>,
    frames: Deframer,
    /// What the device had counted each time before it was switched off.
    pub earlier: Vec<LinkCounters>,
    pub tap: Tap,
    pub up: Wire,
    pub down: Wire,
    pub now: u32,
    pub rng: Pcg32,
}

impl Line {
    /// A device that was just switched on, and a good wire.
    pub fn new(seed: u64) -> Self {
        Self {
            device: device::<8>(None),
            frames: Deframer::new(),
            earlier: Vec::new(),
            tap: Tap::default(),
            up: Wire::new(0),
            down: Wire::new(0),
            now: 0,
            rng: Pcg32::seed_from_u64(seed),
        }
    }

    /// One fault in so many bytes; none if 0.
    pub fn faults(&mut self, one_in: u32) {
        (self.up.one_in, self.down.one_in) = (one_in, one_in);
    }

    /// The device is switched off and on. What is on the wire stays there.
    pub fn restart_device(&mut self) {
        self.earlier.push(*self.device.endpoint().counters());
        self.device = device::<8>(None);
        self.frames = Deframer::new();
    }
}

/// How a session goes.
#[derive(Clone, Copy)]
pub struct Plan {
    /// The host takes messages in one of so many milliseconds.
    pub reads_one_in: u32,
    /// The host is gone after so long.
    pub host_lives_ms: u32,
    /// The device is switched off and on after so long.
    pub device_lives_ms: u32,
}

/// Nothing happens until everything is there.
pub const WHOLE: Plan = Plan {
    reads_one_in: 1,
    host_lives_ms: 10_000_000,
    device_lives_ms: u32::MAX,
};

/// Why a session ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The host has its statistics, and knows that everything it sent has arrived.
    Done,
    /// The host was stopped before.
    Stopped,
    /// The device has forgotten the session.
    Lost,
    /// The device says nothing any more.
    Silent,
    /// The device speaks, but nothing goes on.
    Stuck,
}

/// What came of a session.
pub struct SessionOutcome {
    pub session: u16,
    pub end: End,
    pub events: Vec<DepthEvent>,
    pub report: Option<Report>,
    /// The host's end.
    pub host: Endpoint,
    pub milliseconds: u32,
}

/// Runs a session to its end.
pub fn session(line: &mut Line, number: u16, script: &Script, plan: Plan) -> SessionOutcome {
    let began = line.now;
    let mut host = Host::new(number, began);
    let mut wire = [0; WIRE_BYTES];
    let requested = Configuration {
        source: Source::Link,
        ..CONFIGURATION
    };
    let configuration = requested.to_le_bytes();
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
    let mut report = None;
    let (mut progress, mut moved) = ((0, 0, 0), began);
    let end = loop {
        let now = line.now;
        if host.endpoint.is_lost() {
            break End::Lost;
        }
        if now - began >= plan.host_lives_ms {
            break End::Stopped;
        }
        if host.endpoint.silent_ms(now) >= SILENCE_MS {
            break End::Silent;
        }
        let now_is = (to_send.len(), host.events.len(), host.answers.len());
        if now_is != progress {
            (progress, moved) = (now_is, now);
        }
        if now - moved >= ANSWER_MS {
            break End::Stuck;
        }
        if now - began == plan.device_lives_ms {
            line.restart_device();
        }
        while host.endpoint.is_open() && host.endpoint.has_room() {
            let Some((kind, body)) = to_send.pop_front() else {
                break;
            };
            host.ask(kind, body);
        }
        while let length @ 1.. = host.endpoint.transmit(now, &mut wire) {
            line.down.carry(&wire[..length], now, &mut line.rng);
        }
        deliver(&mut line.frames, &line.down.arrived(now), |frame| {
            line.device.receive(frame, now);
        });
        line.device.work(0);
        while let length @ 1.. = line.device.transmit(now, &mut wire) {
            line.tap.hear(&wire[..length]);
            line.up.carry(&wire[..length], now, &mut line.rng);
        }
        line.tap.look(line.device.endpoint());
        host.hear(&line.up.arrived(now), now);
        if now.is_multiple_of(plan.reads_one_in) {
            host.read(usize::MAX);
            if let [.., (message::STATISTICS, body, _)] = &host.answers[..]
                && host.endpoint.is_settled()
            {
                let kinds: Vec<u8> = host.answers.iter().map(|&(kind, ..)| kind).collect();
                let before = [message::CONFIGURED, message::SYNCHRONISED];
                assert_eq!(kinds[..kinds.len() - 1], before);
                report = Report::from_le_bytes(body);
                break End::Done;
            }
        }
        line.now += 1;
    };
    host.read(usize::MAX);
    assert!(host.changes.is_empty());
    SessionOutcome {
        session: number,
        end,
        report,
        host: host.endpoint,
        events: host.events,
        milliseconds: line.now - began,
    }
}

/// Everything of a session has arrived as it was.
#[track_caller]
pub fn check(script: &Script, outcome: &SessionOutcome) {
    let Some(report) = outcome.report else {
        panic!("{:?}: {:?}", outcome.end, outcome.host.counters());
    };
    let (got, expected) = (outcome.events.len(), script.events.len());
    assert!(
        outcome.events == script.events,
        "{got} of {expected} events"
    );
    let statistics = report.statistics;
    assert_eq!(statistics.photons(), script.photons);
    assert!(statistics.rejected > 0 && outcome.end == End::Done);
    assert_eq!(statistics.events, script.events.len() as u64);
    assert_eq!(statistics.deferred, 0);
}
