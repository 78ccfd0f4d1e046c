//! One end of the link, frame by frame and millisecond by millisecond.

use dtof_link::StopReason;
use dtof_link::endpoint::{
    BODY_BYTES, Endpoint, Full, GREETING_BYTES, KEEP_ALIVE_MS, RETRANSMIT_MOST_MS, RETRANSMIT_MS,
    WINDOW,
};
use dtof_link::frame::{Deframer, FrameError, WIRE_BYTES};

const HOST: [u8; GREETING_BYTES] = [1; GREETING_BYTES];
const DEVICE: [u8; GREETING_BYTES] = [2; GREETING_BYTES];
const SESSION: u16 = 0x1234;
const LOW: u8 = 0x34;
const HIGH: u8 = 0x12;

/// A message of a host, and one of a device.
const MESSAGE: u8 = 0x40;
const ANSWER: u8 = 0x80;
const KEEP_ALIVE: u8 = 0xf0;
const KEEP_ALIVE_OF_DEVICE: u8 = 0xf4;
const END: u8 = 0xf5;
const HELLO: u8 = 0xf1;
const WELCOME: u8 = 0xf2;
const NO_SESSION: u8 = 0xf3;

/// All frames that are due.
fn sent(end: &mut Endpoint, now: u32) -> Vec<Vec<u8>> {
    let (mut deframer, mut wire) = (Deframer::new(), [0; WIRE_BYTES]);
    let mut frames = Vec::new();
    while let length @ 1.. = end.transmit(now, &mut wire) {
        assert!(frames.len() < 10, "it never stops");
        for &byte in &wire[..length] {
            if let Some(frame) = deframer.push(byte) {
                frames.push(frame.unwrap().to_vec());
            }
        }
    }
    frames
}

/// Their kinds and numbers.
fn kinds(frames: &[Vec<u8>]) -> Vec<(u8, u8)> {
    frames.iter().map(|frame| (frame[0], frame[3])).collect()
}

/// A frame of the session with the number of a message, and what its sender expects.
fn frame(kind: u8, number: u8, expects: u8) -> Vec<u8> {
    vec![kind, LOW, HIGH, number, expects, expects.wrapping_add(4)]
}

fn device() -> Endpoint {
    let mut device = Endpoint::device(DEVICE);
    let hello = [&frame(HELLO, 0, 0)[..], &HOST].concat();
    device.receive(Ok(&hello), 0);
    assert_eq!(kinds(&sent(&mut device, 0)), [(WELCOME, 0)]);
    device
}

fn host() -> Endpoint {
    let mut host = Endpoint::host(SESSION, HOST, 0);
    let hello = [&[HELLO, LOW, HIGH, 0, 0, 4][..], &HOST].concat();
    assert_eq!(sent(&mut host, 0), [hello]);
    let welcome = [&frame(WELCOME, 0, 0)[..], &DEVICE].concat();
    host.receive(Ok(&welcome), 0);
    assert_eq!((host.is_open(), *host.peer_greeting()), (true, DEVICE));
    host
}

#[test]
fn a_host_greets_until_it_is_answered_and_a_device_waits() {
    let mut host = Endpoint::host(SESSION, HOST, 1000);
    let mut device = Endpoint::device(DEVICE);
    let mut greeted = Vec::new();
    for now in 1000..1500 {
        if !sent(&mut host, now).is_empty() {
            greeted.push(now);
        }
        assert_eq!(sent(&mut device, now), [[0; 0]; 0]);
    }
    assert_eq!(greeted, [1000, 1100, 1200, 1300, 1400]);
    // Another host opens nothing.
    host.receive(Ok(&[&frame(HELLO, 0, 0)[..], &HOST].concat()), 1500);
    assert!(!host.is_open() && host.counters().foreign == 1);
    // A welcome to another session, or without a greeting, opens nothing.
    host.receive(
        Ok(&[WELCOME, LOW ^ 1, HIGH, 0, 0, 4, 2, 2, 2, 2, 2, 2, 2, 2]),
        1500,
    );
    host.receive(Ok(&frame(WELCOME, 0, 0)), 1500);
    assert!(!host.is_open() && host.counters().foreign == 2);
}

