//! A scene for boards with nothing attached.

use core::num::NonZeroU16;

use dtof_core::PixelAddress;
use dtof_core::fixed::types::{U0F32, U8F24};

use super::{Pulse, Settings, Simulated, SimulatedPixel};

/// A quarter, a half and the rest in three bins.
const PULSE: Pulse<'static> = Pulse::new(&[U0F32::lit("0.25"), U0F32::lit("0.5")]);

/// A surface that recedes from pixel to pixel, fainter the farther it is.
static PIXELS: [SimulatedPixel; 16] = {
    const EMPTY: SimulatedPixel = pixel(0);
    let mut pixels = [EMPTY; 16];
    let mut index = 0;
    let mut rest: &mut [SimulatedPixel] = &mut pixels;
    while let [first, others @ ..] = rest {
        *first = pixel(index);
        index += 1;
        rest = others;
    }
    pixels
};

/// From bin 20 to bin 110, from 0.5 to 0.1 signal photons a laser cycle.
const fn pixel(index: u16) -> SimulatedPixel {
    let signal = U8F24::from_bits(U8F24::lit("0.5").to_bits() * 5 / (5 + index as u32 * 4 / 3));
    let background = U8F24::lit("0.5");
    match SimulatedPixel::new(PixelAddress::new(index), 20 + 6 * index, signal, background) {
        Ok(pixel) => pixel,
        // Both are far below the most there may be.
        Err(_) => unreachable!(),
    }
}

/// 16 pixels, addresses 0 up, at 5,000 laser cycles a second.
#[must_use]
pub fn scene() -> Simulated<'static> {
    const SETTINGS: Settings = Settings {
        seed: 1,
        bins: 128,
        cycles_per_second: 5_000,
        // 10 ms.
        cycles_per_poll: NonZeroU16::new(50).unwrap(),
    };
    Simulated::new(&PIXELS, PULSE, SETTINGS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_surface_recedes_and_fades() {
        assert_eq!(PIXELS[0], pixel(0));
        for (near, far) in PIXELS.iter().zip(&PIXELS[1..]) {
            assert_eq!(far.address.raw(), near.address.raw() + 1);
            assert_eq!(far.position, near.position + 6);
            assert!(far.signal < near.signal);
        }
        assert_eq!(PIXELS[15].position, 110);
        // Of the photons of a pixel: 0.5 of 1 a laser cycle, and 0.1 of 0.6.
        let share = |share: u32, of: u32| (u64::from(share) << 32) / u64::from(of);
        for (pixel, share) in [(PIXELS[0], share(1, 2)), (PIXELS[15], share(1, 6))] {
            assert!(pixel.signal.abs_diff(share) < 1 << 12, "{pixel:?}");
        }
    }
}
