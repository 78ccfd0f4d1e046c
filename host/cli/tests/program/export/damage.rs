//! `dtof export` of files that are damaged, or are no AER files.

use std::ops::Range;

use dtof_core::Array;

use super::event_camera::{evt2, mcap};
use crate::common::aer::{HEADER, below, byte_of, depth, dynamic, events, exported, file};
use crate::common::{Scratch, assert_contains, names};
use dtof_events::aer_file::{Event, Header};
use dtof_export::{Format, Options};

/// Number of points of a file, which must agree with its header.
fn points(format: Format, bytes: &[u8]) -> u64 {
    let text = String::from_utf8_lossy(bytes);
    let count = |key: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(key));
        line.unwrap().parse::<usize>().unwrap()
    };
    let records = |end: &str, count: usize| {
        assert_eq!(below(bytes, end).len(), count * 31);
        count
    };
    let points = match format {
        Format::Csv => {
            assert!(text.ends_with('\n'));
            text.lines().count() - 1
        }
        Format::Pcd => records("DATA binary\n", count("POINTS ")),
        Format::Ply => records("end_header\n", count("element vertex ")),
        _ => panic!("{format:?} has a test of its own"),
    };
    points as u64
}

const FORMATS: [Format; 3] = [Format::Csv, Format::Pcd, Format::Ply];

/// Cuts the file of `events` at each byte. Its last event follows a time word of its own.
fn cut_anywhere(events: &[Event], formats: &[Format], count: impl Fn(Format, &[u8]) -> u64) {
    let whole = file(&HEADER, events);
    // A time word, all events but one, a time word, an event, the end word.
    assert_eq!(whole.len(), byte_of(events.len() + 3));
    for length in 64..whole.len() {
        let words = (length - 64) / 16;
        let before = words.saturating_sub(1) - usize::from(words > events.len());
        for &format in formats {
            let (exported, out) = exported(&whole[..length], format, &Options::default());
            let written = [exported.written, count(format, &out)];
            assert_eq!(written, [before as u64; 2], "{length} bytes");
            let damage = exported.damage.unwrap();
            let place = format!("byte {}: ", byte_of(words));
            assert!(damage.starts_with(&place), "{damage}");
        }
    }
}

#[test]
fn what_comes_before_the_end_of_a_cut_file_is_exported_whole() {
    cut_anywhere(&events(), &FORMATS, points);
    let count = |format, out: &[u8]| match format {
        Format::Evt2 => evt2(out).len() as u64,
        _ => mcap(out).0,
    };
    let near = (0..9).map(|index| dynamic(index * 200, u64::from(index) * 5000, 40, 1));
    let changes: Vec<Event> = near.chain([dynamic(2047, 1 << 20, 60, -1)]).collect();
    cut_anywhere(&changes, &[Format::Evt2, Format::Mcap], count);
}

#[test]
fn damage_is_named_with_its_byte_after_the_events_before_it_are_written() {
    let whole = file(&HEADER, &events());
    let changed = |at: usize, to: u8| {
        let mut bytes = whole.clone();
        bytes[byte_of(5) + at] = to;
        bytes
    };
    let longer = [&whole[..], &[0]].concat();
    for format in FORMATS {
        for (bytes, written, parts) in [
            (&changed(7, 0xc0), 4, ["byte 144: ", "unknown kind"]),
            // Pixel 65,280 of 2,048.
            (&changed(1, 0xff), 4, ["byte 144: pixel ", " of 2048"]),
            // One photon more, which only the checksum detects.
            (&changed(8, 38), 12, ["byte 288: ", "checksum"]),
            (&longer, 12, ["byte 304: ", "bytes follow"]),
            // Bin 152 of 128: the peak bin has bits 52-61.
            (&changed(7, 0x49), 4, ["byte 144: bin 152", " of 128"]),
        ] {
            let (exported, out) = exported(bytes, format, &Options::default());
            assert_eq!((exported.written, points(format, &out)), (written, written));
            let damage = exported.damage.unwrap();
            assert_contains(&damage, parts[0]);
            assert_contains(&damage, parts[1]);
        }
    }
}

#[test]
fn the_program_says_what_is_damaged_and_fails() {
    let scratch = Scratch::new();
    scratch.file("cut.aer", &file(&HEADER, &events())[..100]);
    let output = scratch.run("export cut.aer --format csv --out x.csv");
    scratch.refused(
        &output,
        &["cut.aer: byte 96: the file ends inside a word; x.csv has the 1 events before the damage"],
    );
    assert_eq!(scratch.read("x.csv").lines().count(), 2);
}

