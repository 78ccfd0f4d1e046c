//! Photons of one laser cycle in one bin count once, end to end.

use std::fmt::Write;
use std::path::PathBuf;

use crate::common::{Scratch, assert_contains, npy};

/// A target in bin 70 gives a photon in every 16th laser cycle, the background one in each, and every
/// 50th laser cycle a raindrop gives ten in bin 20 and as many in bin 21. `bright` photons more come in
/// bin 70.
fn photons(scratch: &Scratch, bright: u32) -> PathBuf {
    let mut text = "pixel,cycle,bin\n".to_owned();
    let mut photon = |cycle: u32, bin: u32| writeln!(text, "0,{cycle},{bin}").unwrap();
    for cycle in 0..4000 {
        photon(cycle, cycle * 37 % 128);
        if cycle % 16 == 0 {
            photon(cycle, 70);
        }
        (0..bright).for_each(|_| photon(cycle, 70));
        if cycle % 50 == 0 {
            (0..20).for_each(|number| photon(cycle, 20 + number / 10));
        }
    }
    scratch.file("defaults.toml", "");
    scratch.file("photons.csv", text)
}

/// Nothing is searched.
const WINDOW: &str = "--settings defaults.toml --bin-width-ps 250 --rule window --window 3 --sigma-bins 1 --columns 1";

/// The positions of all events.
fn positions(scratch: &Scratch) -> Vec<f64> {
    let events = scratch.events();
    events
        .iter()
        .map(|event| event[4].parse().unwrap())
        .collect()
}

#[test]
fn rain_makes_no_events() {
    let scratch = Scratch::new();
    let input = photons(&scratch, 0);
    let is_drop = |&position: &f64| position < 30.0;
    let summary = scratch.replayed(&input, WINDOW);
    assert!(positions(&scratch).iter().any(is_drop));
    assert_eq!(summary["repeated"], 0);

    let options = format!("replay --out out --input photons.csv {WINDOW} --once-per-bin");
    let printed = scratch.printed(&options);
    let summary = scratch.summary();
    let found = positions(&scratch);
    assert!(found.len() > 10 && !found.iter().any(is_drop), "{found:?}");
    // Of each drop 18 photons, and a few of the target with one of the background.
    let repeated = summary["repeated"].as_u64().unwrap();
    assert!((1440..1480).contains(&repeated), "{repeated}");
    assert_eq!(summary["settings"]["once_per_bin"], true);
    assert_eq!(summary["warnings"], serde_json::json!([]));
    // The summary names them.
    assert_contains(&printed, " after the first of a bin");
    let report = scratch.read("out/report.html");
    assert_contains(&report, "those of one laser cycle in one bin count once");
}

#[test]
fn a_target_that_is_too_bright_is_warned_of() {
    let scratch = Scratch::new();
    let input = photons(&scratch, 1);
    let summary = scratch.replayed(&input, &format!("{WINDOW} --once-per-bin"));
    assert_eq!(summary["warnings"].as_array().unwrap().len(), 1);
    assert_contains(&summary["warnings"].to_string(), "pixel 0 1.07 in bin 70");
    // It is of no concern otherwise.
    let summary = scratch.replayed(&input, WINDOW);
    assert_eq!(summary["warnings"], serde_json::json!([]));
}

/// A histogram does not say which photons came in one laser cycle.
#[test]
fn histograms_refuse_it() {
    let scratch = Scratch::new();
    photons(&scratch, 0);
    let counts = 3u16.to_le_bytes().repeat(4 * 128);
    scratch.file("array.npy", npy("<u2", "(2, 2, 128)", &counts));
    scratch.file("once.toml", "[detection]\nonce_per_bin = true\n");
    scratch.all_refused(
        "replay --out out --input array.npy",
        "
        --once-per-bin | --once-per-bin needs photons: a histogram does not say
        --settings once.toml | once_per_bin needs photons
        ",
    );
    scratch.all_refused(
        "compare --out out --input array.npy --recorded-cycles 1000",
        "--once-per-bin | --once-per-bin needs photons",
    );
    scratch.all_refused(
        "replay --out out --input photons.csv",
        "
        --once-per-bin=perhaps | --once-per-bin perhaps: must be true or false
        --once-per-bin --frame 100 | cannot be used with --once-per-bin
        ",
    );
    // Switched off, the file is for histograms as well.
    scratch.replayed(
        &scratch.path("array.npy"),
        "--settings once.toml --once-per-bin=false",
    );
}
