//! From a whole histogram of a sensor to millimetres:
//! `cargo run --package dtof-core --example whole_histogram`.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[macro_use]
mod platform;

use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{PixelConfig, RangeScale, Statistics, WholeHistogram, checked};

// Checked at compile time: the paper's rule on 128 bins of 250 ps.
const CONFIG: PixelConfig<128> = checked!(PixelConfig::paper().build());
const SCALE: RangeScale = checked!(RangeScale::new(U16F16::lit("250"), I24F8::ZERO));

/// The range of the target, if there is one, in millimetres.
fn range(counts: &[u32; 128]) -> Option<I24F8> {
    let (mut whole, mut statistics) = (WholeHistogram::<128>::new(), Statistics::new());
    let mut range = None;
    whole.decide(&CONFIG, counts, 1000, &mut statistics, |_, found| {
        range = Some(SCALE.range(found.position()));
    });
    range
}

fn main() {
    let mut counts = [900; 128];
    assert_eq!(range(&counts), None);
    // A pulse on the edge between bins 40 and 41.
    (counts[40], counts[41]) = (5000, 5000);
    let range = range(&counts).expect("a pulse as clear as this is found");
    print_line!("{range} mm");
    assert_eq!(range.round(), 1536);
}