#[test]
fn what_is_no_aer_file_leaves_the_output_as_it_was() {
    let scratch = Scratch::new();
    scratch.file("x.pcd", "kept");
    let with = |bytes: Range<usize>, value| {
        let mut file = file(&HEADER, &events());
        file[bytes].fill(value);
        file
    };
    for (bytes, part) in [
        (&b""[..], "not an AER file"),
        (&[0; 200], "not an AER file"),
        (b"cycle,pixel\n", "not an AER file"),
        (&with(8..9, 3), "AER version 3; this program reads 4 to 6"),
        (&with(8..9, 7), "AER version 7"),
        (&with(16..17, 0), "0x32 pixels"),
        (&with(16..24, 0xff), "4294967295x4294967295 pixels"),
        (&with(24..28, 0), "bin width is zero"),
    ] {
        scratch.file("events.aer", bytes);
        scratch.refused(
            &scratch.run("export events.aer --format pcd --out x.pcd"),
            &["events.aer: ", part],
        );
        assert_eq!(scratch.read("x.pcd"), "kept");
        assert_eq!(names(&scratch.path("")).len(), 2);
    }
}

#[test]
fn what_comes_before_a_time_that_is_damaged_is_exported_whole() {
    let mut events: Vec<Event> = (0..1000).map(|cycle| dynamic(7, cycle, 40, 1)).collect();
    events.push(dynamic(7, 1 << 20, 40, 1));
    events.push(dynamic(7, 1 << 21, 40, 1));
    let mut bytes = file(&HEADER, &events);
    // A time word, 1,000 events, a time word: 2^60 laser cycles.
    bytes[byte_of(1001) + 13] = 0x10;
    let formats = [Format::Pcd, Format::Ply, Format::Mcap, Format::Evt2];
    for (format, name) in formats.into_iter().zip(["PCD", "PLY", "MCAP", "EVT2"]) {
        // The other events may be there or not.
        for bytes in [&bytes[..], &bytes[..byte_of(1003)]] {
            let (exported, _) = exported(bytes, format, &Options::default());
            assert_eq!(exported.written, 1000);
            let damage = exported.damage.unwrap();
            assert_contains(
                &damage,
                "byte 16080: laser cycle 1152921504607895552 lies beyond",
            );
            assert_contains(&damage, name);
        }
    }
    // CSV has any time, so only the checksum detects this.
    let (exported, _) = exported(&bytes, Format::Csv, &Options::default());
    assert_eq!(exported.written, 1002);
    assert!(exported.damage.unwrap().contains("checksum"));
}

#[test]
fn a_whole_file_of_times_that_the_format_cannot_hold_is_refused() {
    let scratch = Scratch::new();
    let late = file(&HEADER, &[depth(0, 5, 5), depth(0, 1 << 60, 5)]);
    scratch.file("late.aer", late);
    scratch.all_refused(
        "export late.aer --format pcd",
        "--out x.pcd | late.aer: laser cycle 1152921504606846976 lies beyond",
    );
    assert!(!scratch.path("x.pcd").exists());
}

#[test]
fn what_export_takes_for_damage_decode_does_too() {
    let beyond = Header { bins: 32, ..HEADER };
    let mut narrow = HEADER;
    narrow.array = Array::new(8, 2).unwrap();
    let scratch = Scratch::new();
    for (header, event, part) in [
        (&beyond, depth(0, 2, 32), "bin 32 of 32"),
        (&beyond, dynamic(0, 2, 33, 1), "bin 33 of 32"),
        (&narrow, depth(16, 2, 5), "pixel 16 of 16"),
        (&narrow, dynamic(16, 2, 5, 1), "pixel 16 of 16"),
    ] {
        let first = match event {
            Event::Depth(_) => depth(15, 1, 31),
            // The mean of positions that lie in the bin after the peak.
            Event::DynamicDepth(_) => dynamic(15, 1, 32, 1),
        };
        scratch.file("events.aer", file(header, &[first, event]));
        let part = format!("events.aer: byte 96: {part}");
        for line in ["export --format csv --out x.csv", "decode"] {
            let output = scratch.run(&format!("{line} events.aer"));
            scratch.refused(&output, &[&part]);
        }
        assert_eq!(scratch.read("x.csv").lines().count(), 2);
    }
}

#[test]
fn an_interrupted_export_leaves_no_output() {
    let scratch = Scratch::new();
    let events: Vec<Event> = (0..1_000_000).map(|cycle| depth(7, cycle, 40)).collect();
    scratch.file("events.aer", file(&HEADER, &events));
    let mut dtof = scratch.command("export events.aer --format csv --out x.csv");
    let mut child = dtof.spawn().unwrap();
    // It fails only when it writes.
    while !names(&scratch.path(""))
        .iter()
        .any(|name| name.ends_with(".partial"))
    {
        assert!(child.try_wait().unwrap().is_none(), "ended too early");
    }
    child.kill().unwrap();
    assert!(!child.wait().unwrap().success());
    assert!(!scratch.path("x.csv").exists());
}
