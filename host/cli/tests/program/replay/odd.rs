//! Files that other programs made, and that are not what they seem.

use crate::common::{Scratch, assert_contains, npy, succeeded};

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
    for command in [
        "replay --out out",
        "replay --decide-once --out out",
        "calibrate --out x.toml",
    ] {
        let output = scratch.run(&format!("{command} --input unix.csv"));
        let part = "unix.csv: the first photon comes in laser cycle 1,700,000,000";
        scratch.refused(&output, &[part]);
    }
    scratch.replayed(&dark, "--decide-once --rule window --sigma-bins 1");
    // The laser cycles that are replayed have no photon: a warning.
    let unix = scratch.path("unix.csv");
    let output = scratch.replay(&unix, "--l1 40 --cycles 10000");
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
    scratch.file("counts.npy", npy("|u1", "(2, 2, 16)", &[1; 64]));
    scratch.all_refused(
        "replay",
        "
            twice.csv --out out | twice.csv:1: the header must have the columns pixel, cycle and bin once | not pixel twice
            counts.npy --out= | --out
            counts.npy --out out --settings= | --settings
            --input= --out out | --input
        ",
    );
}
