//! A host and a device with a bad wire between them: over ten thousand faults,
//! every event arrives once, in order and as it was.

use std::collections::VecDeque;

use crate::common::host::{Host, deliver, device};
use crate::common::session::{
    End, Line, Plan, Script, SessionOutcome, WHOLE, check, script, session,
};
use dtof_link::endpoint::{BODY_BYTES, Endpoint, LinkCounters};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::message::{self, greeting};

/// A device that was just switched on, and a script of so many laser cycles.
fn run(seed: u64, cycles: usize, one_in: u32, plan: Plan) -> (Line, SessionOutcome) {
    let mut line = Line::new(seed);
    line.faults(one_in);
    let script = script(cycles, &mut line.rng);
    let outcome = session(&mut line, 7, &script, plan);
    check(&script, &outcome);
    (line, outcome)
}

#[test]
fn a_good_wire_needs_no_repetition() {
    let (line, outcome) = run(1, 5_000, 0, WHOLE);
    for end in [*outcome.host.counters(), *line.device.endpoint().counters()] {
        let expected = LinkCounters {
            frames: end.frames,
            ..LinkCounters::default()
        };
        assert_eq!(end, expected);
    }
}

#[test]
fn a_slow_reader_changes_no_event() {
    let slow = Plan {
        reads_one_in: 500,
        ..WHOLE
    };
    let (_, outcome) = run(2, 2_000, 0, slow);
    println!("slow reader: {} ms", outcome.milliseconds);
}

#[test]
fn ten_thousand_faults_change_no_event_and_are_counted() {
    let mut faults = 0;
    for (seed, one_in) in (3..).zip([5_000, 1_000, 400].into_iter().cycle()) {
        if faults >= 10_000 {
            break;
        }
        let (line, outcome) = run(seed, 4_000, one_in, WHOLE);
        let (host, device) = (outcome.host.counters(), line.device.endpoint().counters());
        let of_wire = line.up.faults + line.down.faults;
        println!(
            "{of_wire} faults in {} ms: host {host:?} device {device:?}",
            outcome.milliseconds
        );
        assert!(host.corrupt + device.corrupt > 0);
        assert!(host.retransmitted + device.retransmitted > 0);
        faults += of_wire;
    }
    println!("{faults} faults");
}

/// Gone in the middle of it, with messages on their way.
fn interrupted(line: &mut Line, number: u16, script: &Script) {
    let short = Plan {
        host_lives_ms: 20,
        ..WHOLE
    };
    let outcome = session(line, number, script, short);
    assert!(outcome.end == End::Stopped && outcome.events.len() < script.events.len());
    assert!(!outcome.events.is_empty() && script.events.starts_with(&outcome.events));
}

#[test]
fn a_host_that_restarts_begins_anew_and_gets_every_event() {
    let mut line = Line::new(4);
    let script = script(2_000, &mut line.rng);
    for number in 1..20 {
        interrupted(&mut line, number, &script);
    }
    let outcome = session(&mut line, 20, &script, WHOLE);
    check(&script, &outcome);
}

#[test]
fn the_same_session_number_drawn_again_begins_anew() {
    let mut line = Line::new(6);
    let script = script(2_000, &mut line.rng);
    interrupted(&mut line, 7, &script);
    let outcome = session(&mut line, 7, &script, WHOLE);
    check(&script, &outcome);
}

#[test]
fn a_device_that_restarts_is_noticed_and_serves_the_next_session() {
    let mut line = Line::new(5);
    let script = script(2_000, &mut line.rng);
    // A session of the device's earlier life, which another stands for.
    let mut earlier = device::<8>(None);
    let mut host = Host::new(1, 0);
    host.exchange(&mut earlier, 0);
    assert!(host.endpoint.is_open() && !host.endpoint.is_lost());
    host.ask(message::STATISTICS_REQUEST, &[]);
    host.exchange(&mut line.device, 0);
    assert!(host.endpoint.is_lost());
    assert_eq!(line.device.endpoint().counters().foreign, 1);
    let outcome = session(&mut line, 2, &script, WHOLE);
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
