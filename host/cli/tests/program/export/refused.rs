//! `dtof export`: options that cannot be.

use crate::common::Scratch;
use crate::common::aer::{HEADER, depth, dynamic, events, file};

#[cfg(unix)]
#[test]
fn a_calibration_without_end_is_refused() {
    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &events()));
    scratch.all_refused(
        "export events.aer --format csv --out x",
        "--calibration /dev/zero | /dev/zero: more than 16777216 bytes",
    );
}

#[test]
fn options_that_cannot_be_are_refused_in_one_line() {
    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &events()));
    scratch.file(
        "calibration.toml",
        "columns = 64\nrows = 32\npixels = [\n]\n",
    );
    scratch.file("own.toml", "[sensor]\nbins = 128\n");
    scratch.file("truth.npy", "mine");
    scratch.file("late.aer", file(&HEADER, &[depth(0, 1 << 60, 5)]));
    scratch.file("changes.aer", file(&HEADER, &[dynamic(5, 3, 40, -3)]));
    std::fs::create_dir(scratch.path("folder")).unwrap();
    scratch.all_refused(
        "export",
        r#"
            events.aer --format csv | --out
            events.aer --out x | --format
            events.aer --format las --out x | las
            none.aer --format csv --out x | none.aer: No such file
            folder --format csv --out x | folder: is a folder
            events.aer --format csv --out folder | folder: exists and is not a file
            events.aer --format pcd --out truth.npy | truth.npy: is there and no PCD file; move it away
            events.aer --format csv --out own.toml | own.toml: is there and no CSV file; move it away
            events.aer --format csv --out /dev/null | is not a file
            events.aer --format csv --out ./events.aer | is an input file
            events.aer --format csv --settings own.toml --out own.toml | own.toml: is an input file
            events.aer --format csv --out= | --out
            events.aer --format csv --out x --fov 60 | HORIZONTALxVERTICAL
            events.aer --format csv --out x --fov 0x10 | HORIZONTALxVERTICAL
            events.aer --format csv --out x --laser-hz 0 | --laser-hz
            late.aer --format ply --out x | PLY holds 9007199 s of time
            events.aer --format csv --out x --slice-us 5 | --slice-us is only for mcap
            events.aer --format mcap --out x --slice-us 0 | --slice-us
            events.aer --format ply --out x --threshold-mm 3 | --threshold-mm is only for evt2
            events.aer --format mcap --out x --reference reported | --reference is only for evt2
            events.aer --format evt2 --out x --fov 60x40 | --fov is only for formats with points
            events.aer --format evt2 --out x --calibration none.toml | --calibration is only for formats with points
            events.aer --format mcap --out x --one-per-pixel | --one-per-pixel is only for csv, pcd and ply
            events.aer --format evt2 --out x --one-per-pixel | --one-per-pixel is only for csv, pcd and ply
            events.aer --format csv --out x --one-per-pixel=maybe | --one-per-pixel maybe: must be true or false
            changes.aer --format csv --out x --echo strongest | --echo is only for depth events
            events.aer --format csv --out x --echo second | --echo
            events.aer --format evt2 --out x --threshold-mm 0.004 | --threshold-mm 0.004: the threshold of dynamic
            events.aer --format evt2 --out x --threshold-mm -1 | --threshold-mm
            events.aer --format evt2 --out x --reference next | --reference
            own.toml --format csv --out x | own.toml: not an AER file
            changes.aer --format csv --out x --one-per-pixel | --one-per-pixel is only for depth events
            events.aer --format csv --out x --events dynamic-depth | 12 events, none of them a dynamic depth event
            events.aer --format csv --out x --calibration none.toml | none.toml: No such file
            events.aer --format csv --out x --calibration calibration.toml | calibration.toml: line 1: 0 pixels, should be 2048
            events.aer --format csv --out x --calibration calibration.toml --fov 60x40 | cannot be used with
        "#,
    );
    assert!(!scratch.path("x").exists());
}
