//! The options that choose the rule and the estimator, end to end.

use std::fmt::Write;
use std::path::PathBuf;

use crate::common::{Scratch, assert_contains};
use serde_json::Value;

/// A pulse over bins 60 and 61, and a background photon every third laser cycle.
fn photons(scratch: &Scratch) -> PathBuf {
    let mut text = "pixel,cycle,bin\n".to_owned();
    for cycle in 0..1000 {
        let signal = 60 + cycle % 2;
        writeln!(text, "0,{cycle},{signal}").unwrap();
        if cycle % 3 == 0 {
            writeln!(text, "0,{cycle},{}", cycle * 7 % 128).unwrap();
        }
    }
    scratch.file("photons.csv", text)
}

/// A settings file that leaves all to the defaults.
const DEFAULTS: &str = "--settings defaults.toml";

/// The settings in the summary, and the events. An empty settings file, unless one is given, makes the defaults hold.
#[track_caller]
fn replayed(options: &str) -> (Value, String) {
    let scratch = Scratch::new();
    scratch.file("defaults.toml", "");
    let has_file = options.contains("--settings");
    let options = format!("{options} {}", if has_file { "" } else { DEFAULTS });
    let summary = scratch.replayed(&photons(&scratch), &options);
    (summary["settings"].clone(), scratch.read("out/events.csv"))
}

#[test]
fn the_defaults_are_the_papers_rule_and_centroid() {
    let (settings, events) = replayed("--min-count 5");
    assert_eq!(settings["rule"], "paper");
    assert_eq!(settings["estimator"], "centroid");
    assert_eq!(settings["alpha"], 4.0);
    for name in ["window", "z", "sigma_bins"] {
        assert!(settings.get(name).is_none(), "{name}");
    }
    assert_eq!(replayed("--rule paper --alpha 4").1, events);
}

/// A pulse has equal half widths. Others give the same events at other depths. A pulse from an
/// option replaces the half widths of a file.
#[test]
fn half_widths_move_the_depth() {
    let (settings, even) = replayed("--half-widths 2.5,2.5");
    assert_eq!(settings["estimator"], "centred-window");
    assert_eq!(settings["half_widths"], serde_json::json!([2.5, 2.5]));
    assert_eq!(even, replayed("--rule paper --sigma-bins 1").1);
    let (settings, skew) = replayed("--half-widths 1,4");
    assert_eq!(settings["half_widths"], serde_json::json!([1.0, 4.0]));
    assert_eq!(skew.lines().count(), even.lines().count());
    assert_ne!(skew, even);
    // They may be combined with a pulse.
    assert_eq!(replayed("--half-widths 1,4 --sigma-bins 1").1, skew);

    let scratch = Scratch::new();
    let file = scratch.file(
        "dtof.toml",
        "[sensor]\nsigma_bins = 1\n[detection]\nhalf_widths = [1, 4]\n",
    );
    let with = |options: &str| replayed(&format!("--settings {} {options}", file.display())).1;
    assert_eq!(with(""), skew);
    // The file's own pulse changes nothing, another has windows of its own.
    assert_eq!(with("--sigma-bins 1"), skew);
    let other = replayed("--rule paper --sigma-bins 0.9").1;
    assert_eq!(with("--sigma-bins 0.9"), other);
    assert_eq!(
        with("--estimator centroid"),
        replayed("--estimator centroid").1
    );
}

/// The peak has 44 of the 59 photons of 44 laser cycles in two bins: the average of 128 is
/// 0.46, which is 0 as a whole count; the two quadrants have a photon in each.
#[test]
fn the_average_rule_takes_alpha() {
    let (settings, events) = replayed("--rule average --alpha 6");
    assert_eq!(
        (&settings["rule"], &settings["alpha"]),
        (&"average".into(), &6.0.into())
    );
    let background = |events: &str| {
        let first = events.lines().nth(1).unwrap();
        first.split(',').nth(7).unwrap().to_owned()
    };
    assert_eq!(background(&events), "0");
    assert_eq!(background(&replayed("--rule paper --alpha 6").1), "1");
}

#[test]
fn the_pulse_chooses_estimator_and_window() {
    let (settings, events) = replayed("--rule window --sigma-bins 1 --l1 4");
    assert_eq!(settings["rule"], "window");
    assert_eq!(settings["window"], 3);
    assert_eq!(settings["estimator"], "centred-window");
    assert_eq!(settings["sigma_bins"], 1.0);
    assert!(settings.get("alpha").is_none());
    // The pulse lies evenly about 61.
    assert!(events.lines().count() > 50);
    assert_contains(&events, ",61.0000,");

    // The same with the paper's rule. An explicit window stays.
    let (settings, _) = replayed("--rule paper --sigma-bins 1");
    assert_eq!(settings["rule"], "paper");
    assert_eq!(settings["sigma_bins"], 1.0);
    let (settings, _) = replayed("--rule window --sigma-bins 1 --window 5");
    assert_eq!(settings["window"], 5);
    let (settings, _) = replayed("--rule window --window 5");
    assert_eq!(settings["estimator"], "centroid");
}

#[test]
fn the_summary_says_how_to_do_it_again() {
    for options in [
        "--rule window --sigma-bins 0.7 --false-alarm 0.003 --l1 8",
        "--rule window --window 4 --z 3.1 --l1 8",
        "--sigma-bins 1.3 --alpha 3.3 --l1 8",
    ] {
        let (settings, events) = replayed(options);
        let mut again = format!("--l1 8 --rule {}", settings["rule"].as_str().unwrap());
        for name in ["alpha", "window", "z", "sigma_bins"] {
            if let Some(value) = settings.get(name) {
                write!(again, " --{} {value}", name.replace('_', "-")).unwrap();
            }
        }
        assert_eq!(replayed(&again), (settings, events), "{again}");
    }
}

#[test]
fn what_was_used_is_in_the_report() {
    let scratch = Scratch::new();
    let options = "--rule window --sigma-bins 1 --z 4.5";
    scratch.replay(&photons(&scratch), options);
    for part in ["window of 3 bins", "4.5 standard deviations", "±2.5 bins"] {
        assert_contains(&scratch.read("out/report.html"), part);
    }
}

#[test]
fn options_that_contradict_each_other_are_refused_in_one_line() {
    let scratch = Scratch::new();
    photons(&scratch);
    scratch.file("defaults.toml", "");
    scratch.all_refused(
        &format!("replay --input photons.csv --out out {DEFAULTS}"),
        r#"
            --rule window --window 3 --alpha 4 | --alpha is for --rule paper or average; --rule window takes --z or --false-alarm
            --rule window --window -1 | --window -1: must be a whole number from 1 to 7
            --rule window --window 3 --false-alarm 1e-9 | --false-alarm 0.000000001 | no z for so few
            --sigma-bins -1 | --sigma-bins -1: must be a number above 0
            --rule window --window 3 --gate 100..200 | --gate 100..200 | 128 bins
            --rule window --window 3 --bins 100 | --bins 100: must be a power of two
        "#,
    );
}
