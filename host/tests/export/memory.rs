//! The memory that `dtof export` takes does not grow with the file.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::Duration;

use crate::common::Scratch;
use crate::common::aer::{HEADER, depth};
use dtof::events::aer_file::Writer;

const FORMATS: [&str; 6] = ["csv", "csv --echo strongest", "pcd", "ply", "mcap", "evt2"];

/// A file of so many events from all pixels, a change of depth each now and then.
fn write(path: &Path, events: u64) {
    let out = BufWriter::new(File::create(path).unwrap());
    let mut writer = Writer::new(out, &HEADER).unwrap();
    for (index, pixel) in (0..events).zip((0..2048).cycle()) {
        let bin = if index / 2048 % 8 < 4 { 30 } else { 70 };
        writer.write(&depth(pixel, index, bin)).unwrap();
    }
    writer.finish().unwrap().flush().unwrap();
}

/// The most memory a process had, in kB, as long as it ran.
fn peak_kb(mut child: Child) -> u64 {
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0;
    loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        if let Some(kb) = line.and_then(|line| line.trim().strip_suffix(" kB")) {
            peak = kb.parse().unwrap();
        }
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success() && peak > 0);
            return peak;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// The most memory each format took to export so many events, in kB.
fn peaks(events: u64) -> Vec<u64> {
    let scratch = Scratch::new();
    write(&scratch.path("events.aer"), events);
    let peak = |format: &&str| {
        let mut dtof = scratch.command(&format!("export events.aer --format {format} --out out"));
        let peak = peak_kb(dtof.stdout(Stdio::null()).spawn().unwrap());
        println!("{events} events as {format}: at most {peak} kB");
        peak
    };
    FORMATS.iter().map(peak).collect()
}

#[test]
fn five_times_the_events_take_no_more_memory() {
    // All that is ever held is there with the first 200,000. To hold the 800,000 others
    // as the words they came as would take 12,800 kB.
    for ((few, many), format) in peaks(200_000).iter().zip(peaks(1_000_000)).zip(FORMATS) {
        assert!(many < few + 3_000, "{format}: {few} kB, then {many} kB");
    }
}

/// Prints the figures of the documentation: `cargo test --release --test export memory -- --ignored
/// --nocapture`.
#[test]
#[ignore = "prints figures; half a minute with --release, some minutes without"]
fn ten_million_events() {
    for (peak, format) in peaks(10_000_000).iter().zip(FORMATS) {
        assert!(*peak < 24_000, "{format}: {peak} kB");
    }
}
