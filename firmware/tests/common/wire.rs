//! A bad wire, and what a device puts on it.

use std::collections::VecDeque;

use dtof_core::{AerDecoder, AerRecord, AerWord, DepthEvent};
use dtof_link::endpoint::{Endpoint, WINDOW};
use dtof_link::frame::Deframer;
use dtof_link::message;
use rand_core::Rng;
use rand_pcg::Pcg32;

/// One direction of the wire.
#[derive(Default)]
pub struct Wire {
    bytes: VecDeque<u8>,
    /// One fault in so many bytes; none if 0.
    pub one_in: u32,
    pulled_until: u32,
    stalled_until: u32,
    /// All faults so far.
    pub faults: u32,
    /// Those of them at which no byte came for 0.1 to 5 seconds.
    pub stalls: u32,
}

impl Wire {
    pub fn new(one_in: u32) -> Self {
        Self {
            one_in,
            ..Self::default()
        }
    }

    pub fn carry(&mut self, bytes: &[u8], now: u32, rng: &mut Pcg32) {
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
                80..98 => {
                    let before = self.bytes.pop_back();
                    self.bytes.push_back(byte);
                    self.bytes.extend(before);
                }
                98 => {
                    self.stalls += 1;
                    self.stalled_until = now + 100 + rng.next_u32() % 4_901;
                    self.bytes.push_back(byte);
                }
                _ => self.pulled_until = now + 1000,
            }
        }
    }

    /// What has come out at the other end.
    pub fn arrived(&mut self, now: u32) -> Vec<u8> {
        if now < self.stalled_until {
            return Vec::new();
        }
        self.bytes.drain(..).collect()
    }
}

/// Listens where a device puts frames on the wire, before anything happens to them.
#[derive(Default)]
pub struct Tap {
    frames: Deframer,
    /// The last session.
    pub session: Option<u16>,
    next: u8,
    /// Events so far at the end of each of its messages.
    messages: Vec<usize>,
    decoder: AerDecoder,
    /// Its events, each once, however often it was sent.
    pub events: Vec<DepthEvent>,
    /// The first of them that the device knows to be delivered, as far as can be told.
    pub delivered: usize,
}

impl Tap {
    /// Looks at the device's end when everything that is due has been heard.
    pub fn look(&mut self, device: &Endpoint) {
        if device.is_open() {
            let waiting = WINDOW - device.room();
            let delivered = self.messages.iter().rev().nth(waiting);
            self.delivered = delivered.copied().unwrap_or_default();
        }
    }

    pub fn hear(&mut self, bytes: &[u8]) {
        let mut frames = std::mem::take(&mut self.frames);
        for &byte in bytes {
            if let Some(frame) = frames.push(byte) {
                self.frame(frame.unwrap());
            }
        }
        self.frames = frames;
    }

    fn frame(&mut self, payload: &[u8]) {
        let &[kind, session0, session1, number, _, _, ref body @ ..] = payload else {
            panic!("a short frame");
        };
        let session = u16::from_le_bytes([session0, session1]);
        // Answers to frames of other sessions are of none.
        if kind > 0xf2 {
            return;
        }
        if self.session != Some(session) {
            *self = Self {
                session: Some(session),
                ..Self::default()
            };
        }
        if kind >= 0xf0 || number != self.next {
            return;
        }
        self.next = self.next.wrapping_add(1);
        for word in body.chunks(16).filter(|_| kind == message::EVENTS) {
            let word = AerWord::from_le_bytes(word.try_into().unwrap());
            match self.decoder.decode(word).unwrap() {
                AerRecord::Event(event) => self.events.push(event),
                AerRecord::Time(_) => {}
                other => panic!("{other:?}"),
            }
        }
        self.messages.push(self.events.len());
    }
}
