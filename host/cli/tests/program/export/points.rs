//! `dtof export`: points, kinds of event, the result line, links.

use crate::common::aer::{HEADER, depth, dynamic, events, exported, file};
use crate::common::{Scratch, assert_contains, table};
use dtof_core::{Array, BlockLevel, PixelAddress};
use dtof_events::aer_file::EventKind;
use dtof_export::{Format, Options};
use dtof_photons::geometry::Rays;

/// A record: x, y, z, value, pixel; flags, level, echo; time.
fn record(bytes: &[u8]) -> ([f32; 4], u32, [u8; 3], f64) {
    let four = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    (
        [four(0), four(4), four(8), four(12)],
        u32::from_le_bytes(bytes[16..20].try_into().unwrap()),
        [bytes[20], bytes[21], bytes[22]],
        f64::from_le_bytes(bytes[23..31].try_into().unwrap()),
    )
}

#[test]
fn csv_has_time_and_point_before_the_columns_of_decode() {
    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &events()));
    let printed = scratch.printed("export events.aer --format csv --out points.csv");
    assert_eq!(printed, "points.csv: 12 events (60x32.2 degrees, 10 MHz)\n");
    let decoded = scratch.printed("decode events.aer");
    let text = scratch.read("points.csv");
    let cut = |line: &str| line.splitn(5, ',').nth(4).unwrap().to_owned();
    let rest: Vec<String> = text.lines().map(cut).collect();
    assert_eq!(rest, decoded.lines().collect::<Vec<_>>());
    assert!(text.starts_with("time_us,x_m,y_m,z_m,cycle,pixel,"));

    // Pixel 0 of 64×32: 31.5 columns and 15.5 rows from the middle, 60 degrees over 64.
    let first = text.lines().nth(1).unwrap().split(',').take(4);
    let first: Vec<f64> = first.map(|cell| cell.parse().unwrap()).collect();
    let focal = 32.0 / 30f64.to_radians().tan();
    let ray = [-31.5, -15.5, focal]
        .map(|side: f64| side / (31.5f64 * 31.5 + 15.5 * 15.5 + focal * focal).sqrt());
    let metres = ((20.0 + 100.0 / 256.0) * 250.0 * 0.149_896_229 - 12.5) / 1000.0;
    assert_eq!(first[0], 0.0);
    for (is, ray) in first[1..].iter().zip(ray) {
        let expected = ray * metres;
        assert!((is - expected).abs() < 1e-5, "{is} and {expected}");
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
FIELDS x y z intensity pixel flags level echo t_ns
SIZE 4 4 4 4 4 1 1 1 8
TYPE F F F F U U U U F
COUNT 1 1 1 1 1 1 1 1 1
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
property uint pixel
property uchar flags
property uchar level
property uchar echo
property double t_ns
end_header
";
    let pcd = pcd.strip_prefix(pcd_header.as_bytes()).unwrap();
    let ply = ply.strip_prefix(ply_header.as_bytes()).unwrap();
    assert_eq!(pcd, ply);
    assert_eq!(pcd.len(), 12 * 31);
    let csv = String::from_utf8(csv).unwrap();
    for ((bytes, event), line) in pcd.chunks(31).zip(events()).zip(csv.lines().skip(1)) {
        let ([x, y, z, intensity], pixel, flags, time) = record(bytes);
        let columns: Vec<&str> = line.split(',').collect();
        let point = [1, 2, 3].map(|index| columns[index].parse::<f32>().unwrap());
        assert_eq!([x, y, z], point);
        assert_eq!(
            (intensity, pixel, flags),
            (37.0, event.pixel().raw().into(), [4, 0, 1])
        );
        assert_eq!(time, event.cycle().raw() as f64 * 100.0);
    }
}

#[test]
fn changes_of_depth_are_points_at_the_mean() {
    let events = [dynamic(5, 3, 40, -3), dynamic(6, 9, 10, 2)];
    let (_, pcd) = exported(&file(&HEADER, &events), Format::Pcd, &Options::default());
    let (_, csv) = exported(&file(&HEADER, &events), Format::Csv, &Options::default());
    let header = String::from_utf8_lossy(&pcd);
    assert_contains(&header, "FIELDS x y z change pixel flags level echo t_ns");
    let ([x, y, z, change], pixel, ..) = record(&pcd[pcd.len() - 62..]);
    let metres = (40.0 * 250.0 * 0.149_896_229 - 12.5) / 1000.0;
    assert!((f64::from(x.hypot(y).hypot(z)) - metres).abs() < 1e-5);
    assert!((change + 0.112_422).abs() < 1e-5 && pixel == 5, "{change}");
    let columns = b"time_us,x_m,y_m,z_m,cycle,pixel,polarity,range_mm,change_mm,flags,level\n";
    assert!(csv.starts_with(columns));
}

