//! From photons to millimetres, with one macropixel:
//! `cargo run --package dtof-core --example minimal`.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[macro_use]
mod platform;

use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{
    AsyncPixel, LaserCycle, PixelAddress, PixelConfig, RangeScale, Statistics, checked,
};

// Checked at compile time: the paper's rule on 128 bins of 250 ps.
const CONFIG: PixelConfig<128> = checked!(PixelConfig::paper().x(4).l1(40).l2(2000).build());
const SCALE: RangeScale = checked!(RangeScale::new(U16F16::lit("250"), I24F8::ZERO));

/// `photons` are the TDC codes of each laser cycle. `show` gets millimetres.
fn run(photons: &[&[u16]], show: &mut dyn FnMut(I24F8)) {
    let mut pixel = AsyncPixel::<128>::new(PixelAddress::new(0));
    let mut statistics = Statistics::new();
    for (cycle, codes) in (0..).zip(photons) {
        pixel.count_batch(&CONFIG, codes);
        pixel.end_laser_cycle(&CONFIG, &mut statistics, LaserCycle::new(cycle));
        if let Some(event) = pixel.take_event() {
            show(SCALE.range(event.position()));
        }
    }
}

fn main() {
    // A photon in bin 60 of each of 200 laser cycles: an event every 44, at 60.5 bins.
    let mut events = 0;
    run(&[&[60][..]; 200], &mut |range| {
        print_line!("{range} mm");
        assert_eq!(range.round(), 2267);
        events += 1;
    });
    assert_eq!(events, 4);
}
