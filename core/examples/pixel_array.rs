//! Arrays of 64 and 256 pixels in statics, filled in place:
//! `cargo run --package dtof-core --example pixel_array`.
//!
//! An array that is made first and then moved into its static needs a stack frame of its
//! size, as the example `pixel_array_moved` does. `cargo xtask check-image` checks that no
//! frame of this program exceeds 1 kB in the profiles of the firmware, or 2.5 kB in `dev`.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[macro_use]
mod platform;

use dtof_core::{AsyncPixel, LaserCycle, PixelAddress, PixelConfig, Statistics, checked};
use heapless::Vec;
use static_cell::ConstStaticCell;

// Checked at compile time: the paper's rule on 128 bins.
const CONFIG: PixelConfig<128> = checked!(PixelConfig::paper().build());

type Pixels<const N: usize> = Vec<AsyncPixel<128>, N>;

// Empty, so that they take no flash.
static SMALL: ConstStaticCell<Pixels<64>> = ConstStaticCell::new(Vec::new());
static LARGE: ConstStaticCell<Pixels<256>> = ConstStaticCell::new(Vec::new());

/// Fills an array, one pixel at a time.
fn fill<const N: usize>(pixels: &mut Pixels<N>) {
    for address in (0..).take(N) {
        // There is room for `N`.
        let _ = pixels.push(AsyncPixel::new(PixelAddress::new(address)));
    }
}

/// How many events there are of 44 laser cycles with a photon in bin 60 of each pixel.
fn run(pixels: &mut [AsyncPixel<128>]) -> usize {
    let mut statistics = Statistics::new();
    for cycle in (0..44).map(LaserCycle::new) {
        for pixel in &mut *pixels {
            pixel.count(&CONFIG, 60);
            pixel.end_laser_cycle(&CONFIG, &mut statistics, cycle);
        }
    }
    pixels.iter_mut().filter_map(AsyncPixel::take_event).count()
}

fn main() {
    let small = SMALL.take();
    fill(small);
    let large = LARGE.take();
    fill(large);
    let events = (run(small), run(large));
    print_line!("{events:?} events");
    assert_eq!(events, (64, 256));
}