#[test]
fn a_second_welcome_changes_nothing_and_a_second_hello_begins_anew_after_a_message() {
    let mut host = host();
    host.offer(MESSAGE, b"1").unwrap();
    assert!(host.take_began() && !host.take_began());
    host.receive(Ok(&[&frame(WELCOME, 0, 0)[..], &HOST].concat()), 5);
    assert!(!host.take_began() && !host.is_settled());
    assert_eq!(*host.peer_greeting(), DEVICE);

    let hello = [&frame(HELLO, 0, 0)[..], &HOST].concat();
    let mut device = device();
    assert!(device.take_began());
    device.receive(Ok(&hello), 5);
    assert!(!device.take_began(), "the same host asks again");
    device.receive(Ok(&[&frame(MESSAGE, 0, 0)[..], b"1"].concat()), 6);
    let frames = device.counters().frames;
    device.receive(Ok(&hello), 7);
    assert!(device.take_began(), "another host of the same number");
    assert_eq!(device.take(), None);
    assert_eq!(device.counters().frames, frames + 1);
    device.receive(Ok(&frame(HELLO, 0, 0)), 8);
    assert_eq!(device.counters().corrupt, 1);
}

#[test]
fn what_is_of_another_session_or_of_the_own_kind_is_foreign_and_a_device_answers_a_host() {
    let of_host = [0, MESSAGE, 0x7f, KEEP_ALIVE, END];
    let of_device = [ANSWER, 0xef, KEEP_ALIVE_OF_DEVICE, NO_SESSION];
    for kind in of_host.into_iter().chain(of_device).chain([0xf6, 0xff]) {
        for is_ours in [false, true] {
            let mut strange = frame(kind, 0, 0);
            strange[1] ^= u8::from(!is_ours);
            let is_known = is_ours && of_host.contains(&kind);
            let mut device = device();
            device.receive(Ok(&strange), 30);
            assert!(!device.is_lost());
            assert_eq!(device.is_open(), !(is_ours && kind == END));
            assert_eq!(device.counters().foreign, u32::from(!is_known));
            assert_eq!(device.silent_ms(40), if is_known { 10 } else { 40 });
            let answers = sent(&mut device, 30);
            let refused = [NO_SESSION, strange[1], HIGH, 0, 0, 4, 0];
            assert_eq!(
                answers.contains(&refused.to_vec()),
                (!is_ours && of_host.contains(&kind)) || (is_ours && kind == END),
                "{kind:#x} {is_ours}"
            );

            let mut host = host();
            host.receive(Ok(&strange), 30);
            assert!(host.take_began() && !host.take_began());
            assert_eq!(host.is_lost(), is_ours && kind == NO_SESSION);
            let is_known = is_ours && of_device.contains(&kind);
            assert_eq!(host.counters().foreign, u32::from(!is_known));
            let answers = kinds(&sent(&mut host, 30));
            assert!(!answers.contains(&(NO_SESSION, 0)));
        }
    }
}

/// As a terminal with an echo gives them back.
#[test]
fn a_device_that_hears_itself_hears_no_host() {
    let mut device = device();
    device.offer(ANSWER, b"1").unwrap();
    for now in 0..2000 {
        for frame in sent(&mut device, now) {
            device.receive(Ok(&frame), now);
        }
    }
    assert!(device.counters().foreign > 30);
    assert_eq!(device.silent_ms(2000), 2000);
    assert!(device.is_open() && !device.is_settled());
    assert_eq!(device.take(), None);
}

#[test]
fn a_host_ends_its_session_until_the_device_has_forgotten_it() {
    let (mut host, mut device) = (host(), device());
    assert!(device.take_began());
    host.offer(MESSAGE, b"1").unwrap();
    let message = sent(&mut host, 10);
    device.receive(Ok(&message[0]), 10);
    host.offer(MESSAGE, b"2").unwrap();
    host.end(11);
    // The first is lost on the way; nothing else is sent.
    let mut ends = Vec::new();
    for now in 11..200 {
        ends.extend(sent(&mut host, now).into_iter().map(|end| (now, end)));
    }
    let end = vec![END, LOW, HIGH, 0, 0, 4];
    let expected = [11, 61, 111, 161].map(|now| (now, end.clone()));
    assert_eq!(ends, expected);

    device.set_stop_reason(StopReason::EndOfSession);
    device.receive(Ok(&end), 200);
    assert!(device.take_ended() && !device.take_ended() && !device.is_open());
    // A message that had arrived before belonged to the session.
    assert_eq!(device.take(), None);
    let forgotten = [
        NO_SESSION,
        LOW,
        HIGH,
        0,
        0,
        4,
        StopReason::EndOfSession as u8,
    ];
    assert_eq!(sent(&mut device, 200), [forgotten]);
    assert_eq!(sent(&mut device, 300), [[0; 0]; 0]);
    // Once more, as the answer may be lost.
    device.receive(Ok(&end), 310);
    assert!(!device.take_ended());
    assert_eq!(sent(&mut device, 310), [forgotten]);

    host.receive(Ok(&forgotten), 320);
    assert!(host.is_lost());
    assert_eq!(host.stop_reason(), Some(StopReason::EndOfSession));
    assert_eq!(sent(&mut host, 5000), [[0; 0]; 0]);

    // The reason stays over sessions.
    device.receive(Ok(&[&frame(HELLO, 0, 0)[..], &HOST].concat()), 400);
    assert!(device.is_open() && device.take_began());
    assert_eq!(device.stop_reason(), Some(StopReason::EndOfSession));
}

