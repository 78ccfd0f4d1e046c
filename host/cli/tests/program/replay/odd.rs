//! Files that other programs made, and that are not what they seem.

use std::io::{Cursor, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::common::{Scratch, assert_contains, npy, succeeded};

/// An archive with the array `counts`, not compressed.
fn archive(array: &[u8]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    zip.start_file("counts.npy", stored).unwrap();
    zip.write_all(array).unwrap();
    zip.finish().unwrap().into_inner()
}

fn counts() -> Vec<u8> {
    let bytes: Vec<u8> = (0..4 * 16)
        .map(|at| 1 + 99 * u8::from(at % 16 == 7))
        .collect();
    npy("|u1", "(2, 2, 16)", &bytes)
}

#[test]
fn a_damaged_archive_is_refused() {
    let scratch = Scratch::new();
    let whole = archive(&counts());
    scratch.replayed(&scratch.file("whole.npz", &whole), "--l1 40");
    std::fs::remove_dir_all(scratch.path("out")).unwrap();
    // A bit of a count that only the checksum shows.
    let mut damaged = whole.clone();
    let at = damaged
        .windows(4)
        .position(|four| four == [1, 1, 100, 1])
        .unwrap();
    damaged[at] ^= 4;
    scratch.file("damaged.npz", damaged);
    // Method 12, bzip2, in both headers of the entry.
    let mut bzip = whole;
    for (mark, method) in [(b"PK\x03\x04", 8), (b"PK\x01\x02", 10)] {
        let at = bzip.windows(4).position(|four| four == mark).unwrap();
        bzip[at + method] = 12;
    }
    scratch.file("bzip.npz", bzip);
    scratch.all_refused(
        "replay --out out --l1 40 --input",
        "
            damaged.npz | damaged.npz: array counts: the archive is damaged
            bzip.npz | bzip.npz: array counts: its compression | is not known here
        ",
    );
}

#[test]
fn times_are_no_laser_cycles() {
    let scratch = Scratch::new();
    let list = |name: &str, cycle: &dyn Fn(u64) -> u64| {
        let rows = (0..2000).map(|row| format!("{},{},60\n", row % 2, cycle(row)));
        let text: String = rows.collect();
        scratch.file(name, format!("pixel,cycle,bin\n{text}"))
    };
    list("unix.csv", &|row| 1_700_000_000 + row);
    let dark = list("dark.csv", &|row| row * 100);
    for command in ["replay --decide-once --out out", "calibrate --out x.toml"] {
        let output = scratch.run(&format!("{command} --input unix.csv"));
        let part = "unix.csv: the first photon comes in laser cycle 1,700,000,000";
        scratch.refused(&output, &[part]);
    }
    scratch.replayed(&dark, "--decide-once --rule window --sigma-bins 1");
    // The laser cycles that are replayed have no photon: a warning.
    let unix = scratch.path("unix.csv");
    let output = scratch.replay(&unix, "--l1 40");
    assert_contains(
        &String::from_utf8_lossy(&output.stderr),
        "the first comes in laser cycle 1,700,000,000; if these are times",
    );
    succeeded(output);
}

#[test]
fn what_is_odd_is_named() {
    let scratch = Scratch::new();
    scratch.file("twice.csv", "pixel,cycle,bin,Pixel\n0,0,0,0\n");
    scratch.file("four.npy", npy("<u4", "(3, 4)", &[0; 48]));
    let mut negative = counts();
    let at = negative.windows(3).position(|part| part == b"(2,").unwrap();
    negative[at..at + 5].copy_from_slice(b"(-2,2");
    scratch.file("negative.npy", negative);
    scratch.file("counts.npy", counts());
    scratch.all_refused(
        "replay",
        "
            twice.csv --out out | twice.csv:1: the header must have the columns pixel, cycle and bin once | not pixel twice
            four.npy --out out | four.npy: 4 bins: must be from 8 to 4096; | photons are rows of three
            negative.npy --out out | negative.npy: not an .npy file | the shape (-2,2
            counts.npy --out= | --out
            counts.npy --out out --settings= | --settings
            --input= --out out | --input
        ",
    );
}
