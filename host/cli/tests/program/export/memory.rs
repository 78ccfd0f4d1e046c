//! The memory that `dtof export` takes does not grow with the file.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::Stdio;

use crate::common::aer::{HEADER, depth};
use crate::common::{Scratch, peak_kb};
use dtof_data::events::aer_file::Writer;

const FORMATS: [&str; 6] = ["csv", "csv --echo strongest", "pcd", "ply", "mcap", "evt2"];

/// A file of so many events from all pixels, some of them changes of depth.
fn write(path: &Path, events: u64) {
    let out = BufWriter::new(File::create(path).unwrap());
    let mut writer = Writer::new(out, &HEADER).unwrap();
    for (index, pixel) in (0..events).zip((0..2048).cycle()) {
        let bin = if index / 2048 % 8 < 4 { 30 } else { 70 };
        writer.write(&depth(pixel, index, bin)).unwrap();
    }
    writer.finish().unwrap().flush().unwrap();
}

/// The most memory each format took to export so many events, in kB.
fn peaks(events: u64) -> Vec<u64> {
    let scratch = Scratch::new();
    write(&scratch.path("events.aer"), events);
    let peak = |format: &&str| {
        let mut dtof = scratch.command(&format!("export events.aer --format {format} --out out"));
        let peak = peak_kb(dtof.stdout(Stdio::null()).spawn().unwrap());
        fs::remove_file(scratch.path("out")).unwrap();
        println!("{events} events as {format}: at most {peak} kB");
        peak
    };
    FORMATS.iter().map(peak).collect()
}

#[test]
fn more_events_take_no_more_memory() {
    // Memory is full with the first 200,000 events. The words of the other 300,000 would take
    // 4,800 kB.
    for ((few, many), format) in peaks(200_000).iter().zip(peaks(500_000)).zip(FORMATS) {
        assert!(many < few + 3_000, "{format}: {few} kB, then {many} kB");
    }
}

/// Prints the figures of the documentation:
/// `cargo test --release --package dtof --test program ten_million -- --ignored --nocapture`.
#[test]
#[ignore = "prints figures; half a minute with --release, some minutes without"]
fn ten_million_events() {
    for (peak, format) in peaks(10_000_000).iter().zip(FORMATS) {
        assert!(*peak < 24_000, "{format}: {peak} kB");
    }
}
