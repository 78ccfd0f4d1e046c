//! Where methods fail, as a document: what the study of failures found.

use std::fmt::Write as _;

use anyhow::Result;

use crate::studies::failures::cases::Case;
use crate::studies::failures::{Method, Outcome, Verdict, Warning, outcomes};
use crate::sweep::Part;
use dtof::rows::grouped;

/// The table of every case and method, what those that fail report, and what goes
/// wrong without a flag.
///
/// # Errors
/// If `part` is not of the study.
pub fn document(part: &Part) -> Result<String> {
    let outcomes = outcomes(part)?;
    let seeds = part.seeds().iter().map(|seeds| seeds.end - seeds.first);
    let mut text = format!(
        "# Where methods fail\n\n\
         Made by `cargo xtask figures` from the study `failures`; do not edit. `cargo xtask figures --all` works out\n\
         all its {} seeds again. Histograms of 128 bins with 10-bit\n\
         counters, X = 4, L1 = 40, L2 = 2000, pulse σ 1 bin. The plain scene has 2 background counts a bin at L1 (after\n\
         40 laser cycles) and 0.5 signal photons a laser cycle at 80.3 bins; every other case differs from it in what its\n\
         name says. Backgrounds are in counts a bin at L1, at the same signal to noise; a weak signal is about a quarter of\n\
         it (A/√B 0.54 in place of 2.24 in a laser cycle). Photons are those of a laser cycle; \"one hit\" is a TDC that\n\
         takes the first of them only, and pixels that know.\n\n\
         α = 4 is the least α with at most one false event in 100 exposures at the background of the plain scene, and 8 the\n\
         paper's own; the window rule has 3 bins and the z for as many false events at any background. Depths are the\n\
         paper's centre of mass or the centred window for the pulse.\n\n\
         - **survives**, or ok: the 99 % interval of the share of events farther than 3 bins from every surface (false\n  \
         events) ends below 2 %, and the root mean square error of the others is less than twice that in the plain\n  \
         scene. Without a target: not for sure more than one false event in 100 exposures.\n\
         - **fails**: a tenth of the events or more is false, or half of the exposures or more bring none.\n\
         - **degrades**: otherwise.\n\n\
         Wrong events are false ones; and all, where the error is, for sure, twice that in the plain scene or more. Where more\n\
         than one exposure in 100 brings a wrong event, or more than one event in 10 is wrong (for sure, to 99 %; fewer are\n\
         what any threshold lets through), ⚑ says that no more than these are without a flag, and **silent** that more are. An exposure without an event says\n\
         nothing wrong. An event of two or more surfaces is right if it is of one of them.\n\n\
         ![False events over the background](../figures/failures-background.svg)\n\n",
        seeds.sum::<u64>()
    );
    let methods: Vec<Method> = Method::all().collect();
    text.push_str("| case |");
    for method in &methods {
        write!(text, " {} |", method.name())?;
    }
    text.push_str(" survive |\n|---|");
    text.push_str(&"---|".repeat(methods.len() + 1));
    text.push('\n');
    for (case, outcomes) in &outcomes {
        write!(text, "| {} |", case.name)?;
        for outcome in outcomes {
            write!(text, " {} |", cell(outcome))?;
        }
        writeln!(text, " {} |", survivors(outcomes))?;
    }
    reports(&mut text, &outcomes)?;
    silence(&mut text, &outcomes)?;
    text.push_str("\n## Advice\n\nNot measured, but where it names a row:\n\n");
    for (case, _) in &outcomes {
        if let Some(advice) = case.advice {
            writeln!(text, "- {}: {advice}", case.name)?;
        }
    }
    Ok(text)
}

fn percent(share: f64) -> String {
    format!("{:.1} %", share * 100.0)
}

/// A word, what is worst, and whether flags tell.
fn cell(outcome: &Outcome) -> String {
    let word = match outcome.verdict {
        Verdict::Survives => "ok".to_owned(),
        Verdict::Degrades => format!("degrades: {}", worst(outcome)),
        Verdict::Fails => format!("**fails**: {}", worst(outcome)),
    };
    match outcome.warning {
        Warning::NotNeeded => word,
        Warning::Flagged => format!("{word} ⚑"),
        Warning::Silent => format!("{word} **silent**"),
    }
}

