//! An hour on a wire that drops, flips, doubles and swaps bytes, stands still and is pulled,
//! with a host and a device that restart again and again. Each session gets the events of its
//! photons, once, in order and as they were; one that breaks gets the first of them. Both ends know
//! that it broke: the host when it gives up or the device says so, the device as soon as it was
//! restarted or has begun another session. It says so to a host of the one before.

use crate::common::host::deliver;
use crate::common::session::{
    End, Line, Plan, Script, SessionOutcome, WHOLE, check, script, session,
};
use dtof_link::endpoint::{Endpoint, LinkCounters, RETRANSMIT_MOST_MS};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use rand_core::Rng;

const HOUR_MS: u32 = 3_600_000;

/// What there was in all sessions.
#[derive(Debug, Default)]
struct Totals {
    sessions: u32,
    done: u32,
    stopped: u32,
    lost: u32,
    silent: u32,
    stuck: u32,
    faults: u32,
    stalls: u32,
    events: u64,
    /// Events of broken sessions that the device had sent and the host has not got.
    undelivered: u64,
    repeated: u64,
    damaged: u64,
    /// Hosts of broken sessions that the device has told so afterwards.
    told: u32,
}

impl Totals {
    fn add_counters(&mut self, counters: &LinkCounters) {
        self.repeated += u64::from(counters.retransmitted);
        self.damaged += u64::from(counters.corrupt) + u64::from(counters.oversized);
    }

    /// Holds what came of a session against what should.
    fn add(&mut self, line: &Line, script: &Script, outcome: &SessionOutcome) {
        self.sessions += 1;
        self.events += outcome.events.len() as u64;
        self.add_counters(outcome.host.counters());
        match outcome.end {
            End::Done => self.done += 1,
            End::Stopped => self.stopped += 1,
            End::Lost => self.lost += 1,
            End::Silent => self.silent += 1,
            End::Stuck => self.stuck += 1,
        }
        let began = line.tap.session == Some(outcome.session);
        let sent = if began { &line.tap.events[..] } else { &[] };
        if outcome.end == End::Done {
            check(script, outcome);
            assert_eq!(sent, script.events);
            return;
        }
        // Of a session that broke the host has the first events, and no report.
        assert!(script.events.starts_with(&outcome.events) && outcome.report.is_none());
        // What the device takes as delivered has been.
        let (sent, got) = (sent.len(), outcome.events.len());
        assert!(!began || line.tap.delivered <= got, "{got} events");
        self.undelivered += (sent - got) as u64;
    }
}

/// The host of a session that broke comes back, on a good wire. Whether the device says that there
/// is no such session.
fn is_told(line: &mut Line, mut host: Endpoint) -> bool {
    let mut wire = [0; WIRE_BYTES];
    // After so long there is something to send.
    let length = host.transmit(line.now + RETRANSMIT_MOST_MS, &mut wire);
    deliver(&mut Deframer::new(), &wire[..length], |frame| {
        line.device.receive(frame, line.now);
    });
    let length = line.device.transmit(line.now, &mut wire);
    deliver(&mut Deframer::new(), &wire[..length], |frame| {
        host.receive(frame, line.now);
    });
    host.is_lost()
}

/// An hour on a wire with more and fewer faults.
fn hour(seed: u64, totals: &mut Totals) {
    let mut line = Line::new(seed);
    let mut broken = Vec::new();
    while line.now < HOUR_MS {
        let mut random = |below: u32| line.rng.next_u32() % below;
        let one_in = [0, 20_000, 5_000, 1_000, 400][random(5) as usize];
        let cycles = 100 + random(3_000) as usize;
        let plan = match random(4) {
            0 => Plan {
                host_lives_ms: random(20_000),
                ..WHOLE
            },
            1 => Plan {
                device_lives_ms: random(20_000),
                ..WHOLE
            },
            _ => WHOLE,
        };
        line.faults(one_in);
        let script = script(cycles, &mut line.rng);
        let number = (totals.sessions % 65_521) as u16;
        let outcome = session(&mut line, number, &script, plan);
        totals.add(&line, &script, &outcome);
        if outcome.end != End::Done && outcome.host.is_open() && !outcome.host.is_lost() {
            broken.push(outcome);
        }
    }
    for end in line
        .earlier
        .iter()
        .chain([line.device.endpoint().counters()])
    {
        totals.add_counters(end);
    }
    totals.faults += line.up.faults + line.down.faults;
    totals.stalls += line.up.stalls + line.down.stalls;
    for outcome in broken {
        // The device may still wait for the host of the last session.
        if line.tap.session != Some(outcome.session) {
            assert!(is_told(&mut line, outcome.host), "{}", outcome.session);
            totals.told += 1;
        }
    }
}

fn hours(hours: u64) {
    let mut totals = Totals::default();
    (0..hours).for_each(|seed| hour(seed, &mut totals));
    let Totals {
        sessions,
        done,
        stopped,
        lost,
        silent,
        stuck,
        faults,
        stalls,
        events,
        undelivered,
        repeated,
        damaged,
        told,
    } = totals;
    println!(
        "soak: link: {hours} h, {faults} faults, {stalls} of them stalls, {sessions} sessions, \
         {stopped} ended by the host, {lost} by the device, {silent} by silence; {events} events, \
         0 wrong, 0 lost in silence, {undelivered} undelivered at breaks; \
         {damaged} damaged frames, {repeated} repeated; {told} hosts told afterwards"
    );
    assert_eq!(stuck, 0);
    assert_eq!(done + stopped + lost + silent, sessions);
    assert!(done > sessions / 2 && stopped > 5 && lost > 5 && undelivered > 0);
    assert!(told > 5);
    // A fault may hit a frame that is damaged already, or the end of one.
    assert!(stalls > 20 && damaged > u64::from(faults / 2) && repeated > 1_000);
}

#[test]
fn an_hour_on_a_bad_wire_loses_nothing_in_silence() {
    hours(1);
}

#[test]
#[ignore = "takes minutes: `.ci/long soak` runs it"]
fn a_week_on_a_bad_wire_loses_nothing_in_silence() {
    hours(7 * 24);
}
