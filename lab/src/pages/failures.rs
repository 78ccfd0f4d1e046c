//! Where methods fail: the tables of the study of failures.

use std::fmt::Write as _;

use anyhow::Result;

use crate::studies::failures::{Case, Method, Outcome, Verdict, Warning, outcomes};
use crate::sweep::Part;
use crate::sweep::values::Values;
use dtof_options::rows::grouped;

/// The tables of the page.
///
/// # Errors
/// Fails if `part` is of another study.
pub fn tables(part: &Part) -> Result<Values> {
    let outcomes = outcomes(part)?;
    let methods: Vec<String> = Method::all().map(|method| method.name()).collect();
    let mut table = format!("| case | {} | survive |\n|---|", methods.join(" | "));
    table += &"---|".repeat(methods.len() + 1);
    table += "\n";
    let (mut silent, mut advice) = (String::new(), String::new());
    for (case, outcomes) in &outcomes {
        let cells: Vec<String> = outcomes.iter().map(cell).collect();
        let survivors = survivors(outcomes);
        writeln!(
            table,
            "| {} | {} | {survivors} |",
            case.name,
            cells.join(" | ")
        )?;
        let is_silent = |outcome: &&Outcome| outcome.warning == Warning::Silent;
        let methods = outcomes.iter().filter(is_silent);
        let methods: Vec<String> = methods.map(|outcome| outcome.method.name()).collect();
        if !methods.is_empty() {
            let why = case.silence.unwrap_or("not known");
            writeln!(silent, "| {} | {} | {why} |", case.name, methods.join("; "))?;
        }
        // What no method fails at needs none.
        let is_needed = |outcome: &Outcome| {
            outcome.verdict != Verdict::Survives || outcome.warning != Warning::NotNeeded
        };
        if let Some(text) = case.advice.filter(|_| outcomes.iter().any(is_needed)) {
            writeln!(advice, "| {} | {text} |", case.name)?;
        }
    }
    // The stored data call the centroid centre of mass.
    let named = |text: String| text.replace("centre of mass", "centroid");
    Ok([
        ("table", named(table)),
        ("reports", named(reports(&outcomes)?)),
        ("silent", named(silent)),
        ("advice", named(advice)),
    ]
    .into())
}

fn percent(share: f64) -> String {
    format!("{:.1} %", share * 100.0)
}

/// The verdict, the worst number, and whether events are flagged.
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
        Some(share) if !outcome.has_target => format!("{} false", percent(share.value)),
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

/// The methods that survive; only the rule if it survives with both estimators.
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

/// All numbers of the methods that do not survive.
fn reports(outcomes: &[(Case, Vec<Outcome>)]) -> Result<String> {
    let mut text = String::new();
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
    Ok(text)
}
