//! What the study of failures finds, on a few seeds.

use std::time::Duration;

use dtof_lab::studies::failures::cases::Case;
use dtof_lab::studies::failures::{Outcome, Rule, STUDY, Verdict, Warning, outcomes};
use dtof_lab::sweep;

/// Those of a case, whose name starts with `name`.
fn of<'a>(all: &'a [(Case, Vec<Outcome>)], name: &str) -> &'a [Outcome] {
    let found = all.iter().find(|(case, _)| case.name.starts_with(name));
    &found.unwrap_or_else(|| panic!("no case {name}")).1
}

/// The smallest share of false alarms that the interval allows.
fn surely_false(outcome: &Outcome) -> f64 {
    outcome.false_share.map_or(0.0, |share| share.interval.0)
}

#[test]
fn a_few_seeds_show_what_fails_and_what_is_flagged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part");
    let part = sweep::run(&STUDY, 0..5, &path, Duration::MAX, |_| ()).unwrap();
    let all = outcomes(&part).unwrap();

    for outcome in of(&all, "plain") {
        assert!(surely_false(outcome) < 0.02 && outcome.without.value < 0.1);
        assert!(outcome.verdict != Verdict::Fails && outcome.warning != Warning::Silent);
    }
    // The cover glass is the brightest: nothing says so. A gate helps.
    for outcome in of(&all, "cover glass 10 × the signal") {
        assert!(surely_false(outcome) > 0.8, "{outcome:?}");
        assert!(outcome.verdict == Verdict::Fails && outcome.warning == Warning::Silent);
    }
    for outcome in of(&all, "cover glass 10 × the signal, gate") {
        assert!(surely_false(outcome) < 0.02 && outcome.without.value < 0.1);
        assert!(outcome.verdict != Verdict::Fails && outcome.warning != Warning::Silent);
    }
    // Full counters and windows past the histogram are flagged.
    for name in ["signal of 80 photons", "signal of 400 photons"] {
        for outcome in of(&all, name) {
            assert!(
                outcome.saturated > 0.99 && outcome.warning != Warning::Silent,
                "{outcome:?}"
            );
        }
    }
    for name in ["pulse at 0.3 bins", "pulse at 127.7 bins"] {
        for outcome in of(&all, name) {
            assert!(
                outcome.clipped > 0.6 && outcome.warning != Warning::Silent,
                "{outcome:?}"
            );
        }
    }
    // With light in each quadrant the paper's rule has no background left; the mean has.
    for outcome in of(&all, "a pulse in each quadrant") {
        match outcome.method.rule {
            Rule::Window | Rule::Average(_) => {
                assert!(outcome.without.value < 0.1, "{outcome:?}");
            }
            Rule::Paper(_) => assert!(outcome.without.value > 0.3, "{outcome:?}"),
        }
    }
    // Of the photons of a cycle only the first counts: the slope is taken for the peak,
    // and every event says so.
    for outcome in of(&all, "one hit, 6 photons") {
        assert!(surely_false(outcome) > 0.8 && outcome.piled_up > 0.999);
        assert!(outcome.warning == Warning::Flagged, "{outcome:?}");
    }
    for name in ["one hit, 1.5 photons", "one hit, 2 photons"] {
        for outcome in of(&all, name) {
            assert!(outcome.piled_up > 0.95, "{outcome:?}");
        }
    }
    // At half of the laser cycles nothing is false yet, and the flag begins.
    for outcome in of(&all, "one hit, 0.7 photons") {
        assert!(surely_false(outcome) < 0.02 && outcome.verdict != Verdict::Fails);
        assert!((0.1..0.9).contains(&outcome.piled_up), "{outcome:?}");
    }
    // A bright pulse hides its own end. An event's error is 0.3 bins.
    for outcome in of(&all, "one hit, a pulse of 0.7 photons") {
        assert!((-0.35..-0.08).contains(&outcome.mean_error), "{outcome:?}");
    }
    for outcome in of(&all, "one hit, a pulse of 3 photons") {
        assert!((-0.95..-0.6).contains(&outcome.mean_error) && outcome.piled_up > 0.999);
    }
    // Without a target there is little to report, and it is false.
    for outcome in of(&all, "no target") {
        assert!(outcome.verdict == Verdict::Survives && outcome.false_share.is_some());
    }
    for outcome in of(&all, "hot pixel") {
        assert!(outcome.without.value > 0.8, "{outcome:?}");
    }
    // A background that changes within the exposure makes no false alarms.
    for name in ["weak signal, background × 4", "weak signal, background / 4"] {
        for outcome in of(&all, name) {
            assert!(surely_false(outcome) < 0.02, "{outcome:?}");
        }
    }
    // A target that moves while it is exposed is reported where it was.
    let still = of(&all, "weak signal").iter();
    for (still, drifting) in still.zip(of(&all, "weak signal, the same drift")) {
        if still.method.rule == Rule::Window {
            assert!(drifting.error > 1.5 * still.error, "{drifting:?}");
        }
    }
}

#[test]
fn the_page_has_a_row_for_every_case() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part");
    let part = sweep::run(&STUDY, 7..8, &path, Duration::MAX, |_| ()).unwrap();
    let values = dtof_lab::pages::failures::tables(&part).unwrap();
    let text = values.fill("{table}{reports}{silent}{advice}").unwrap();
    assert!(!text.contains("NaN"), "{text}");
    let table = values.fill("{table}").unwrap();
    let rows: Vec<&str> = table.lines().collect();
    assert_eq!(rows.len(), part.points().len() + 2);
    assert!(rows.iter().all(|row| row.matches('|').count() == 9));
    for row in &rows[2..] {
        let mut cells = row.split('|').skip(2).take(6);
        assert!(cells.all(|cell| cell.chars().count() < 40), "{row}");
    }
    // Where no flag tells, the page says why.
    for (case, outcomes) in outcomes(&part).unwrap() {
        if outcomes
            .iter()
            .any(|outcome| outcome.warning == Warning::Silent)
        {
            assert!(case.silence.is_some(), "{}", case.name);
        }
    }
    assert!(!text.contains("not known"));
}
