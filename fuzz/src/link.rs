//! Two endpoints and a hostile wire: messages arrive whole, once and in order, or not at all. On a
//! wire that is good again all of them arrive. What an end has sent itself is nothing to it.

use std::collections::VecDeque;

use dtof_link::endpoint::{BODY_BYTES, Endpoint};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::message::greeting;

use crate::Input;

/// One end, what it was given to send, and what has arrived there.
struct End {
    endpoint: Endpoint,
    deframer: Deframer,
    /// The kind of its messages.
    kind: u8,
    offered: Vec<Vec<u8>>,
    arrived: usize,
    /// The frames that it sent last.
    sent: Vec<u8>,
}

impl End {
    fn new(endpoint: Endpoint, kind: u8) -> Self {
        Self {
            endpoint,
            deframer: Deframer::new(),
            kind,
            offered: Vec::new(),
            arrived: 0,
            sent: Vec::new(),
        }
    }

    /// A message of this length, which no other is like.
    fn offer(&mut self, length: usize) {
        let number = self.offered.len();
        let body: Vec<u8> = (0..length.min(BODY_BYTES))
            .map(|at| (number >> (8 * (at % 2))) as u8 ^ at as u8)
            .collect();
        if self.endpoint.is_open() && self.endpoint.offer(self.kind, &body).is_ok() {
            self.offered.push(body);
        }
    }

    fn transmit(&mut self, now: u32, line: &mut VecDeque<u8>) {
        let mut wire = [0; WIRE_BYTES];
        let mut sent = Vec::new();
        for frames in 0.. {
            let length = self.endpoint.transmit(now, &mut wire);
            if length == 0 {
                break;
            }
            assert!(
                length <= WIRE_BYTES && frames < 1000,
                "it never stops sending"
            );
            line.extend(&wire[..length]);
            sent.extend(&wire[..length]);
        }
        if !sent.is_empty() {
            self.sent = sent;
        }
    }

    /// Its own frames come back, as from a terminal with an echo.
    fn echo(&mut self, now: u32) {
        let (endpoint, mut deframer) = (&mut self.endpoint, Deframer::new());
        let before = (endpoint.is_open(), endpoint.is_lost());
        let (silent, mut foreign) = (endpoint.silent_ms(now), endpoint.counters().foreign);
        for &byte in &self.sent {
            if let Some(frame) = deframer.push(byte) {
                endpoint.receive(frame, now);
                foreign += 1;
            }
        }
        assert_eq!(endpoint.counters().foreign, foreign, "an echo is taken");
        assert_eq!((endpoint.is_open(), endpoint.is_lost()), before);
        assert_eq!(
            endpoint.silent_ms(now),
            silent,
            "an echo is no sign of life"
        );
        assert!(endpoint.peek().is_none(), "a message of its own");
        assert!(!endpoint.take_began() && !endpoint.take_ended());
    }

    /// Takes bytes off the wire, and the messages they make. Each is the next that `other` sent.
    fn hear(&mut self, line: impl IntoIterator<Item = u8>, now: u32, other: &mut Self) {
        for byte in line {
            if let Some(frame) = self.deframer.push(byte) {
                self.endpoint.receive(frame, now);
            }
        }
        // Messages under way arrive all the same.
        let _ = self.endpoint.take_ended();
        if self.endpoint.take_began() {
            // A session anew: what was to be sent before is gone.
            self.offered.clear();
            self.arrived = 0;
        }
        while let Some(message) = self.endpoint.take() {
            let expected = other.offered.get(self.arrived);
            assert_eq!(expected.map(Vec::as_slice), Some(&message.body[..]));
            self.arrived += 1;
        }
    }
}

/// The input says what is offered, how long nothing happens, and what the wire does.
pub fn link(data: &[u8]) {
    let mut input = Input::new(data);
    let mut host = End::new(Endpoint::host(1, greeting(0, 0), 0), 0x40);
    let mut device = End::new(Endpoint::device(greeting(128, 8)), 0xc0);
    let mut ends = false;
    let (mut down, mut up) = (VecDeque::new(), VecDeque::new());
    let mut now = 0u32;
    while !input.is_empty() && now < 1_000_000 {
        let (what, much) = (input.byte(), input.byte());
        let line = if what & 1 == 0 { &mut down } else { &mut up };
        match what >> 1 & 7 {
            0 => host.offer(much.into()),
            1 => device.offer(much.into()),
            2 => now += u32::from(much) * 4,
            // Faults: a bit, a byte less, a byte twice, bytes from nowhere.
            3 => {
                if let Some(byte) = line.get_mut(usize::from(much)) {
                    *byte ^= 1 << (what >> 4 & 7);
                }
            }
            4 => {
                line.remove(much.into());
            }
            5 => {
                if let Some(&byte) = line.get(usize::from(much)) {
                    line.insert(much.into(), byte);
                }
            }
            6 if much == u8::MAX => {
                if host.endpoint.is_open() {
                    host.endpoint.end(now);
                    ends = true;
                }
            }
            6 if much >= 0xe0 && what & 1 == 0 => host.echo(now),
            6 if much >= 0xe0 => device.echo(now),
            6 => line.extend(input.bytes(usize::from(much) % 32)),
            _ => {
                host.transmit(now, &mut down);
                device.transmit(now, &mut up);
                // Some of it, or all.
                let whole = much == u8::MAX;
                let part = |line: &VecDeque<u8>| {
                    if whole {
                        line.len()
                    } else {
                        line.len().min(much.into())
                    }
                };
                let (of_down, of_up) = (part(&down), part(&up));
                device.hear(down.drain(..of_down).collect::<Vec<_>>(), now, &mut host);
                host.hear(up.drain(..of_up).collect::<Vec<_>>(), now, &mut device);
            }
        }
        assert!(down.len().max(up.len()) < 1 << 20, "the wire fills");
    }
    if host.endpoint.is_lost() {
        return;
    }
    // A good wire, until nothing is left.
    for _ in 0..20_000 {
        now += 1;
        host.transmit(now, &mut down);
        device.hear(down.drain(..).collect::<Vec<_>>(), now, &mut host);
        device.transmit(now, &mut up);
        host.hear(up.drain(..).collect::<Vec<_>>(), now, &mut device);
        if host.endpoint.is_lost() {
            assert!(
                !ends || !device.endpoint.is_open(),
                "a session that has ended"
            );
            return;
        }
        let done = !ends
            && host.endpoint.is_open()
            && (device.arrived, host.arrived) == (host.offered.len(), device.offered.len());
        if done {
            return;
        }
    }
    panic!(
        "{} of {} and {} of {} arrived",
        device.arrived,
        host.offered.len(),
        host.arrived,
        device.offered.len()
    );
}
