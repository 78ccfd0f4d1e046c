//! Exports of small files. Bins are 40 mm wide and the pixels look along simple rays, so that every number can be worked
//! out by hand.

mod changes;
mod damage;
mod options;
mod points;
mod slices;

use std::fs;

use dtof_core::events::DynamicDepthEvent;
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{Array, BinPosition, BlockLevel, DepthEvent, Flags, LaserCycle, PixelAddress};
use dtof_data::events::fixtures;
use tempfile::TempDir;

use super::*;
use dtof_data::options::Named;

/// A bin is 266.8513 ps × 0.149896229 mm/ps = 40 mm, so the middle of bin 60 is at 60.5 × 40 mm + 80 mm = 2500 mm.
fn header() -> Header {
    Header {
        bins: 128,
        array: Array::new(3, 2).unwrap(),
        bin_width_ps: U16F16::lit("266.8513"),
        offset_mm: I24F8::lit("80"),
        offsets_mm: Vec::new(),
        laser_millihertz: 10_000_000_000,
        start_us: 0,
    }
}

/// Rays of its pixels. Ranges of pixels 2 and 5 are 500 mm too long.
const RAYS: &str = "columns = 3\nrows = 2\npixels = [\n\
    [0, 0, 1, 0],\n[3, 0, 4, 0],\n[0, -3, 4, 500],\n\
    [0, 0, 1, 0],\n[0, 0, 1, 0],\n[0, 3, 4, 500],\n]\n";

/// With [`RAYS`].
fn options() -> Options {
    Options {
        rays: RaySettings {
            calibration: Some("rays.toml".into()),
            ..RaySettings::default()
        },
        ..Options::default()
    }
}

/// A peak of 9 photons in the middle of a bin, of an exposure of 40 laser cycles.
fn depth(pixel: u16, cycle: u64, bin: u16) -> Event {
    Event::Depth(fixtures::event(pixel, cycle, bin))
}

/// The same with other fields.
fn depth_with(pixel: u16, cycle: u64, bin: u16, change: impl Fn(&mut DepthEvent)) -> Event {
    let mut event = fixtures::event(pixel, cycle, bin);
    change(&mut event);
    Event::Depth(event)
}

/// The same of the block of 2×2 pixels that begins at a pixel.
fn block(pixel: u16, cycle: u64, bin: u16) -> Event {
    depth_with(pixel, cycle, bin, |event| event.level = level(1))
}

fn level(level: u8) -> BlockLevel {
    BlockLevel::new(level).unwrap()
}

/// The mean of a pixel, or of the block of `level`, has moved by so many bins to the middle of a bin.
fn dynamic(pixel: u16, of_level: u8, cycle: u64, bin: i32, change: i32) -> Event {
    let event = DynamicDepthEvent::new(
        PixelAddress::new(pixel),
        level(of_level),
        LaserCycle::new(cycle),
        BinPosition::new(bin * 256 + 128).unwrap(),
        change * 256,
        Flags::NONE,
    );
    Event::DynamicDepth(event.unwrap())
}

fn file_with(header: &Header, events: &[Event]) -> Vec<u8> {
    fixtures::aer_file(header, "", events)
}

fn file(events: &[Event]) -> Vec<u8> {
    file_with(&header(), events)
}

/// The calibration file with [`RAYS`].
fn rays(folder: &TempDir) -> PathBuf {
    let path = folder.path().join("rays.toml");
    fs::write(&path, RAYS).unwrap();
    path
}

/// Exports `bytes` to a file, which is returned, or stays as it was. Messages name files without their folder.
fn try_export(
    bytes: &[u8],
    format: Format,
    options: &Options,
) -> Result<(ExportSummary, Vec<u8>), String> {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("events.aer"), bytes).unwrap();
    let rays = rays(&folder);
    fs::write(path("out"), format.mark()).unwrap();
    let mut options = options.clone();
    options.rays.calibration = options.rays.calibration.map(|_| rays);

    let result = export(&path("events.aer"), &path("out"), format, &options, &mut ());
    let out = fs::read(path("out")).unwrap();
    let names = fs::read_dir(folder.path()).unwrap();
    assert_eq!(names.count(), 3, "files were left");
    let prefix = path("").display().to_string();
    match result {
        Ok(mut summary) => {
            summary.assumptions = summary.assumptions.replace(&prefix, "");
            Ok((summary, out))
        }
        Err(error) => {
            assert_eq!(out, format.mark().as_bytes());
            Err(format!("{error:#}").replace(&prefix, ""))
        }
    }
}

#[test]
fn a_file_of_the_same_format_is_replaced_and_no_other() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("events.aer"), file(&[])).unwrap();
    let export = |format, out: &str| {
        let options = Options::default();
        export(&path("events.aer"), &path(out), format, &options, &mut ())
    };
    for (name, format, _) in Format::NAMES {
        export(*format, name).unwrap();
        export(*format, name).unwrap();
        for other in ["", "mine"] {
            fs::write(path("other"), other).unwrap();
            let refused = export(*format, "other").unwrap_err().to_string();
            assert!(refused.contains("other: is there and no "), "{refused}");
            assert_eq!(fs::read_to_string(path("other")).unwrap(), other);
        }
    }
}

fn exported(bytes: &[u8], format: Format, options: &Options) -> (ExportSummary, Vec<u8>) {
    try_export(bytes, format, options).unwrap()
}

fn refused(bytes: &[u8], format: Format, options: &Options) -> String {
    try_export(bytes, format, options).map(|_| ()).unwrap_err()
}

/// The lines of CSV below the header.
fn rows(bytes: &[u8], options: &Options) -> Vec<String> {
    let (summary, out) = exported(bytes, Format::Csv, options);
    let text = String::from_utf8(out).unwrap();
    let rows: Vec<String> = text.lines().skip(1).map(str::to_owned).collect();
    assert!(text.ends_with('\n'));
    assert_eq!(summary.written, rows.len() as u64);
    rows
}
