//! What `pixel_array` avoids: an array of 256 pixels that is made first and then moved into its
//! static. `cargo run --package dtof-core --example pixel_array_moved`.
//!
//! The stack frame has 84,584 bytes on a Cortex-M4F in the profile `firmware-small`, and
//! 335,928 in `dev`. `cargo xtask check-image` checks that it finds this frame.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[macro_use]
mod platform;

use core::array;

use dtof_core::{AsyncPixel, PixelAddress};
use static_cell::StaticCell;

static PIXELS: StaticCell<[AsyncPixel<128>; 256]> = StaticCell::new();

fn pixel(index: usize) -> AsyncPixel<128> {
    // Every index is below 256.
    let address = u16::try_from(index).unwrap_or_default();
    AsyncPixel::new(PixelAddress::new(address))
}

fn main() {
    let pixels = PIXELS.init(array::from_fn(pixel));
    let events = pixels.iter_mut().filter_map(AsyncPixel::take_event).count();
    print_line!("{} pixels, {events} events", pixels.len());
    assert_eq!(events, 0);
}
