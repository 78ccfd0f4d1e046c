//! Photons of eight macropixels, the messages that carry them, and the events that they make.

use dtof_core::{
    AnyRule, AsyncPixel, DepthEvent, LaserCycle, PixelAddress, PixelConfig, Statistics,
};
use dtof_link::endpoint::BODY_BYTES;
use dtof_link::{Configuration, Token};
use rand_core::Rng;
use rand_pcg::Pcg32;

use super::host::Call;

/// Photons of one laser cycle and, now and then, of a few empty ones after it. Half of them
/// are in one bin, a few past the last.
fn calls(rng: &mut Pcg32) -> Vec<Call> {
    let mut calls = Vec::new();
    for pixel in 0..8 {
        for _ in 0..rng.next_u32() % 3 {
            let random = (rng.next_u32() % 130) as u16;
            let signal = rng.next_u32() & 1 == 0;
            let code = if signal { 20 + 10 * pixel } else { random };
            calls.push(Call::Photon(pixel, code));
        }
    }
    let is_tenth = rng.next_u32().is_multiple_of(10);
    calls.push(Call::End(if is_tenth { 7 } else { 1 }));
    calls
}

pub fn script(length: usize, rng: &mut Pcg32) -> Vec<Vec<Call>> {
    (0..length).map(|_| calls(rng)).collect()
}

/// The same as photons messages.
pub fn messages(script: &[Vec<Call>]) -> Vec<Vec<u8>> {
    let mut messages = vec![Vec::new()];
    for cycle in script {
        // One piece, some of them a message.
        let (mut piece, mut at) = (Vec::new(), 0);
        for call in cycle {
            let token = match *call {
                Call::Photon(pixel, code) => {
                    for _ in at..pixel {
                        piece.extend(Token::Advance { pixels: 1 }.to_bytes());
                    }
                    at = pixel;
                    Token::Photon { code }
                }
                Call::End(cycles) => Token::EndOfCycles { cycles },
                Call::Frame(_) | Call::Histogram(..) => unreachable!(),
            };
            piece.extend(token.to_bytes());
        }
        if messages.last().unwrap().len() + piece.len() > BODY_BYTES {
            messages.push(Vec::new());
        }
        messages.last_mut().unwrap().extend(piece);
    }
    messages
}

/// The configuration for a pixel.
pub fn config(requested: &Configuration) -> PixelConfig<128, AnyRule> {
    let Configuration { x, l1, l2, .. } = *requested;
    let config = PixelConfig::with_rule(requested.rule).x(x).l1(l1).l2(l2);
    config.estimator(requested.estimator).build().unwrap()
}

/// What pixels, 16 at most, with a link that takes every event at once report.
pub fn reference(script: &[Vec<Call>], config: &PixelConfig<128, AnyRule>) -> Vec<DepthEvent> {
    let mut pixels: Vec<_> = (0..16)
        .map(|address| AsyncPixel::<128>::new(PixelAddress::new(address)))
        .collect();
    let mut events = Vec::new();
    let mut statistics = Statistics::default();
    let mut cycle = 0;
    for call in script.iter().flatten() {
        match *call {
            Call::Photon(pixel, code) => pixels[usize::from(pixel)].count(config, code),
            Call::End(cycles) => {
                for _ in 0..cycles {
                    for pixel in &mut pixels {
                        pixel.end_laser_cycle(config, &mut statistics, LaserCycle::new(cycle));
                        events.extend(pixel.take_event());
                    }
                    cycle += 1;
                }
            }
            Call::Frame(_) | Call::Histogram(..) => unreachable!(),
        }
    }
    events
}

pub fn photons(script: &[Vec<Call>]) -> u64 {
    let calls = script.iter().flatten();
    calls
        .filter(|call| matches!(call, Call::Photon(..)))
        .count() as u64
}
