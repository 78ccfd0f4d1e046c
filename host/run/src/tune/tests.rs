use std::sync::LazyLock;

use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{AverageRule, Count, DepthEstimator, PaperRule, RangeGate, WindowRule, z_for};
use dtof_data::options::{flag, line, read};
use dtof_engine::settings::Settings;
use serde_json::Value;

use super::*;
use crate::replay;

const PIXEL: &str = "--background 0.05 --signal 0.4 --sigma-bins 0.8";
/// Exposures of this one take little time.
const SMALL: &str = "--background 0.2 --signal 2 --sigma-bins 1 --bins 8 --l1 40 --l2 200";

/// Each with the L1 that is found.
static PAPER: LazyLock<TuneResult> =
    LazyLock::new(|| tuned(&format!("{PIXEL} --laser-hz 1e7")).unwrap());
static WINDOW: LazyLock<TuneResult> =
    LazyLock::new(|| tuned(&format!("{PIXEL} --rule window")).unwrap());

/// Options by key, from flags and their values.
fn pairs(flags: &str) -> Vec<(String, &str)> {
    let words: Vec<&str> = flags.split_whitespace().collect();
    let pairs = words.chunks_exact(2).map(|pair| {
        let key = pair[0].trim_start_matches('-').replace('-', "_");
        (key, pair[1])
    });
    pairs.collect()
}

fn tuned(flags: &str) -> Result<TuneResult> {
    read::<Options>(pairs(flags))?.tune(&mut ())
}

fn json(flags: &str) -> Value {
    tuned(flags).unwrap().json()
}

fn value(result: &Value, name: &str) -> f64 {
    result[name]["value"].as_f64().unwrap()
}

/// Each row: flags, and parts of the expected refusal.
#[track_caller]
fn refused(rows: &str) {
    for row in rows.lines().filter(|row| !row.trim().is_empty()) {
        let mut cells = row.split('|').map(str::trim);
        let flags = cells.next().unwrap().replace("PIXEL", PIXEL);
        let refused = line(&tuned(&flags).err().unwrap(), &flag);
        assert!(!refused.contains('\n'), "{refused}");
        for part in cells {
            assert!(refused.contains(part), "{flags}: {refused}");
        }
    }
}

/// The settings that `replay` has with the options of a result.
fn replayed(result: &TuneResult) -> Settings {
    let options: replay::Options = read(pairs(result.options())).unwrap();
    let requested = options.requested().unwrap();
    let bins = requested.sensor.bins.map_or(128, usize::from);
    requested.settings(bins).unwrap()
}

#[test]
fn every_line_says_where_it_comes_from() {
    for result in [&*PAPER, &*WINDOW] {
        let text = result.text();
        let (results, options) = text.split_once("\n\n").unwrap();
        for line in results.lines() {
            let sources = ["formula: ", "simulation: "];
            assert!(sources.iter().any(|source| line.contains(source)), "{line}");
        }
        assert_eq!(options, format!("{}\n", result.options()));
    }
    let text = PAPER.text();
    for part in "seed 1|exposures a point|Eq. 11|mm rms|laser cycles| s ".split('|') {
        assert!(text.contains(part), "{text}");
    }
    assert!(!WINDOW.text().contains('α'), "{}", WINDOW.text());
    let seconds = value(&PAPER.json(), "seconds_to_event") * 1e7;
    assert!((seconds - value(&PAPER.json(), "cycles_to_event")).abs() < 1e-6);
}

