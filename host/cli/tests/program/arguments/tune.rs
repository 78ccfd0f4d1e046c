//! `dtof tune` as a user runs it.

use crate::common::{Scratch, assert_contains};
use serde_json::Value;

/// What `dtof tune` prints with the options in `line`.
#[track_caller]
fn text(line: &str) -> String {
    Scratch::new().printed(&format!("tune {line}"))
}

#[track_caller]
fn json(line: &str) -> Value {
    serde_json::from_str(&text(&format!("{line} --json"))).unwrap()
}

fn value(result: &Value, name: &str) -> f64 {
    result[name]["value"].as_f64().unwrap()
}

/// Each row: options, and parts of the expected refusal.
#[track_caller]
fn refused(rows: &str) {
    let rows = rows.replace("PIXEL", PIXEL).replace("WINDOW", WINDOW);
    Scratch::new().all_refused("tune", &rows);
}

#[track_caller]
fn every_line_has_a_source(results: &str) {
    for line in results.lines() {
        let sources = ["formula: ", "simulation: "];
        assert!(sources.iter().any(|source| line.contains(source)), "{line}");
    }
}

const PIXEL: &str = "--background 0.05 --signal 0.4 --sigma-bins 0.8";

#[test]
fn every_line_says_where_it_comes_from() {
    let text = text(&format!("{PIXEL} --laser-hz 1e7"));
    let (results, options) = text.split_once("\n\n").unwrap();
    every_line_has_a_source(results);
    for part in "seed 1|exposures a point|Eq. 11|mm rms|laser cycles| s ".split('|') {
        assert_contains(results, part);
    }
    // `dtof replay` accepts them.
    assert!(
        options.starts_with("--rule paper --estimator centroid --alpha "),
        "{options}"
    );
    assert_eq!(options.lines().count(), 1);
    let l1 = options.split_whitespace().nth(7).unwrap();
    assert!(l1.parse::<u16>().unwrap() > 0);
}

#[test]
fn the_options_it_prints_are_options_of_replay() {
    let text = text(PIXEL);
    let options = text.lines().last().unwrap();
    let scratch = Scratch::new();
    let photons = scratch.file("photons.csv", "pixel,cycle,bin\n0,1,2\n");
    let summary = scratch.replayed(&photons, options);
    let result = json(PIXEL);
    for name in ["alpha", "l1"] {
        let setting = summary["settings"][name].as_f64();
        assert_eq!(setting, Some(value(&result, name)), "{name}");
    }
}

/// A histogram that differs from the default of `replay` is printed.
#[test]
fn the_histogram_is_one_of_the_options() {
    let last = |line: &str| text(line).lines().last().unwrap().to_owned();
    let other = last(&format!("{PIXEL} --bins 64 --bin-width-ps 500"));
    assert!(other.ends_with(" --bins 64 --bin-width-ps 500"), "{other}");
    assert!(!last(PIXEL).contains("--bins"));
}

#[test]
fn fewer_false_alarms_take_a_higher_alpha_and_longer() {
    let fixed = format!("{PIXEL} --l1 80");
    let often = json(&format!("{fixed} --false-alarm 0.1"));
    let seldom = json(&format!("{fixed} --false-alarm 0.0001"));
    assert!(value(&often, "alpha") < value(&seldom, "alpha"));
    assert!(value(&often, "cycles_to_event") < value(&seldom, "cycles_to_event"));
    for (result, requested) in [(&often, 0.1), (&seldom, 0.0001)] {
        let found = value(result, "false_alarms");
        assert!(found <= requested);
        assert!(value(result, "at_least") <= found && found <= value(result, "at_most"));
        // A multiple of 1/256.
        assert_eq!((value(result, "alpha") * 256.0).fract(), 0.0);
    }
    // Too rare for the table: the bound is used, and printed.
    for (result, start) in [
        (seldom, "formula: upper bound"),
        (often, "simulation: table"),
    ] {
        let source = result["false_alarms"]["source"].as_str().unwrap();
        assert!(source.starts_with(start), "{source}");
    }
}