#[test]
fn a_host_that_ends_its_session_before_it_begins_ends_it_then() {
    let mut host = Endpoint::host(SESSION, HOST, 0);
    host.end(0);
    let hello = [&[HELLO, LOW, HIGH, 0, 0, 4][..], &HOST].concat();
    assert_eq!(sent(&mut host, 0), [hello]);
    let welcome = [&frame(WELCOME, 0, 0)[..], &DEVICE].concat();
    host.receive(Ok(&welcome), 60);
    assert_eq!(sent(&mut host, 60), [[END, LOW, HIGH, 0, 0, 4]]);
}

#[test]
fn frames_that_are_none_are_counted() {
    let mut device = device();
    let frames = device.counters().frames;
    device.receive(Err(FrameError::Corrupt), 1);
    device.receive(Err(FrameError::Oversized), 1);
    device.receive(Ok(&[0; 5]), 1);
    device.receive(Ok(&vec![MESSAGE; 6 + BODY_BYTES + 1]), 1);
    let counters = device.counters();
    assert_eq!((counters.corrupt, counters.oversized), (2, 2));
    assert_eq!(counters.frames, frames);
    assert_eq!(device.silent_ms(9), 9);
    // The longest body is none too many.
    let longest = [&frame(MESSAGE, 0, 0)[..], &[7; BODY_BYTES]].concat();
    device.receive(Ok(&longest), 1);
    assert_eq!(device.take().unwrap().body, [7; BODY_BYTES]);
}

#[test]
fn a_window_of_messages_is_under_way_and_no_more() {
    let mut host = host();
    for offered in 0..WINDOW {
        assert_eq!(host.room(), WINDOW - offered);
        assert!(host.has_room());
        host.offer(MESSAGE, b"a message").unwrap();
    }
    assert_eq!((host.room(), host.has_room()), (0, false));
    assert_eq!(host.offer(MESSAGE, b"5"), Err(Full));
    let all = [0, 1, 2, 3].map(|number| (MESSAGE, number));
    assert_eq!(kinds(&sent(&mut host, 10)), all);
    host.receive(Ok(&frame(KEEP_ALIVE_OF_DEVICE, 0, 3)), 20);
    assert_eq!((host.room(), host.is_settled()), (3, false));
    // Older than what is known, and what was never sent.
    host.receive(Ok(&frame(KEEP_ALIVE_OF_DEVICE, 0, 2)), 20);
    host.receive(Ok(&frame(KEEP_ALIVE_OF_DEVICE, 0, 5)), 20);
    assert_eq!(host.room(), 3);
    host.receive(Ok(&frame(KEEP_ALIVE_OF_DEVICE, 0, 4)), 20);
    assert!(host.is_settled());
}

#[test]
fn messages_are_taken_once_and_in_order_while_there_is_room() {
    let mut device = device();
    let message = |number: u8| [&frame(MESSAGE, number, 0)[..], &[number]].concat();
    for number in [1, 0, 0, 1, 2, 3, 4] {
        device.receive(Ok(&message(number)), 1);
    }
    // 1 came too early, 0 twice, and for 4 there was no room.
    let counters = device.counters();
    assert_eq!((counters.out_of_order, counters.duplicate), (2, 1));
    // It says that it expects 4, and has no room for it.
    assert_eq!(
        sent(&mut device, 1),
        [[KEEP_ALIVE_OF_DEVICE, LOW, HIGH, 0, 4, 4]]
    );
    assert_eq!(sent(&mut device, 1), [[0; 0]; 0]);
    for number in 0..4_u8 {
        assert_eq!(device.waiting(), 4 - usize::from(number));
        assert_eq!(device.peek().unwrap().body, [number]);
        assert_eq!(device.take().unwrap().body, [number]);
    }
    assert_eq!((device.waiting(), device.peek()), (0, None));
    assert_eq!(device.take(), None);
}

