//! The engine beside the sensor, and a host that sends it anything.

use dtof_core::{AerDecoder, AerRecord, AerWord};
use dtof_firmware::sidecar::{Block, Pixel, Sidecar};
use dtof_link::Report;
use dtof_link::endpoint::{BODY_BYTES, Endpoint};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::message::{self, greeting};

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
        for _ in 0..200 {
            now += 1;
            host.exchange(&mut device, now);
            if host.endpoint.is_lost() {
                return;
            }
            if host.endpoint.is_open() && host.endpoint.offer(kind, body).is_ok() {
                break;
            }
        }
    }
    // All that was asked has an answer.
    for _ in 0..5000 {
        now += 1;
        host.exchange(&mut device, now);
        if host.endpoint.is_lost() || (host.endpoint.is_open() && host.endpoint.is_settled()) {
            return;
        }
    }
    panic!("the device takes no more messages");
}

struct Host {
    endpoint: Endpoint,
    deframer: Deframer,
    down: Deframer,
    decoder: AerDecoder,
    events: u64,
}

impl Host {
    fn new() -> Self {
        Self {
            endpoint: Endpoint::host(1, greeting(0, 0), 0),
            deframer: Deframer::new(),
            down: Deframer::new(),
            decoder: AerDecoder::new(),
            events: 0,
        }
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
            message::CONFIGURED => self.events = 0,
            message::STATISTICS => {
                let report = Report::from_le_bytes(body).expect("a report");
                assert_eq!(report.link.corrupt, 0, "a good wire");
                let events = report.statistics.events + report.blocks.events;
                assert!(self.events <= events, "events that none has decided");
            }
            _ => {}
        }
    }
}
