//! What `examples/histogram.c` prints is what Rust decides of the same counts.

use std::fmt::Write as _;

use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{PixelConfig, RangeScale, Statistics, WholeHistogram};

const PRINTED: &str = include_str!("../examples/histogram.out");

#[test]
fn the_example_of_histograms_prints_what_rust_finds() {
    let config = PixelConfig::<128>::paper().build().unwrap();
    let scale = RangeScale::new(U16F16::lit("92.1"), I24F8::lit("-179.5")).unwrap();
    let mut zones = String::new();
    for zone in 0..9 {
        let peak = 25 + 5 * zone;
        let mut counts = [300u32; 128];
        (counts[peak], counts[peak + 1]) = (70_000, 30_000);
        let (mut position, mut statistics) = (None, Statistics::new());
        let mut whole = WholeHistogram::<128>::new();
        whole.decide(&config, &counts, 549_888, &mut statistics, |_, found| {
            position = Some(found.position());
        });
        let range = scale.range(position.unwrap());
        writeln!(zones, "zone {zone}: {} mm", range.round()).unwrap();
    }
    let dropped = "a packet is missing, the set is dropped\n";
    // A set without its last packet has given the other zones.
    let eight = &zones[..zones.find("zone 8").unwrap()];
    assert_eq!(
        PRINTED,
        format!("{zones}{dropped}{zones}{eight}{dropped}{zones}{dropped}end\n")
    );
}
