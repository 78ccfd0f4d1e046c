//! Where methods fail, as a document: what the study of failures found.

use std::fmt::Write as _;

use anyhow::Result;

use crate::sweep::Part;
use crate::sweep::studies::failures::{ESTIMATORS, Outcome, Rule, outcomes};

/// The table of every case and method, and what goes wrong without a flag.
///
/// # Errors
/// If `part` is not of the study.
pub fn document(part: &Part) -> Result<String> {
    let outcomes = outcomes(part)?;
    let mut text = "# Where methods fail\n\n\
         Made by `cargo xtask figures` from the study `failures`; do not edit. Histograms of 128 bins with 10-bit\n\
         counters, X = 4, L1 = 40, L2 = 2000, pulse σ 1 bin; the window rule has 3 bins and the z for a false event in 100\n\
         exposures. The plain scene has 2 background counts a bin at L1 and 0.5 signal photons a laser cycle at 80.3 bins;\n\
         every other case differs from it in what its name says. Backgrounds are in counts a bin at L1 (after 40\n\
         laser cycles), at the same signal to noise; a weak signal is about a quarter of it (A/√B 0.54 in place of 2.24 in a\n\
         laser cycle). Photons are those of a laser cycle; \"one hit\" is a TDC that takes the first of them only. The numbers\n\
         are in [figures/data/failures.csv](figures/data/failures.csv). `--rule window` chooses the window rule,\n\
         `--sigma-bins 1` the centred window.\n\n\
         A cell is of one rule and one depth estimator: the share of its events that are farther than 3 bins from\n\
         every surface (99 % interval), the share of exposures that end without an event, the root mean square\n\
         error of the other events, and flags and events of another surface than the first where they are more than 1 %. A method\n\n\
         - **fails** if a tenth of the events or more is false, or half of the exposures or more bring none;\n\
         - **survives** if the interval of the false share ends below 2 %, and the error is less than twice that in the\n  \
         plain scene;\n\
         - **degrades** otherwise.\n\n\
         It is **silent** where 2 % of the events or more are false, or the error is twice that in the plain scene or\n\
         more, and fewer than nine in ten of these events have a flag. Fewer wrong events than one in a hundred\n\
         exposures are what any threshold lets through and do not count; an exposure without an event says nothing\n\
         wrong. An event of two or more surfaces is right if it is of one of them.\n\n\
         ![False events over the background](figures/failures-background.svg)\n\n"
        .to_owned();
    text.push_str("| case |");
    for rule in Rule::ALL {
        for estimator in ESTIMATORS {
            write!(text, " {}, {estimator} |", rule.name())?;
        }
    }
    text.push_str(" what to do |\n|---|");
    text.push_str(&"---|".repeat(Rule::ALL.len() * ESTIMATORS.len() + 1));
    text.push('\n');
    for (case, outcomes) in &outcomes {
        write!(text, "| {} |", case.name)?;
        for outcome in outcomes {
            write!(text, " {} |", cell(outcome))?;
        }
        writeln!(text, " {} |", case.advice)?;
    }
    text.push_str("\n## Silent\n\nWrong without a flag:\n\n");
    for (case, outcomes) in &outcomes {
        let silent = outcomes.iter().filter(|outcome| outcome.is_silent);
        let methods: Vec<String> = silent
            .map(|outcome| format!("{} ({})", outcome.rule.name(), outcome.estimator))
            .collect();
        if !methods.is_empty() {
            writeln!(text, "- {}: {}", case.name, methods.join(", "))?;
        }
    }
    Ok(text)
}

fn cell(outcome: &Outcome) -> String {
    let percent = |share: f64| format!("{:.1} %", share * 100.0);
    let mut parts = vec![outcome.verdict.name().to_owned()];
    match outcome.false_share {
        Some(share) => {
            let (low, high) = share.interval;
            parts.push(format!(
                "false {} ({:.1} to {:.1})",
                percent(share.value),
                low * 100.0,
                high * 100.0
            ));
            parts.push(format!("no event {}", percent(outcome.without.value)));
            if share.value < 1.0 {
                parts.push(format!("{:.2} bins", outcome.error));
            }
        }
        None => parts.push("no event".to_owned()),
    }
    let notes = [
        ("saturated", outcome.saturated),
        ("clipped", outcome.clipped),
        ("other surface", outcome.other_surface),
    ];
    for (what, share) in notes.into_iter().filter(|(_, share)| *share > 0.01) {
        parts.push(format!("{what} {}", percent(share)));
    }
    if outcome.is_silent {
        parts.push("**silent**".to_owned());
    }
    parts.join("; ")
}
