//! Counters of 8 bits, end to end.

use crate::common::{Scratch, assert_contains};

/// A wall that is dim beside the background `b` a bin and laser cycle.
fn scene(b: f64) -> String {
    format!(
        "columns = 4\nrows = 4\ncycles = 3000\nbackground = {b}\n[[surface]]\nsignal = 0.3\nposition_bins = 60.5\n"
    )
}

#[test]
fn events_are_those_of_10_bits_until_a_counter_is_full() {
    let scratch = Scratch::new();
    let dim = scratch.file("dim.toml", scene(0.02));
    scratch.simulated(&dim, "");
    let of_10_bits = scratch.read("out/events.csv");
    assert!(of_10_bits.lines().count() > 100);
    scratch.simulated(&dim, "--counter-bits 8");
    assert_eq!(scratch.read("out/events.csv"), of_10_bits);
    let summary = scratch.summary();
    assert_eq!(summary["settings"]["counter_bits"], 8);
    assert_eq!(
        (&summary["ended_full"], &summary["saturated"]),
        (&0.into(), &0.into())
    );
    assert_contains(&scratch.read("out/dtof.toml"), "counter_bits = 8");

    // A bright background fills them before the wall stands clear.
    let bright = scratch.file("bright.toml", scene(1.0));
    scratch.simulated(&bright, "--counter-bits 8 --rule window --window 3");
    let summary = scratch.summary();
    let count = |key: &str| summary[key].as_u64().unwrap();
    assert!(count("ended_full") > 50 && count("saturated") > 50);
    scratch.simulated(&bright, "--rule window --window 3");
    assert_eq!(scratch.summary()["ended_full"], 0);
}
