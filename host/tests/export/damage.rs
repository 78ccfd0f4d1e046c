//! `dtof export` of files that are damaged, or are no AER files.

use super::event_camera::{changes, evt2, mcap};
use crate::common::Scratch;
use crate::common::aer::{HEADER, byte_of, depth, dynamic, events, exported, file, folder};
use dtof::events::aer_file::{Event, Header};
use dtof::export::{Format, Options};
use dtof::input::source::Geometry;

/// How many whole points a file holds, which must be as many as it says.
fn points(format: Format, bytes: &[u8]) -> u64 {
    let text = String::from_utf8_lossy(bytes);
    let said = |key: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(key));
        line.unwrap().parse::<usize>().unwrap()
    };
    let records = |end: &str, said: usize| {
        let header = bytes
            .windows(end.len())
            .position(|part| part == end.as_bytes());
        assert_eq!(bytes.len() - header.unwrap() - end.len(), said * 29);
        said
    };
    let points = match format {
        Format::Csv => {
            assert!(text.ends_with('\n'));
            text.lines().count() - 1
        }
        Format::Pcd => records("DATA binary\n", said("POINTS ")),
        Format::Ply => records("end_header\n", said("element vertex ")),
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
    cut_anywhere(&changes(), &[Format::Evt2, Format::Mcap], count);
}

