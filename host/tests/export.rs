//! `dtof export`: points, damaged files, options that cannot be.

mod common;

use common::Scratch;
use common::aer::{HEADER, byte_of, depth, dynamic, file, folder};
use dtof::aer_file::{Event, EventKind};
use dtof::export::{Exported, Format, Options, export};

/// Exports `bytes`, and gives what was written.
fn exported(bytes: &[u8], format: Format, options: &Options) -> (Exported, Vec<u8>) {
    let scratch = Scratch::new();
    let input = scratch.file("events.aer", bytes);
    let out = scratch.path("out");
    let exported = export(&input, &out, format, options, true).unwrap();
    let written = std::fs::read(out).unwrap();
    assert_eq!(folder(&scratch.path("")).len(), 2, "files were left");
    (exported, written)
}

/// Twelve events, one of them in the laser cycle of another time word.
fn events() -> Vec<Event> {
    let near = (0..11).map(|index| depth(index * 150, u64::from(index) * 13, 20 + index));
    near.chain([depth(2047, 1 << 20, 60)]).collect()
}

/// A record: x, y, z, value, pixel, flags, time.
fn record(bytes: &[u8]) -> ([f32; 4], u16, u8, f64) {
    let four = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    (
        [four(0), four(4), four(8), four(12)],
        u16::from_le_bytes(bytes[16..18].try_into().unwrap()),
        bytes[18],
        f64::from_le_bytes(bytes[19..27].try_into().unwrap()),
    )
}

#[test]
fn csv_has_time_and_point_before_the_columns_of_decode() {
    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &events()));
    let output = scratch.dtof(&[
        "export",
        "events.aer",
        "--format",
        "csv",
        "--out",
        "points.csv",
    ]);
    assert!(output.status.success());
    assert_eq!(output.stdout, b"points.csv: 12 events\n");
    let decoded = String::from_utf8(scratch.dtof(&["decode", "events.aer"]).stdout).unwrap();
    let text = scratch.read("points.csv");
    let cut = |line: &str| line.splitn(5, ',').nth(4).unwrap().to_owned();
    let rest: Vec<String> = text.lines().map(cut).collect();
    assert_eq!(rest, decoded.lines().collect::<Vec<_>>());
    assert!(text.starts_with("time_us,x_m,y_m,z_m,cycle,pixel,"));

    // Pixel 0 of 64×32: 31.5 columns and 15.5 rows from the middle, 60 degrees over 64.
    let first: Vec<f64> = text
        .lines()
        .nth(1)
        .unwrap()
        .split(',')
        .take(4)
        .map(|n| n.parse().unwrap())
        .collect();
    let focal = 32.0 / 30f64.to_radians().tan();
    let ray = [-31.5, -15.5, focal]
        .map(|side: f64| side / (31.5f64 * 31.5 + 15.5 * 15.5 + focal * focal).sqrt());
    let metres = ((20.0 + 100.0 / 256.0) * 250.0 * 0.149_896_229 - 12.5) / 1000.0;
    assert_eq!(first[0], 0.0);
    for (is, ray) in first[1..].iter().zip(ray) {
        assert!(
            (is - ray * metres).abs() < 1e-5,
            "{is} and {}",
            ray * metres
        );
    }
    let last = text.lines().last().unwrap();
    assert!(last.starts_with("104857.600,"), "{last}");
}

#[test]
fn pcd_and_ply_hold_the_same_records() {
    let bytes = file(&HEADER, &events());
    let (exported_pcd, pcd) = exported(&bytes, Format::Pcd, &Options::default());
    let (_, ply) = exported(&bytes, Format::Ply, &Options::default());
    let (_, csv) = exported(&bytes, Format::Csv, &Options::default());
    assert_eq!((exported_pcd.written, exported_pcd.damage), (12, None));
    let pcd_header = "\
# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z intensity pixel flags t_ns
SIZE 4 4 4 4 2 1 8
TYPE F F F F U U F
COUNT 1 1 1 1 1 1 1
WIDTH 12
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS 12
DATA binary
";
    let ply_header = "\
ply
format binary_little_endian 1.0
comment metres, x to the right, y down, z forward
element vertex 12
property float x
property float y
property float z
property float intensity
property ushort pixel
property uchar flags
property double t_ns
end_header
";
    let pcd = pcd.strip_prefix(pcd_header.as_bytes()).unwrap();
    let ply = ply.strip_prefix(ply_header.as_bytes()).unwrap();
    assert_eq!(pcd, ply);
    assert_eq!(pcd.len(), 12 * 27);
    let csv = String::from_utf8(csv).unwrap();
    for ((bytes, event), line) in pcd.chunks(27).zip(events()).zip(csv.lines().skip(1)) {
        let ([x, y, z, intensity], pixel, flags, time) = record(bytes);
        let columns: Vec<&str> = line.split(',').collect();
        let point = [1, 2, 3].map(|index| columns[index].parse::<f32>().unwrap());
        assert_eq!([x, y, z], point);
        assert_eq!((intensity, pixel, flags), (37.0, event.pixel().0, 4));
        assert_eq!(time, event.cycle().0 as f64 * 100.0);
    }
}

