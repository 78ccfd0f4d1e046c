//! Events as the bytes of a stream, and back:
//! `cargo run --package dtof-core --example aer_stream`.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[macro_use]
mod platform;

use dtof_core::{
    AerDecoder, AerEncoder, AerError, AerRecord, AerWord, AsyncPixel, DepthEvent, LaserCycle,
    PixelAddress, PixelConfig, Statistics, checked,
};

// Checked at compile time: the paper's rule on 128 bins.
const CONFIG: PixelConfig<128> = checked!(PixelConfig::paper().build());

/// The sending end: two pixels, and a word for each event, with a time word before it when
/// one is due.
fn send(cycles: u64, link: &mut dyn FnMut([u8; 16])) {
    let mut pixels = [0, 1].map(|address| AsyncPixel::<128>::new(PixelAddress::new(address)));
    let mut statistics = Statistics::new();
    let mut encoder = AerEncoder::new();
    for cycle in 0..cycles {
        for (pixel, bin) in pixels.iter_mut().zip([60, 80]) {
            pixel.count(&CONFIG, bin);
            pixel.end_laser_cycle(&CONFIG, &mut statistics, LaserCycle::new(cycle));
            if let Some(event) = pixel.take_event() {
                let (time, word) = encoder.encode(&event);
                let words = time.into_iter().chain([word]);
                words.map(AerWord::to_le_bytes).for_each(&mut *link);
            }
        }
    }
}

/// The receiving end. A word that cannot be decoded is an error; the next can be read.
fn receive(decoder: &mut AerDecoder, bytes: [u8; 16]) -> Result<Option<DepthEvent>, AerError> {
    Ok(match decoder.decode(AerWord::from_le_bytes(bytes))? {
        AerRecord::Event(event) => Some(event),
        _ => None,
    })
}

fn main() {
    let mut decoder = AerDecoder::new();
    let (mut words, mut events) = (0, 0);
    send(200, &mut |bytes| {
        words += 1;
        if let Ok(Some(event)) = receive(&mut decoder, bytes) {
            events += 1;
            let (pixel, cycle) = (event.pixel.raw(), event.cycle.raw());
            print_line!("pixel {pixel}, laser cycle {cycle}, bin {}", event.peak_bin);
        }
    });
    // The first word is a time word.
    assert_eq!((words, events), (9, 8));
}