#[test]
fn a_device_that_forgets_the_session_has_no_messages_and_says_nothing() {
    let mut device = device();
    device.receive(Ok(&[&frame(MESSAGE, 0, 0)[..], b"1"].concat()), 1);
    device.offer(ANSWER, b"2").unwrap();
    device.close();
    assert!(!device.is_open() && device.is_settled() && !device.take_ended());
    assert_eq!((device.waiting(), sent(&mut device, 1000)), (0, vec![]));
}

#[test]
fn a_full_window_is_named() {
    assert_eq!(Full.to_string(), "the window is full");
}

/// What is sent after a silence waits no longer than what is sent at once, and an acknowledgement of nothing
/// postpones nothing.
#[test]
fn a_message_is_repeated_after_the_shortest_wait() {
    let mut host = host();
    for now in 0..5000 {
        host.receive(Ok(&frame(KEEP_ALIVE_OF_DEVICE, 0, 0)), now);
        assert!(
            kinds(&sent(&mut host, now))
                .iter()
                .all(|&(kind, _)| kind == KEEP_ALIVE)
        );
    }
    host.offer(MESSAGE, b"1").unwrap();
    assert_eq!(kinds(&sent(&mut host, 5000)), [(MESSAGE, 0)]);
    let repeated = |now: &u32| {
        host.receive(Ok(&frame(KEEP_ALIVE_OF_DEVICE, 0, 0)), *now);
        kinds(&sent(&mut host, *now)).contains(&(MESSAGE, 0))
    };
    assert_eq!((5001..9000).find(repeated), Some(5000 + RETRANSMIT_MS));
}

#[test]
fn who_has_nothing_to_say_says_so_after_a_while() {
    let mut host = host();
    host.offer(MESSAGE, b"1").unwrap();
    assert_eq!(kinds(&sent(&mut host, 7)), [(MESSAGE, 0)]);
    host.receive(Ok(&frame(KEEP_ALIVE_OF_DEVICE, 0, 1)), 8);
    let mut said = Vec::new();
    for now in 8..300 {
        said.extend(sent(&mut host, now).iter().map(|_| now));
    }
    let expected: Vec<u32> = (1..=5).map(|times| 7 + times * KEEP_ALIVE_MS).collect();
    assert_eq!(said, expected);
}

/// When messages are sent, while nobody acknowledges.
#[test]
fn what_is_not_acknowledged_is_repeated_alone_and_ever_more_seldom() {
    let mut host = host();
    (0..3).for_each(|number| host.offer(MESSAGE, &[number]).unwrap());
    let mut log = Vec::new();
    for now in 0..6000 {
        let frames = sent(&mut host, now);
        let messages = kinds(&frames)
            .into_iter()
            .filter(|&(kind, _)| kind == MESSAGE);
        log.extend(messages.map(|(_, number)| (now, number)));
    }
    let times = [100, 300, 700, 1500, 3100, 4700].map(|now| (now, 0));
    let expected = [&[(0, 0), (0, 1), (0, 2)][..], &times].concat();
    assert_eq!(log, expected);
    assert_eq!(host.counters().retransmitted, 6);
    assert_eq!(times[0].0, RETRANSMIT_MS);
    assert_eq!(times[5].0 - times[4].0, RETRANSMIT_MOST_MS);

    // Once it arrives the others follow at once.
    host.receive(Ok(&frame(KEEP_ALIVE_OF_DEVICE, 0, 1)), 6000);
    assert_eq!(kinds(&sent(&mut host, 6000)), [(MESSAGE, 1), (MESSAGE, 2)]);
    assert_eq!(host.counters().retransmitted, 8);
    host.receive(Ok(&frame(KEEP_ALIVE_OF_DEVICE, 0, 3)), 6001);
}

/// How long until a message is repeated, after `arrived` others at the longest wait.
fn wait_after(arrived: u8) -> u32 {
    let mut host = host();
    host.offer(MESSAGE, &[]).unwrap();
    (0..6000).for_each(|now| drop(sent(&mut host, now)));
    for number in 1..=arrived {
        host.receive(Ok(&frame(KEEP_ALIVE_OF_DEVICE, 0, number)), 6000);
        assert!(host.is_settled());
        host.offer(MESSAGE, &[]).unwrap();
        assert_eq!(kinds(&sent(&mut host, 6000)), [(MESSAGE, number)]);
    }
    let repeated = |now: &u32| kinds(&sent(&mut host, 6000 + now)).contains(&(MESSAGE, arrived));
    (1..2000).find(repeated).unwrap()
}

#[test]
fn every_eight_messages_that_arrive_halve_the_wait() {
    for arrived in 1..48 {
        let expected = (1600 >> (arrived / 8)).max(100);
        assert_eq!(wait_after(arrived), expected, "{arrived}");
    }
}