#[test]
fn a_file_of_both_kinds_needs_to_be_told_which() {
    let events = [depth(0, 1, 9), dynamic(1, 2, 9, 1), depth(2, 3, 9)];
    let bytes = file(&HEADER, &events);
    for (kind, written) in [(EventKind::Depth, 2), (EventKind::DynamicDepth, 1)] {
        let options = Options {
            kind: Some(kind),
            ..Options::default()
        };
        assert_eq!(exported(&bytes, Format::Ply, &options).0.written, written);
    }
    let scratch = Scratch::new();
    scratch.file("events.aer", bytes);
    scratch.all_refused(
        "export events.aer --format ply",
        "
            --out out/x.ply | there is no folder out
            --out x.ply | 2 depth events and 1 dynamic depth events | --events
        ",
    );
    assert!(!scratch.path("x.ply").exists());
}

#[test]
fn the_result_line_says_what_points_and_times_rest_on() {
    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &events()));
    scratch.file("none.aer", file(&HEADER, &[]));
    let rays = "[0, 0, 1, 0],\n".repeat(2048);
    let calibration = format!("columns = 64\nrows = 32\npixels = [\n{rays}]\n");
    scratch.file("rays.toml", calibration);
    // The run lasts 105 ms, or no time.
    for row in table(
        "
            events.aer --format ply --fov 45x24.5 | 12 events (45x24.5 degrees, 10 MHz)
            events.aer --format pcd --calibration rays.toml | 12 events (rays.toml, 10 MHz)
            events.aer --format evt2 --laser-hz 12500 | 0 events (12.5 kHz)
            events.aer --format mcap | 12 events (60x32.2 degrees, 10 MHz, clouds every 1049 µs)
            events.aer --format mcap --slice-us 5 | clouds every 5 µs)
            none.aer --format mcap --events depth | 0 events (60x32.2 degrees, 10 MHz, clouds every 10 µs)
        ",
    ) {
        let line = format!("export --out x {}", row[0]);
        let printed = scratch.printed(&line);
        assert!(printed.starts_with("x: "), "{printed}");
        assert!(printed.ends_with(&format!("{}\n", row[1])), "{printed}");
        assert_eq!(scratch.printed(&format!("{line} --quiet")), "");
    }
}

#[cfg(unix)]
#[test]
fn a_link_stays_and_what_it_leads_to_is_replaced() {
    use std::os::unix::fs::symlink;

    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &events()));
    scratch.file("folder/points.csv", "old");
    symlink("folder/points.csv", scratch.path("link.csv")).unwrap();
    symlink("folder/none.csv", scratch.path("lost.csv")).unwrap();
    scratch.printed("export events.aer --format csv --out link.csv");
    assert!(scratch.path("link.csv").is_symlink());
    assert_eq!(scratch.read("folder/points.csv").lines().count(), 13);
    let lost = scratch.run("export events.aer --format csv --out lost.csv");
    scratch.refused(&lost, &["lost.csv: is a broken link"]);
    assert!(scratch.path("lost.csv").is_symlink());
}

#[test]
fn the_calibration_of_the_documentation_is_one() {
    let docs = include_str!("../../../../../docs/export.md");
    let (_, rest) = docs.split_once("```toml\n").unwrap();
    let (text, _) = rest.split_once("```").unwrap();
    let scratch = Scratch::new();
    let rays = Rays::read(&scratch.file("rays.toml", text), Array::new(2, 1).unwrap()).unwrap();
    // Its second pixel measures 12.5 mm too little.
    let point = rays.point(PixelAddress::new(1), BlockLevel::PIXEL, 987.5);
    let length = point.unwrap().iter().map(|side| side * side).sum::<f64>();
    assert!((length - 1.0).abs() < 1e-12, "{length}");
}

#[test]
fn the_commands_of_the_readme_run() {
    let scratch = Scratch::new();
    scratch.file("out/demo/events.aer", file(&HEADER, &events()));
    let readme = include_str!("../../../../../README.md");
    let start = "cargo run --release -- export out/demo/";
    let mut commands = 0;
    for line in readme.lines().filter(|line| line.starts_with(start)) {
        let arguments: Vec<&str> = line.split_whitespace().skip(4).collect();
        scratch.printed(&arguments.join(" "));
        assert!(scratch.path(arguments[arguments.len() - 1]).exists());
        commands += 1;
    }
    assert_eq!(commands, 1);
}
