//! The results of the study of failures, on a few seeds.

use dtof_lab::pages::failures;
use dtof_lab::studies::failures::rows::{Row, SECTIONS};
use dtof_lab::studies::failures::{Case, FailureOutcome, Rule, STUDY, Verdict, Warning, outcomes};
use dtof_lab::sweep::{self, Part};
use std::path::Path;

/// The outcomes of the case whose name starts with `name`.
fn of<'a>(all: &'a [(Case, Vec<FailureOutcome>)], name: &str) -> &'a [FailureOutcome] {
    let found = all.iter().find(|(case, _)| case.name.starts_with(name));
    &found.unwrap_or_else(|| panic!("no case {name}")).1
}

fn is_window(outcome: &FailureOutcome) -> bool {
    outcome.method.rule == Rule::Window
}

/// The lower end of the interval of false alarms.
fn surely_false(outcome: &FailureOutcome) -> f64 {
    outcome.false_share.map_or(0.0, |share| share.interval.0)
}

#[test]
fn a_few_seeds_show_what_fails_and_what_is_flagged() {
    let all = outcomes(&sweep::run_seeds(&STUDY, 0..5).unwrap()).unwrap();
    let check = |names: &[&str], holds: fn(&FailureOutcome) -> bool| {
        for name in names {
            for outcome in of(&all, name) {
                assert!(holds(outcome), "{name}: {outcome:?}");
            }
        }
    };
    // The cover glass is the brightest pulse, and no flag shows it. A gate helps.
    let good = ["plain", "cover glass 10 × the signal, gate"];
    check(&good, |of| {
        surely_false(of) < 0.02 && of.without.value < 0.1 && of.verdict != Verdict::Fails
    });
    check(&["cover glass 10 × the signal"], |of| {
        surely_false(of) > 0.8 && of.verdict == Verdict::Fails && of.warning == Warning::Silent
    });
    // Full counters and windows past the histogram are flagged.
    let full = ["signal of 80 photons", "signal of 400 photons"];
    check(&full, |of| of.saturated > 0.99);
    let at_ends = ["pulse at 0.3 bins", "pulse at 127.7 bins"];
    check(&at_ends, |of| of.clipped > 0.6);
    check(&[good, full, at_ends].concat(), |of| {
        of.warning != Warning::Silent
    });
    // With light in each quadrant the paper's rule has no background estimate; the mean of all bins
    // works.
    check(&["a pulse in each quadrant"], |of| match of.method.rule {
        Rule::Window | Rule::Average(_) => of.without.value < 0.1,
        Rule::Paper(_) => of.without.value > 0.3,
    });
    // A dead time that is not set: a slope becomes the peak, and no flag says so.
    for tdc in ["first photon only", "dead for 20 bins", "dead for 5 bins"] {
        for photons in ["3 photons a laser cycle", "6 photons a laser cycle"] {
            let name = format!("{tdc}, {photons}");
            // Set, the window rule goes on where the light is left.
            check(&[&format!("{name}, set")], |of| {
                !is_window(of) || surely_false(of) < 0.02 && of.without.value < 0.5
            });
        }
        check(&[&format!("{tdc}, 6 photons, no target, set")], |of| {
            !is_window(of) || of.verdict == Verdict::Survives
        });
        check(
            &[&format!(
                "{tdc}, 6 photons, 2 of them crosstalk before the gate, set"
            )],
            |of| !is_window(of) || surely_false(of) < 0.02,
        );
    }
    check(&["first photon only, 6 photons a laser cycle"], |of| {
        !is_window(of) || surely_false(of) > 0.8 && of.warning == Warning::Silent
    });
    check(&["one hit, 1.5 photons", "one hit, 2 photons"], |of| {
        if is_window(of) {
            surely_false(of) < 0.02 && of.piled_up < 0.2
        } else {
            of.piled_up > 0.95
        }
    });
    // With a hit in half of the laser cycles nothing is false yet, and the flag begins.
    check(&["one hit, 0.7 photons"], |of| {
        let flag_begins = (0.1..0.9).contains(&of.piled_up);
        surely_false(of) < 0.02 && of.verdict != Verdict::Fails && (flag_begins || is_window(of))
    });
    // A bright pulse hides its own end, unless bins are weighed. The error of an event is 0.3 bins.
    check(&["one hit, a pulse of 0.7 photons"], |of| {
        is_window(of) && of.mean_error.abs() < 0.08 || (-0.35..-0.08).contains(&of.mean_error)
    });
    check(&["one hit, a pulse of 3 photons"], |of| {
        if is_window(of) {
            of.mean_error.abs() < 0.1
        } else {
            (-0.95..-0.6).contains(&of.mean_error) && of.piled_up > 0.999
        }
    });
    // Without a target there are few events, all false.
    check(&["no target"], |of| {
        of.verdict == Verdict::Survives && of.false_share.is_some()
    });
    check(&["hot pixel"], |of| of.without.value > 0.8);
    // A background that changes within the exposure causes no false alarms.
    let changing = ["weak signal, background × 4", "weak signal, background / 4"];
    check(&changing, |of| surely_false(of) < 0.02);
    let steps = ["background × 4 at 20", "background / 4 at 20"];
    check(&steps, |of| surely_false(of) < 0.02);
    // A pulse that stays looks like a target, and no flag distinguishes it; the same holds for a
    // veil. With dither the other laser's pulse wanders.
    for name in [
        "2 × the signal, no target",
        "4 × the signal, no target",
        "4 × the signal",
    ] {
        let name = format!("another LiDAR, clock 20 ppm off, {name}, dither of 128, once per bin");
        check(&[&name], |of| of.verdict != Verdict::Fails);
    }
    for clock in ["of the same clock", "clock 20 ppm off"] {
        let twice = format!("another LiDAR, {clock}, 2 × the signal");
        let without_target = format!("{twice}, no target");
        check(&[&twice, &without_target], |of| {
            surely_false(of) > 0.1 && of.warning == Warning::Silent
        });
        for name in [twice, without_target] {
            check(&[&format!("{name}, dither of 128")], |of| {
                surely_false(of) < 0.02 && of.verdict != Verdict::Fails
            });
        }
    }
    check(&["veil of twice the signal"], |of| {
        surely_false(of) > 0.8 && of.warning == Warning::Silent
    });
    let other_rate = "another LiDAR, rate 1 % off";
    let rain = ["rain, a drop of 3 photons", "the same rain, gate"];
    check(&[&[other_rate], &rain[..]].concat(), |of| {
        surely_false(of) < 0.02 && of.verdict != Verdict::Fails
    });
    // A target that moves during the exposure is reported at an earlier position.
    let still = of(&all, "weak signal").iter();
    for (still, drifting) in still.zip(of(&all, "weak signal, the same drift")) {
        if still.method.rule == Rule::Window {
            assert!(drifting.error > 1.5 * still.error, "{drifting:?}");
        }
    }
}