#[test]
fn snr_and_picoseconds_say_the_same() {
    // A = SNR·√(B/L2) = 80 · √(0.05/2000); 200 ps are 0.8 bins.
    let one = json("--background 0.05 --signal 0.4 --sigma-bins 0.8");
    let other = json("--background 0.05 --snr 80 --sigma-ps 200");
    assert_eq!(value(&one, "alpha"), value(&other, "alpha"));
    assert_eq!(value(&one, "l1"), value(&other, "l1"));
    assert!((value(&other, "snr") - 80.0).abs() < 1e-9);
    let [one, other] = [one, other].map(|result| value(&result, "cycles_to_event"));
    assert!((one / other - 1.0).abs() < 1e-3);
}

#[test]
fn false_alarms_a_second_depend_on_the_laser() {
    // 0.01 an exposure of 2000 laser cycles at 1 MHz are 5 a second.
    let rate = "--false-alarms-per-second 5 --laser-hz 1e6";
    let result = json(&format!("{PIXEL} --l1 40 {rate}"));
    let requested = json(&format!("{PIXEL} --l1 40 --false-alarm 0.01"));
    // A little higher, as exposures with an event are shorter.
    let [higher, alpha] = [result.clone(), requested].map(|result| value(&result, "alpha"));
    assert!(alpha <= higher && higher < alpha + 0.05, "{alpha} {higher}");
    let seconds = value(&result, "seconds_to_event") * 1e6;
    assert!((seconds - value(&result, "cycles_to_event")).abs() < 1e-6);
}

#[test]
fn other_numbers_of_bins_are_bounded_by_formula() {
    let result = json(&format!("{PIXEL} --bins 32"));
    let source = result["alpha"]["source"].as_str().unwrap();
    assert!(source.contains("formula: upper bound"), "{source}");
}

#[test]
fn what_cannot_be_met_is_refused_in_one_line() {
    refused(
        "
            --background 0.05 --signal 0.001 --sigma-bins 0.8 | the signal is too weak | L2 = 2000
            --background 1 --signal 1 --sigma-bins 0.8 | fills the 10-bit counters | lower --l2 to 860
            --background 1e300 --signal 1 --sigma-bins 0.8 | fills the 10-bit counters
            --background 0.05 --signal 1e12 --sigma-bins 0.8 | fills a 10-bit counter within a laser cycle
            --background 0.01 --signal 1 --sigma-bins 0.8 --min-count 1 --l1 8 --false-alarm 1e-9 | no α | --min-count
            PIXEL --l1 2000 | L2 must be greater than L1
            PIXEL --l1 3 | X must not be greater than L1
            PIXEL --l2 8 | --l2 8 | greater than 2 X
            PIXEL --bins 100 | --bins | power of two
            PIXEL --false-alarm 1 | less than 1
            --background 0.05 --signal 1 --sigma-bins 100 | does not fit 128 bins
        ",
    );
    // Large values give one short line, without useless advice.
    for line in [
        "--background 1e308 --signal 1 --sigma-bins 0.8",
        "--background 0.05 --signal 1e308 --sigma-bins 0.8",
        "--background 0.05 --signal 1 --sigma-bins 1e308",
        "--background 0.05 --signal 1 --sigma-ps 1e308 --bin-width-ps 1e-300",
    ] {
        let output = Scratch::new().run(&format!("tune {line}"));
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success(), "{line}");
        assert!(error.len() < 160 && !error.contains("--l2"), "{error}");
    }
}

#[test]
fn options_that_are_missing_or_no_numbers_are_named() {
    refused(
        "
            | error: needed: --background; --signal or --snr; --sigma-bins or --sigma-ps
            --background 0.05 --sigma-bins 1 | --signal
            --background 0.05 --signal 1 | --sigma-bins
            --signal 1 --sigma-bins 1 | --background
            PIXEL --snr 5 | --snr | --signal
            PIXEL --false-alarms-per-second 1 | --laser-hz
        ",
    );
    for bad in ["0", "-1", "nan", "inf", "x"] {
        let options = format!("--background={bad} --signal 1 --sigma-bins 1");
        refused(&format!("{options} | --background | a number above 0"));
    }
}

const WINDOW: &str = "--background 0.05 --signal 0.4 --sigma-bins 0.8 --rule window";