#[test]
fn changes_of_depth_are_points_at_the_mean() {
    let events = [dynamic(5, 3, 40, -3), dynamic(6, 9, 10, 2)];
    let (_, pcd) = exported(&file(&HEADER, &events), Format::Pcd, &Options::default());
    let (_, csv) = exported(&file(&HEADER, &events), Format::Csv, &Options::default());
    let header = String::from_utf8_lossy(&pcd);
    assert!(
        header.contains("FIELDS x y z change pixel flags t_ns"),
        "{header}"
    );
    let ([x, y, z, change], pixel, ..) = record(&pcd[pcd.len() - 54..]);
    let metres = (40.0 * 250.0 * 0.149_896_229 - 12.5) / 1000.0;
    assert!((f64::from(x.hypot(y).hypot(z)) - metres).abs() < 1e-5);
    assert!((change + 0.112_422).abs() < 1e-5 && pixel == 5, "{change}");
    assert!(
        csv.starts_with(b"time_us,x_m,y_m,z_m,cycle,pixel,polarity,range_mm,change_mm,flags\n")
    );
}

#[test]
fn a_file_of_both_kinds_needs_to_be_told_which() {
    let bytes = file(
        &HEADER,
        &[depth(0, 1, 9), dynamic(1, 2, 9, 1), depth(2, 3, 9)],
    );
    for (kind, written) in [(EventKind::Depth, 2), (EventKind::DynamicDepth, 1)] {
        let options = Options {
            kind: Some(kind),
            ..Options::default()
        };
        assert_eq!(exported(&bytes, Format::Ply, &options).0.written, written);
    }
    let scratch = Scratch::new();
    scratch.file("events.aer", bytes);
    let output = scratch.dtof(&[
        "export",
        "events.aer",
        "--format",
        "ply",
        "--out",
        "out/x.ply",
    ]);
    scratch.refused(&output, &["there is no folder out"]);
    let output = scratch.dtof(&["export", "events.aer", "--format", "ply", "--out", "x.ply"]);
    scratch.refused(
        &output,
        &["2 depth events and 1 dynamic depth events", "--events"],
    );
    assert!(!scratch.path("x.ply").exists());
}

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
        assert_eq!(bytes.len() - header.unwrap() - end.len(), said * 27);
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

#[test]
fn what_comes_before_the_end_of_a_cut_file_is_exported_whole() {
    let whole = file(&HEADER, &events());
    // A time word, eleven events, a time word, an event, the end word.
    assert_eq!(whole.len(), byte_of(15));
    for format in FORMATS {
        for length in 64..whole.len() {
            let (exported, written) = exported(&whole[..length], format, &Options::default());
            let words = (length - 64) / 16;
            let events = words.saturating_sub(1) - usize::from(words >= 13);
            assert_eq!(exported.written, events as u64, "{length} bytes");
            assert_eq!(points(format, &written), events as u64);
            let damage = exported.damage.unwrap();
            assert!(
                damage.starts_with(&format!("byte {}: ", byte_of(words))),
                "{damage}"
            );
        }
    }
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
                ["byte 288: ", "bytes follow"],
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
    let output = scratch.dtof(&["export", "cut.aer", "--format", "csv", "--out", "x.csv"]);
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
        let output = scratch.dtof(&["export", "events.aer", "--format", "pcd", "--out", "x.pcd"]);
        scratch.refused(&output, &["events.aer: ", part]);
        assert_eq!(scratch.read("x.pcd"), "kept");
        assert_eq!(folder(&scratch.path("")).len(), 2);
    }
}

#[test]
fn options_that_cannot_be_are_refused_in_one_line() {
    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &events()));
    scratch.file(
        "calibration.toml",
        "columns = 64\nrows = 32\npixels = [\n]\n",
    );
    scratch.file("late.aer", file(&HEADER, &[depth(0, 1 << 60, 5)]));
    std::fs::create_dir(scratch.path("folder")).unwrap();
    for (arguments, part) in [
        (&["events.aer", "--format", "csv"][..], "--out"),
        (&["events.aer", "--out", "x"], "--format"),
        (&["events.aer", "--format", "las", "--out", "x"], "las"),
        (
            &["none.aer", "--format", "csv", "--out", "x"],
            "none.aer: No such file",
        ),
        (
            &["folder", "--format", "csv", "--out", "x"],
            "folder: not a file",
        ),
        (
            &["events.aer", "--format", "csv", "--out", "folder"],
            "folder: is there, and is no file",
        ),
        (
            &["events.aer", "--format", "csv", "--out", "/dev/null"],
            "is no file",
        ),
        (
            &["events.aer", "--format", "csv", "--out", "./events.aer"],
            "is the file that is read",
        ),
        (
            &["events.aer", "--format", "csv", "--out", "x", "--fov", "60"],
            "HORIZONTALxVERTICAL",
        ),
        (
            &[
                "events.aer",
                "--format",
                "csv",
                "--out",
                "x",
                "--fov",
                "0x10",
            ],
            "HORIZONTALxVERTICAL",
        ),
        (
            &[
                "events.aer",
                "--format",
                "csv",
                "--out",
                "x",
                "--laser-hz",
                "0",
            ],
            "--laser-hz",
        ),
        (
            &["late.aer", "--format", "ply", "--out", "x"],
            "PLY holds 9007199 s of time",
        ),
        (
            &[
                "events.aer",
                "--format",
                "csv",
                "--out",
                "x",
                "--calibration",
                "none.toml",
            ],
            "none.toml: No such file",
        ),
        (
            &[
                "events.aer",
                "--format",
                "csv",
                "--out",
                "x",
                "--calibration",
                "calibration.toml",
            ],
            "calibration.toml: line 1: 0 pixels, should be 2048",
        ),
        (
            &[
                "events.aer",
                "--format",
                "csv",
                "--out",
                "x",
                "--calibration",
                "calibration.toml",
                "--fov",
                "60x40",
            ],
            "cannot be used with",
        ),
    ] {
        let output = scratch.dtof(&[&["export"], arguments].concat());
        scratch.refused(&output, &[part]);
        assert!(!scratch.path("x").exists());
    }
}