#[test]
fn damage_is_named_with_its_byte_after_the_events_before_it_are_written() {
    let whole = file(&HEADER, &events());
    let changed = |at: usize, to: u8| {
        let mut bytes = whole.clone();
        bytes[at] = to;
        bytes
    };
    for format in FORMATS {
        for (bytes, written, parts) in [
            (
                changed(byte_of(5) + 7, 0xc0),
                4,
                ["byte 144: ", "unknown kind"],
            ),
            // Pixel 65,280 of 2,048.
            (
                changed(byte_of(5) + 1, 0xff),
                4,
                ["byte 144: pixel ", " of 2048"],
            ),
            // A photon more, which only the checksum knows.
            (changed(byte_of(5) + 8, 38), 12, ["byte 288: ", "checksum"]),
            (
                [&whole[..], &[0]].concat(),
                12,
                ["byte 304: ", "bytes follow"],
            ),
            // Bin 152 of 128: the peak bin has bits 52-61.
            (
                changed(byte_of(5) + 7, 0x49),
                4,
                ["byte 144: bin 152", " of 128"],
            ),
        ] {
            let (exported, out) = exported(&bytes, format, &Options::default());
            assert_eq!((exported.written, points(format, &out)), (written, written));
            let damage = exported.damage.unwrap();
            assert!(parts.iter().all(|part| damage.contains(part)), "{damage}");
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
        &["cut.aer: byte 96: the file ends inside a word; x.csv holds what came before: 1 events"],
    );
    assert_eq!(scratch.read("x.csv").lines().count(), 2);
}

#[test]
fn what_is_no_aer_file_leaves_the_output_as_it_was() {
    let scratch = Scratch::new();
    scratch.file("x.pcd", "kept");
    let whole = file(&HEADER, &events());
    let mut other_version = whole.clone();
    other_version[8] = 9;
    let mut no_pixels = whole.clone();
    no_pixels[16] = 0;
    let mut many_pixels = whole.clone();
    many_pixels[16..24].fill(0xff);
    let mut no_bins = whole.clone();
    no_bins[24..28].fill(0);
    for (bytes, part) in [
        (&b""[..], "not an AER file"),
        (&[0; 200], "not an AER file"),
        (b"cycle,pixel\n", "not an AER file"),
        (&other_version, "AER version 9"),
        (&no_pixels, "0x32 pixels"),
        (&many_pixels, "4294967295x4294967295 pixels"),
        (&no_bins, "bin width is zero"),
    ] {
        scratch.file("events.aer", bytes);
        scratch.refused(
            &scratch.run("export events.aer --format pcd --out x.pcd"),
            &["events.aer: ", part],
        );
        assert_eq!(scratch.read("x.pcd"), "kept");
        assert_eq!(folder(&scratch.path("")).len(), 2);
    }
}

#[test]
fn what_comes_before_a_time_that_is_damaged_is_exported_whole() {
    let mut events: Vec<Event> = (0..1000).map(|cycle| dynamic(7, cycle, 40, 1)).collect();
    events.push(dynamic(7, 1 << 20, 40, 1));
    events.push(dynamic(7, 1 << 21, 40, 1));
    let mut bytes = file(&HEADER, &events);
    // A time word, 1,000 events, a time word: 2^60 laser cycles.
    bytes[byte_of(1001) + 13] = 1;
    for (format, name) in [
        (Format::Pcd, "PCD"),
        (Format::Ply, "PLY"),
        (Format::Mcap, "MCAP"),
        (Format::Evt2, "EVT2"),
    ] {
        // The rest may be there, or not.
        for bytes in [&bytes[..], &bytes[..byte_of(1003)]] {
            let (exported, _) = exported(bytes, format, &Options::default());
            assert_eq!(exported.written, 1000);
            let damage = exported.damage.unwrap();
            let parts = [
                "byte 16080: laser cycle 1152921504607895552 lies beyond",
                name,
            ];
            assert!(parts.iter().all(|part| damage.contains(part)), "{damage}");
        }
    }
    // CSV holds any time: only the checksum knows.
    let (exported, _) = exported(&bytes, Format::Csv, &Options::default());
    assert_eq!(exported.written, 1002);
    assert!(exported.damage.unwrap().contains("checksum"));
}

#[test]
fn a_whole_file_of_times_that_the_format_cannot_hold_is_refused() {
    let scratch = Scratch::new();
    scratch.file(
        "late.aer",
        file(&HEADER, &[depth(0, 5, 5), depth(0, 1 << 60, 5)]),
    );
    scratch.refused(
        &scratch.run("export late.aer --format pcd --out x.pcd"),
        &["late.aer: laser cycle 1152921504606846976 lies beyond"],
    );
    assert!(!scratch.path("x.pcd").exists());
}

#[test]
fn what_export_takes_for_damage_decode_does_too() {
    let beyond = Header { bins: 32, ..HEADER };
    let narrow = Header {
        geometry: Geometry::new(8, 2),
        ..HEADER
    };
    let scratch = Scratch::new();
    for (header, event, part) in [
        (beyond, depth(0, 2, 32), "bin 32 of 32"),
        (beyond, dynamic(0, 2, 33, 1), "bin 33 of 32"),
        (narrow, depth(16, 2, 5), "pixel 16 of 16"),
        (narrow, dynamic(16, 2, 5, 1), "pixel 16 of 16"),
    ] {
        let first = match event {
            Event::Depth(_) => depth(15, 1, 31),
            // The mean of positions that lie in the bin after the peak.
            Event::DynamicDepth(_) => dynamic(15, 1, 32, 1),
        };
        scratch.file("events.aer", file(&header, &[first, event]));
        for arguments in [
            &["export", "events.aer", "--format", "csv", "--out", "x.csv"][..],
            &["decode", "events.aer"],
        ] {
            let output = scratch.dtof(arguments);
            scratch.refused(&output, &[&format!("events.aer: byte 96: {part}")]);
        }
        assert_eq!(scratch.read("x.csv").lines().count(), 2);
    }
}

#[test]
fn an_interrupted_export_leaves_no_output() {
    let scratch = Scratch::new();
    let events: Vec<Event> = (0..1_000_000).map(|cycle| depth(7, cycle, 40)).collect();
    scratch.file("events.aer", file(&HEADER, &events));
    let mut dtof = std::process::Command::new(env!("CARGO_BIN_EXE_dtof"));
    dtof.current_dir(scratch.path(""));
    dtof.args(["export", "events.aer", "--format", "csv", "--out", "x.csv"]);
    let mut child = dtof.spawn().unwrap();
    let is_partial = |path: &std::path::PathBuf| path.extension().is_some_and(|is| is == "partial");
    // Not before it writes.
    while !folder(&scratch.path("")).iter().any(is_partial) {
        assert!(child.try_wait().unwrap().is_none(), "ended too early");
    }
    child.kill().unwrap();
    assert!(!child.wait().unwrap().success());
    assert!(!scratch.path("x.csv").exists());
}