#[test]
fn the_window_rule_has_a_z_a_window_and_an_estimator() {
    let text = text(WINDOW);
    let (results, options) = text.split_once("\n\n").unwrap();
    every_line_has_a_source(results);
    assert!(!results.contains('α'), "{results}");
    let scratch = Scratch::new();
    let photons = scratch.file("photons.csv", "pixel,cycle,bin\n0,1,2\n");
    let settings = &scratch.replayed(&photons, options)["settings"];
    let result = json(WINDOW);
    for name in ["z", "window", "l1"] {
        let value = value(&result, name);
        assert_eq!(settings[name].as_f64(), Some(value), "{name}");
    }
    assert_eq!(settings["rule"], "window");
    assert_eq!(settings["estimator"], "centred-window");
    // 0.8 to the nearest 1/256, and twice that and 1/2.
    assert_eq!(settings["sigma_bins"], 205.0 / 256.0);
    assert_eq!(value(&result, "half_width"), 538.0 / 256.0);
    assert_eq!(value(&result, "window"), 3.0);
}

const AVERAGE: &str = "--background 0.05 --signal 0.4 --sigma-bins 0.8 --rule average";

#[test]
fn the_average_rule_has_an_alpha_by_simulation() {
    let text = text(AVERAGE);
    let options = text.lines().last().unwrap();
    let scratch = Scratch::new();
    let photons = scratch.file("photons.csv", "pixel,cycle,bin\n0,1,2\n");
    let settings = &scratch.replayed(&photons, options)["settings"];
    let result = json(AVERAGE);
    assert_eq!(settings["rule"], "average");
    assert_eq!(settings["alpha"].as_f64(), Some(value(&result, "alpha")));
    assert_eq!(settings["l1"].as_f64(), Some(value(&result, "l1")));
    // Of 4,000 exposures, 1 % and three standard deviations.
    assert!(value(&result, "false_alarms") < 0.015, "{text}");
    refused("PIXEL --false-alarm 1e-7 --rule average | no α found for a false alarm in 10000000");
}

#[test]
fn z_is_that_of_the_core_and_keeps_false_alarms_down() {
    let gate = dtof_core::RangeGate::<128>::full();
    for one_in in [10, 100, 1000] {
        let requested = 1.0 / f64::from(one_in);
        let result = json(&format!("{WINDOW} --l1 40 --false-alarm {requested}"));
        let z = dtof_core::z_for(one_in, &gate, 4, 40, 2000).to_num::<f64>();
        assert_eq!(value(&result, "z"), z);
        // `z_for`: 0.4 to 1.2 times as many; 4 standard deviations of 4000 exposures.
        let deviation = (requested / 4000.0).sqrt();
        let found = value(&result, "false_alarms");
        let source = result["false_alarms"]["source"].as_str().unwrap();
        assert!(source.contains("in 4000 exposures"), "{source}");
        assert!(
            found < 1.2 * requested + 4.0 * deviation,
            "{found} {requested}"
        );
        assert!(
            found > 0.4 * requested - 4.0 * deviation,
            "{found} {requested}"
        );
    }
}

/// At 1 % false alarms the window rule is faster than the paper's rule, and the centred window is
/// more exact.
#[test]
fn the_window_rule_is_faster_and_nearer() {
    let (paper, window) = (json(PIXEL), json(WINDOW));
    let cycles = |result| value(result, "cycles_to_event");
    assert!(cycles(&window) < cycles(&paper), "{window} {paper}");
    // At the same exposures, that is the same photons.
    let [paper, window] =
        [PIXEL, WINDOW].map(|rule| value(&json(&format!("{rule} --l1 400")), "depth_error_mm"));
    assert!(window < paper, "{window} {paper}");
}

#[test]
fn the_window_rule_refuses_what_the_papers_does() {
    refused(
        "
            --background 0.05 --signal 0.001 --sigma-bins 0.8 --rule window | the signal is too weak | L2 = 2000
            --background 1 --signal 1 --sigma-bins 0.8 --rule window | fills the 10-bit counters | lower --l2 to 860
            WINDOW --l1 2000 | L2 must be greater than L1
            WINDOW --bins 100 | --bins | power of two
            WINDOW --l1 40 --false-alarm 1e-300 | there is no z for so few
        ",
    );
    // The limits of the table.
    let rare = json(&format!("{WINDOW} --l1 40 --false-alarm 1e-6"));
    assert!((6.0..6.44).contains(&value(&rare, "z")));
}