#[test]
fn every_case_is_in_a_row_of_the_page() {
    let part = sweep::run_seeds(&STUDY, 7..8).unwrap();
    let outcomes = outcomes(&part).unwrap();
    let rows: Vec<Row> = SECTIONS
        .iter()
        .flat_map(|(_, rows)| *rows)
        .copied()
        .collect();
    for (case, _) in &outcomes {
        let of_name = rows.iter().filter(|row| row.name == case.row.name);
        assert_eq!(of_name.count(), 1, "{}", case.name);
    }
    let is_of = |row: &Row| outcomes.iter().any(|(case, _)| case.row == *row);
    assert!(rows.iter().all(is_of));

    let values = failures::table(&part).unwrap();
    let table = values.fill("{table}").unwrap();
    assert!(table.lines().all(|row| row.matches('|').count() == 5));
    let csv = failures::cases(&part).unwrap();
    assert_eq!(csv.lines().count(), 1 + outcomes.len());
    for (line, (case, outcomes)) in csv.lines().skip(1).zip(&outcomes) {
        let cells = line
            .strip_prefix('"')
            .and_then(|line| line.strip_suffix('"'));
        let cells: Vec<&str> = cells.unwrap().split("\",\"").collect();
        let [name, row, fails, holds, advice, why] = cells[..] else {
            panic!("{line}");
        };
        assert_eq!((name, row), (&*case.name, case.row.name));
        let is_well = |outcome: &FailureOutcome| {
            outcome.verdict == Verdict::Survives && outcome.warning == Warning::NotNeeded
        };
        let is_all_well = outcomes.iter().all(is_well);
        // What every method survives needs no advice.
        assert_eq!(fails.is_empty(), is_all_well, "{line}");
        assert!(advice.is_empty() || !is_all_well, "{line}");
        assert_eq!(
            holds == "all",
            !outcomes.iter().any(|of| of.verdict != Verdict::Survives)
        );
        // Where no flag helps, the data explain why.
        let is_silent = |outcome: &FailureOutcome| outcome.warning == Warning::Silent;
        assert_eq!(why.is_empty(), !outcomes.iter().any(is_silent), "{line}");
        assert_ne!(why, "not known", "{line}");
    }
    assert!(!(table + &csv).contains("NaN"));
}

/// Of all seeds: both estimators of a rule have one name, except where the depth matters.
#[test]
fn the_page_names_rules_and_estimators() {
    let stored = |which| {
        let path = format!("../docs/results/data/failures.{which}.json");
        Part::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
    };
    let mut part = stored("few");
    part.add(&stored("rest")).unwrap();
    let csv = failures::cases(&part).unwrap();
    let of = |name: &str| {
        let start = format!("\"{name}\"");
        csv.lines().find(|line| line.starts_with(&start)).unwrap()
    };
    assert!(of("plain").ends_with(",\"\",\"all\",\"\",\"\""));
    let bright = of("signal of 400 photons (five counters are full)");
    assert!(
        bright.contains("degrades, flagged: all with the centroid ("),
        "{bright}"
    );
    assert!(
        bright.contains("\"all with the centred window\""),
        "{bright}"
    );
    let glass = of("cover glass 10 × the signal");
    let fails = "\"fails silently: all (100 % false)\",\"none\",\"a gate";
    assert!(glass.contains(fails), "{glass}");
    let quadrants = of("a pulse in each quadrant");
    assert!(
        quadrants.contains("\"average, window of 3\""),
        "{quadrants}"
    );
}
