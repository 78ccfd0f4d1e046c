//! Arrays of 64 and 256 pixels in statics, filled in place:
//! `cargo run --package dtof-core --example pixel_array`.
//!
//! An array that is made first and then moved into its static needs a stack frame of its
//! size, as the example `pixel_array_moved` does. `cargo xtask check-image` checks that no
//! frame of this program exceeds 2 kB in the profiles of the firmware, or 3 kB in `dev`.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[macro_use]
mod platform;

use dtof_core::{Array, ArrayConfig, PixelArray, PixelConfig, PixelPlace, checked};
use heapless::Vec;
use static_cell::ConstStaticCell;

// Checked at compile time: the paper's rule on 128 bins.
const PIXELS: PixelConfig<128> = checked!(PixelConfig::paper().build());

type Room<const N: usize> = Vec<PixelPlace<128>, N>;

// Empty, so that they take no flash.
static SMALL: ConstStaticCell<Room<64>> = ConstStaticCell::new(Vec::new());
static LARGE: ConstStaticCell<Room<256>> = ConstStaticCell::new(Vec::new());

/// Fills the room, one pixel at a time.
fn fill<const N: usize>(room: &mut Room<N>) {
    while room.push(PixelPlace::new()).is_ok() {}
}

/// How many events there are of 44 laser cycles with a photon in bin 60 of each pixel.
fn run(room: &mut [PixelPlace<128>], columns: u32) -> usize {
    let pixels = room.len();
    let mut array = PixelArray::new(room, &mut []);
    let layout = Array::new(columns, columns).expect("some pixels");
    let config = ArrayConfig::new(layout, PIXELS);
    array.configure(&config).expect("there is room");
    for _ in 0..44 {
        (0..pixels).for_each(|pixel| array.photon(pixel, 60));
        array.end_laser_cycle();
    }
    core::iter::from_fn(|| array.next_event()).count()
}

fn main() {
    let small = SMALL.take();
    fill(small);
    let large = LARGE.take();
    fill(large);
    let events = (run(small, 8), run(large, 16));
    print_line!("{events:?} events");
    assert_eq!(events, (64, 256));
}
