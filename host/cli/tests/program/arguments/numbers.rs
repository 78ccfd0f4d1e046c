//! Numbers, names and devices of the command line: read alike by every command, and refused in
//! one line.

use std::fs::File;
use std::path::PathBuf;

use crate::common::aer::{HEADER, events, file};
use crate::common::{Scratch, table};

const PHOTONS: &str = "pixel,cycle,bin\n0,0,0\n";

#[test]
fn numbers_may_have_exponents() {
    let scratch = Scratch::new();
    let scene = scratch.file(
        "scene.toml",
        "columns = 4\ncycles = 10\n[[surface]]\nrange_mm = 1000\nsignal = 1\n",
    );
    let run = |arguments: &str| {
        scratch.simulated(&scene, arguments);
        (scratch.read("out/events.csv"), scratch.summary())
    };
    let plain = run(
        "--cycles 2000 --alpha 4.5 --l1 40 --l2 1000 --x 8 --min-count 6 --gate 8..100 \
                     --array 2x1 --seed 12 --sigma-bins 1",
    );
    let other = run(
        "--cycles 2e3 --alpha 45e-1 --l1 4E1 --l2 1e+3 --x 8.0 --min-count 0.6e1 \
                     --gate 8..1e2 --array 2x1e0 --seed 1.2e1 --sigma-bins 1e0",
    );
    assert!(plain.0.lines().count() > 10);
    assert_eq!(plain, other);
}

/// A negative number is a value, not an option.
#[test]
fn numbers_that_cannot_be_are_refused_in_one_line() {
    let scratch = Scratch::new();
    scratch.file("photons.csv", PHOTONS);
    scratch.all_refused(
        "replay --out out --input photons.csv",
        "
            --rule window --window -1 | --window -1: must be a whole number from 1 to 7
            --sigma-bins=-1 | --sigma-bins -1: must be a number above 0, at most 1.75
        ",
    );
}

#[test]
fn standard_input_and_output_are_no_files_of_that_name() {
    let scratch = Scratch::new();
    for row in table(
        "
            --input | replay --input - --out out
            --out | replay --input photons.csv --out -
            --scene | simulate --scene - --out out
            --out | simulate --scene scene.toml --out -
            --out | demo --out -
            <FILE> | export - --format csv --out x
            --out | export events.aer --format csv --out -
            --calibration | export events.aer --format csv --out x --calibration -
            --record | monitor --device tcp:localhost:1 --record -
        ",
    ) {
        let reason = "standard input and output are not supported here";
        scratch.refused(&scratch.run(&row[1]), &[&row[0], reason]);
    }
    assert!(!scratch.path("-").exists());
}

#[test]
fn decode_reads_standard_input() {
    let scratch = Scratch::new();
    let aer = scratch.file("events.aer", file(&HEADER, &events()));
    let decode = |input: PathBuf| {
        let input = File::open(input).unwrap();
        scratch.command("decode -").stdin(input).output().unwrap()
    };
    let output = decode(aer);
    assert!(output.status.success());
    let of_file = scratch.run("decode events.aer");
    assert_eq!(output.stdout, of_file.stdout);
    let output = decode(scratch.file("photons.csv", PHOTONS));
    scratch.refused(&output, &["error: standard input: not an AER file"]);
}

#[test]
fn the_help_of_monitor_has_no_option_that_it_refuses() {
    let scratch = Scratch::new();
    let help = |command| scratch.printed(&format!("{command} --help"));
    assert!(help("replay").contains("--frame") && help("simulate").contains("--frame"));
    assert!(!help("monitor").contains("--frame"));
}

#[test]
fn a_serial_port_that_is_not_there_is_answered_with_those_that_are() {
    let scratch = Scratch::new();
    for command in [
        "monitor",
        "demo --cycles 10 --out out",
        "calibrate --out dtof.toml",
    ] {
        let output = scratch.run(&format!("{command} --device /dev/ttyNOWHERE"));
        scratch.refused(
            &output,
            &[
                "error: /dev/ttyNOWHERE: No",
                "serial port",
                "or use tcp:HOST:PORT or qemu",
            ],
        );
    }
}

#[test]
fn a_command_line_without_its_file_says_what_it_takes() {
    let scratch = Scratch::new();
    for (line, reason) in [
        ("replay", "<FILE> is needed"),
        ("decode", "<FILE> is needed"),
        ("view", "<FILE.aer> is needed"),
        (
            "calibrate --out dtof.toml",
            "--input is needed, or --device",
        ),
        ("compare --out out", "--input is needed, or --scene"),
        (
            "simulate scene.toml",
            "scene.toml is not expected here: a scene is given by --scene",
        ),
        ("demo scene.toml", "scene.toml is not expected here"),
    ] {
        let output = scratch.run(line);
        assert_eq!(output.status.code(), Some(2), "{line}");
        scratch.refused(&output, &[format!("error: {reason}\n")]);
    }
}

#[test]
fn a_recording_is_named_once() {
    let scratch = Scratch::new();
    for (line, other) in [
        ("replay a.npy --input b.npy", "--input"),
        ("calibrate a.npy --out dtof.toml --input b.npy", "--input"),
        ("calibrate a.npy --out dtof.toml --device qemu", "--device"),
        (
            "calibrate --input a.npy --out dtof.toml --device qemu",
            "--device",
        ),
        ("compare a.npy --out out --input b.npy", "--input"),
        ("compare a.npy --out out --scene b.toml", "--scene"),
        ("compare --input a.npy --out out --scene b.toml", "--scene"),
    ] {
        scratch.refused(&scratch.run(line), &["cannot be used with", other]);
    }
}

/// A switch has its value behind `=`. Names of files need not be UTF-8.
#[test]
fn a_value_that_stands_alone_is_refused_with_how_to_write_it() {
    let scratch = Scratch::new();
    scratch.file("photons.csv", PHOTONS);
    for line in [
        "replay photons.csv --tracking true",
        "replay --tracking true photons.csv",
    ] {
        scratch.refused(&scratch.run(line), &["write --tracking=true"]);
    }
    let line = "replay photons.csv --alpha --l1";
    scratch.refused(
        &scratch.run(line),
        &["--alpha --l1: is a flag, not a value"],
    );
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        let mut command = scratch.command("replay photons.csv");
        let name = std::ffi::OsStr::from_bytes(b"x\xff");
        let output = command.arg(name).output().unwrap();
        scratch.refused(&output, &["is not expected here: one file at a time"]);
    }
}
