//! The engine beside the sensor, and a host that sends it anything.

use std::collections::VecDeque;

use dtof_core::{AerDecoder, AerRecord, AerWord};
use dtof_firmware::sidecar::{Block, Pixel, Sidecar};

use dtof_link::endpoint::{BODY_BYTES, Endpoint};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::message::{self, greeting};
use dtof_link::{Report, Token};

use crate::Input;

/// Messages of any kind and body, over a good wire. Events are words that mean something, answers
/// come, and no photon is missing from the report.
pub fn sidecar(data: &[u8]) {
    let mut pixels = heapless::Vec::<Pixel, 16>::new();
    let mut blocks = heapless::Vec::<Block, 4>::new();
    let mut device = Sidecar::new(&mut pixels, &mut blocks, None);
    let mut host = Host::new();
    let mut input = Input::new(data);
    let mut now = 0;
    let mut cycles = 0;
    while !input.is_empty() {
        // Kinds that there are, mostly.
        let kind = match input.byte() {
            0..32 => message::CONFIGURE,
            32..160 => message::PHOTONS,
            160..180 => message::STATISTICS_REQUEST,
            180..200 => message::SYNCHRONISE,
            200..220 => message::HISTOGRAM_REQUEST,
            // The others are the link's own.
            other => other.min(0xef),
        };
        let length = usize::from(input.byte());
        let body = input.bytes(length.min(BODY_BYTES));
        // Three bytes ask for up to 65,535 laser cycles, each of which all pixels may look at.
        if kind == message::PHOTONS {
            cycles += cycles_of(body);
            if cycles > MOST_CYCLES {
                break;
            }
        }
        for _ in 0..200 {
            now += 1;
            host.exchange(&mut device, now);
            if host.endpoint.is_lost() {
                return;
            }
            if host.endpoint.is_open() && host.endpoint.offer(kind, body).is_ok() {
                host.note(kind, body);
                break;
            }
        }
    }
    // All that was asked has an answer. The device looks 64 times, and then sees what else there
    // is to do.
    for _ in 0..5000 + cycles / 64 {
        now += 1;
        host.exchange(&mut device, now);
        if host.endpoint.is_lost() || (host.endpoint.is_open() && host.endpoint.is_settled()) {
            return;
        }
    }
    panic!("the device takes no more messages");
}

/// Laser cycles of one input.
const MOST_CYCLES: u64 = 1 << 19;

fn cycles_of(mut body: &[u8]) -> u64 {
    let mut all = 0;
    while let Some((token, rest)) = Token::split_first(body) {
        if let Token::EndOfCycles { cycles } = token {
            all += u64::from(cycles);
        }
        body = rest;
    }
    all
}

struct Host {
    endpoint: Endpoint,
    deframer: Deframer,
    down: Deframer,
    decoder: AerDecoder,
    events: u64,
    /// What was sent and is not answered yet: configurations, requests of statistics, and of
    /// messages of photons how many they hold.
    asked: VecDeque<(u8, u64)>,
    /// Photons since the configuration, if there is one.
    photons: Option<u64>,
}

impl Host {
    fn new() -> Self {
        Self {
            endpoint: Endpoint::host(1, greeting(0, 0), 0),
            deframer: Deframer::new(),
            down: Deframer::new(),
            decoder: AerDecoder::new(),
            events: 0,
            asked: VecDeque::new(),
            photons: None,
        }
    }

    fn note(&mut self, kind: u8, mut body: &[u8]) {
        let mut photons = 0;
        if kind == message::PHOTONS {
            while let Some((token, rest)) = Token::split_first(body) {
                photons += u64::from(matches!(token, Token::Photon { .. }));
                body = rest;
            }
        }
        let kinds = [
            message::CONFIGURE,
            message::PHOTONS,
            message::STATISTICS_REQUEST,
        ];
        if kinds.contains(&kind) {
            self.asked.push_back((kind, photons));
        }
    }

    /// What was asked before this answer is done.
    fn answered(&mut self, question: u8) {
        while let Some((kind, photons)) = self.asked.pop_front() {
            if let Some(all) = &mut self.photons {
                *all += photons;
            }
            if kind == question {
                return;
            }
            assert_eq!(kind, message::PHOTONS, "an answer is missing");
        }
        panic!("an answer to nothing");
    }

    fn exchange(&mut self, device: &mut Sidecar, now: u32) {
        let mut wire = [0; WIRE_BYTES];
        for rounds in 0.. {
            assert!(rounds < 10_000, "they never stop talking");
            let length = self.endpoint.transmit(now, &mut wire);
            for &byte in &wire[..length] {
                if let Some(frame) = self.down.push(byte) {
                    device.receive(frame, now);
                }
            }
            device.work(0);
            let answer = device.transmit(now, &mut wire);
            for &byte in &wire[..answer] {
                if let Some(frame) = self.deframer.push(byte) {
                    self.endpoint.receive(frame, now);
                }
            }
            while let Some(message) = self.endpoint.take() {
                self.read(message.kind, &message.body);
            }
            if length + answer == 0 {
                return;
            }
        }
    }

    fn read(&mut self, kind: u8, body: &[u8]) {
        match kind {
            message::EVENTS => {
                let (words, rest) = body.as_chunks::<{ AerWord::BYTES }>();
                assert!(rest.is_empty(), "half a word");
                for word in words {
                    let record = self.decoder.decode(AerWord::from_le_bytes(*word));
                    match record.expect("words of a device mean something") {
                        AerRecord::Event(_) | AerRecord::DynamicDepth(_) => self.events += 1,
                        AerRecord::Time(_) => {}
                        AerRecord::End { .. } => panic!("a device does not end"),
                    }
                }
            }
            // The counts begin anew.
            message::CONFIGURED => {
                self.answered(message::CONFIGURE);
                (self.events, self.photons) = (0, Some(0));
            }
            message::REFUSED => self.answered(message::CONFIGURE),
            message::STATISTICS => {
                self.answered(message::STATISTICS_REQUEST);
                let report = Report::from_le_bytes(body).expect("a report");
                assert_eq!(report.link.corrupt, 0, "a good wire");
                let events = report.statistics.events + report.blocks.events;
                assert!(self.events <= events, "events that none has decided");
                let of = &report.statistics;
                let kept = of.counted + of.held;
                let lost = of.saturated + of.rejected + of.gated_out + report.unaddressed;
                assert_eq!(self.photons.unwrap_or(0), kept + lost, "photons");
            }
            _ => {}
        }
    }
}
