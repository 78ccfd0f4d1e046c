//! A host and a device in one process: `cargo run --package dtof-link --example two_ends`.
//!
//! The host sends photons, the device answers with events. Between them are bytes, here
//! without a wire.

use dtof_core::{
    AerDecoder, AerEncoder, AerRecord, AerWord, AsyncPixel, LaserCycle, PixelAddress, PixelConfig,
    Statistics, checked,
};
use dtof_link::Token;
use dtof_link::endpoint::{Endpoint, Full};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::message::{EVENTS, PHOTONS, greeting};

const CONFIG: PixelConfig<128> = checked!(PixelConfig::paper().build());

/// Carries one frame from one end to the other. Returns whether there was one.
fn carry(from: &mut Endpoint, to: &mut Endpoint, deframer: &mut Deframer, now_ms: u32) -> bool {
    let mut wire = [0; WIRE_BYTES];
    let length = from.transmit(now_ms, &mut wire);
    for &byte in &wire[..length] {
        if let Some(frame) = deframer.push(byte) {
            to.receive(frame, now_ms);
        }
    }
    length > 0
}

fn main() -> Result<(), Full> {
    let mut host = Endpoint::host(1, greeting(0, 0), 0);
    let mut device = Endpoint::device(greeting(128, 1));
    let (mut down, mut up) = (Deframer::new(), Deframer::new());
    let mut pixel = AsyncPixel::<128>::new(PixelAddress::new(0));
    let mut statistics = Statistics::new();
    let (mut encoder, mut decoder) = (AerEncoder::new(), AerDecoder::new());
    let (mut cycle, mut events) = (0, 0);
    for now_ms in 0..100 {
        // The host: a photon in bin 60 and the end of a laser cycle, each millisecond.
        if host.is_open() && host.has_room() {
            let tokens = [Token::Photon { code: 60 }, Token::EndOfCycles { cycles: 1 }];
            let body: Vec<u8> = tokens.iter().flat_map(|token| token.to_bytes()).collect();
            host.offer(PHOTONS, &body)?;
        }
        // The device: takes photons, and sends an event once there is one.
        while let Some(message) = device.take() {
            let mut left = &message.body[..];
            while let Some((token, rest)) = Token::split_first(left) {
                match token {
                    Token::Photon { code } => pixel.count(&CONFIG, code),
                    Token::EndOfCycles { .. } => {
                        pixel.end_laser_cycle(&CONFIG, &mut statistics, LaserCycle::new(cycle));
                        cycle += 1;
                    }
                    Token::Advance { .. } => {}
                }
                left = rest;
            }
        }
        if device.has_room()
            && let Some(event) = pixel.take_event()
        {
            let (time, word) = encoder.encode(&event);
            let words = time.into_iter().chain([word]);
            device.offer(
                EVENTS,
                &words.flat_map(AerWord::to_le_bytes).collect::<Vec<_>>(),
            )?;
        }
        // The wire, until neither end has a frame.
        while carry(&mut host, &mut device, &mut down, now_ms)
            | carry(&mut device, &mut host, &mut up, now_ms)
        {}
        // The host again.
        while let Some(message) = host.take() {
            for word in message.body.as_chunks().0 {
                let record = decoder.decode(AerWord::from_le_bytes(*word));
                if let Ok(AerRecord::Event(event)) = record {
                    println!(
                        "after {} laser cycles: bin {}",
                        event.exposure, event.peak_bin
                    );
                    events += 1;
                }
            }
        }
    }
    assert_eq!(events, 2);
    Ok(())
}