fn worst(outcome: &Outcome) -> String {
    match outcome.false_share {
        Some(share) if share.value >= 0.1 && outcome.without.value < 0.9 => {
            format!("{:.0} % false", share.value * 100.0)
        }
        _ if outcome.is_far_off && outcome.without.value < 0.5 => {
            format!("{:.1} bins off", outcome.error)
        }
        Some(share) if outcome.without.value < 0.5 && share.interval.1 >= 0.02 => {
            format!("{} false", percent(share.value))
        }
        _ if outcome.without.value < 0.5 => format!("{:.1} bins off", outcome.error),
        _ => format!("{:.0} % no event", outcome.without.value * 100.0),
    }
}

/// The methods that survive; a rule alone where it does with both estimators.
fn survivors(outcomes: &[Outcome]) -> String {
    let survives = |outcome: &&Outcome| outcome.verdict == Verdict::Survives;
    let all: Vec<&Outcome> = outcomes.iter().filter(survives).collect();
    if all.len() == outcomes.len() {
        return "all".to_owned();
    }
    let mut names: Vec<String> = Vec::new();
    for outcome in &all {
        let rule = outcome.method.rule;
        let of_rule = all.iter().filter(|other| other.method.rule == rule);
        let name = if of_rule.count() == 2 {
            rule.name().to_owned()
        } else {
            format!("{} ({})", rule.name(), outcome.method.estimator())
        };
        if !names.contains(&name) {
            names.push(name);
        }
    }
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join("; ")
    }
}

/// Everything about the methods that do not survive.
fn reports(text: &mut String, outcomes: &[(Case, Vec<Outcome>)]) -> Result<()> {
    text.push_str(
        "\n## What those that do not survive report\n\n\
         Of the events: the share of false ones (99 % interval; without a target, of the exposures), the error of the others,\n\
         root mean square and mean (below 0 is too near), and those with a flag. All cases are in\n\
         [data/failures.csv](data/failures.csv), with exposures and events of another surface than the\n\
         first.\n\n\
         | case | method | events | no event | false | error, bins | mean error | saturated | clipped | pile-up |\n\
         |---|---|---|---|---|---|---|---|---|---|\n",
    );
    for (case, outcomes) in outcomes {
        for outcome in outcomes {
            if outcome.verdict == Verdict::Survives {
                continue;
            }
            let share = outcome.false_share.map_or("-".to_owned(), |share| {
                let (low, high) = share.interval;
                format!(
                    "{} ({:.1} to {:.1})",
                    percent(share.value),
                    low * 100.0,
                    high * 100.0
                )
            });
            let [error, mean] = if outcome.error > 0.0 {
                [
                    format!("{:.2}", outcome.error),
                    format!("{:+.2}", outcome.mean_error),
                ]
            } else {
                ["-", "-"].map(str::to_owned)
            };
            writeln!(
                text,
                "| {} | {} | {} | {} | {share} | {error} | {mean} | {} | {} | {} |",
                case.name,
                outcome.method.name(),
                grouped(outcome.events),
                percent(outcome.without.value),
                percent(outcome.saturated),
                percent(outcome.clipped),
                percent(outcome.piled_up),
            )?;
        }
    }
    Ok(())
}

/// Where wrong events have no flag, and why.
fn silence(text: &mut String, outcomes: &[(Case, Vec<Outcome>)]) -> Result<()> {
    text.push_str(
        "\n## Silent\n\nWrong events without a flag, and why the histogram does not tell:\n\n",
    );
    for (case, outcomes) in outcomes {
        let silent = outcomes
            .iter()
            .filter(|outcome| outcome.warning == Warning::Silent);
        let methods: Vec<String> = silent.map(|outcome| outcome.method.name()).collect();
        if !methods.is_empty() {
            let why = case.silence.unwrap_or("not known");
            writeln!(text, "- {} ({}): {why}.", case.name, methods.join("; "))?;
        }
    }
    Ok(())
}