#[test]
fn the_options_it_prints_are_options_of_replay() {
    let settings = replayed(&PAPER).configuration;
    let result = PAPER.json();
    assert_eq!(f64::from(settings.l1), value(&result, "l1"));
    let alpha = U8F8::from_num(value(&result, "alpha"));
    let rule = PaperRule::new(alpha, Count::saturating(5));
    assert_eq!(settings.rule, rule.into());
    assert!(
        PAPER
            .options()
            .starts_with("--rule paper --estimator centroid ")
    );
    // A histogram that differs from the default is one of them.
    assert!(!PAPER.options().contains("--bins"));
    let other = tuned(&format!("{PIXEL} --bins 64 --bin-width-ps 500 --l1 40")).unwrap();
    assert!(other.options().ends_with(" --bins 64 --bin-width-ps 500"));
    assert_eq!(replayed(&other).bins, 64);
    // There is no table for other numbers of bins.
    let other = other.json();
    let source = other["alpha"]["source"].as_str().unwrap();
    assert!(source.contains("formula: upper bound"), "{source}");
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
fn other_units_say_the_same() {
    let request = |flags: &str| read::<Options>(pairs(flags)).unwrap().request().unwrap();
    // A = SNR·√(B/L2) = 80 · √(0.05/2000); 200 ps are 0.8 bins.
    let one = request(PIXEL);
    let other = request("--background 0.05 --snr 80 --sigma-ps 200");
    assert!((one.signal - other.signal).abs() < 1e-12);
    let (signal, sigma) = (one.signal, one.sigma);
    assert_eq!(
        one,
        Request {
            signal,
            sigma,
            ..other
        }
    );
    assert!((value(&PAPER.json(), "snr") - 80.0).abs() < 1e-9);
    let rate = "--false-alarms-per-second 5 --laser-hz 1e6";
    let limit = request(&format!("{PIXEL} {rate}")).limit;
    assert_eq!(limit, FalseAlarmLimit::PerCycle(5e-6));
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
            --background 1 --signal 1 --sigma-bins 0.8 --rule window | fills the 10-bit counters | lower --l2 to 860
            --background 0.1 --signal 1 --sigma-bins 2 --rule window | σ = 2 bins | for 1.75 bins at most
            PIXEL --rule window --l1 2000 | L2 must be greater than L1
            PIXEL --rule window --l1 40 --false-alarm 1e-300 | there is no z for so few
        ",
    );
    // Large values give one short line, without useless advice.
    for flags in [
        "--background 1e308 --signal 1 --sigma-bins 0.8",
        "--background 0.05 --signal 1e308 --sigma-bins 0.8",
        "--background 0.05 --signal 1 --sigma-bins 1e308",
        "--background 0.05 --signal 1 --sigma-ps 1e308 --bin-width-ps 1e-300",
    ] {
        let error = line(&tuned(flags).err().unwrap(), &flag);
        assert!(error.len() < 160 && !error.contains("--l2"), "{error}");
    }
    // The limits of the table.
    let rare = json(&format!("{PIXEL} --rule window --l1 40 --false-alarm 1e-6"));
    assert!((6.0..6.44).contains(&value(&rare, "z")));
}

#[test]
fn options_that_are_missing_or_no_numbers_are_named() {
    refused(
        "
            | needed: --background; --signal or --snr; --sigma-bins or --sigma-ps
            --background 0.05 --sigma-bins 1 | --signal
            --background 0.05 --signal 1 | --sigma-bins
            --signal 1 --sigma-bins 1 | --background
            PIXEL --snr 5 | --snr | --signal
            PIXEL --false-alarms-per-second 1 | --laser-hz
        ",
    );
    for bad in ["0", "-1", "nan", "inf", "x"] {
        let flags = format!("--background {bad} --signal 1 --sigma-bins 1");
        refused(&format!("{flags} | --background | a number above 0"));
    }
}

#[test]
fn the_window_rule_has_a_z_a_window_and_an_estimator() {
    let settings = replayed(&WINDOW);
    let result = WINDOW.json();
    let [z, window, l1, half] =
        ["z", "window", "l1", "half_width"].map(|name| value(&result, name));
    let z = U4F12::from_num(z);
    assert_eq!(window, 3.0);
    let rule = WindowRule::new(3, z, Count::saturating(5)).unwrap();
    assert_eq!(settings.configuration.rule, rule.into());
    assert_eq!(f64::from(settings.configuration.l1), l1);
    // 0.8 to the nearest 1/256, and twice that and 1/2.
    let estimator = DepthEstimator::for_pulse(U8F8::from_bits(205));
    assert_eq!(settings.configuration.estimator, estimator);
    assert_eq!(half, 538.0 / 256.0);
}

#[test]
fn the_average_rule_has_an_alpha_by_simulation() {
    let average = format!("{SMALL} --rule average");
    let result = tuned(&format!("{average} --false-alarm 0.02")).unwrap();
    let settings = replayed(&result);
    let result = result.json();
    let alpha = U8F8::from_num(value(&result, "alpha"));
    let rule = AverageRule::new(alpha, Count::saturating(5));
    assert_eq!(settings.configuration.rule, rule.into());
    assert_eq!(settings.configuration.l1, 40);
    // Of 4,000 exposures, 2 % and three standard deviations.
    assert!(value(&result, "false_alarms") < 0.027, "{result}");
    refused(&format!(
        "{average} --false-alarm 1e-7 | no α found for a false alarm in 10000000"
    ));
}

#[test]
fn z_is_that_of_the_core_and_keeps_false_alarms_down() {
    let gate = RangeGate::<128>::full();
    for one_in in [10, 100, 1000] {
        let requested = 1.0 / f64::from(one_in);
        let result = json(&format!(
            "{PIXEL} --rule window --l1 40 --false-alarm {requested}"
        ));
        let z = z_for(one_in, &gate, 4, 40, 2000).to_num::<f64>();
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

/// At 1 % false alarms the window rule is faster than the paper's rule, and the centred window is more exact.
#[test]
fn the_window_rule_is_faster_and_nearer() {
    let [paper, window] = [&PAPER, &WINDOW].map(|result| value(&result.json(), "cycles_to_event"));
    assert!(window < paper, "{window} {paper}");
    // At the same exposures, that is the same photons.
    let [paper, window] = ["paper", "window"].map(|rule| {
        let result = json(&format!("{PIXEL} --rule {rule} --l1 400"));
        value(&result, "depth_error_mm")
    });
    assert!(window < paper, "{window} {paper}");
}
