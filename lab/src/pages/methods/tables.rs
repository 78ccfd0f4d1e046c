//! The tables: the method chosen for a scene.

use std::fmt::Write as _;

use anyhow::{Context, Result};

use super::{Entry, Instructions, chosen};
use crate::studies::methods::depth_error::{self, Estimator};
use crate::studies::methods::time_to_detect::{self, DetectionOutcome};
use crate::sweep::Part;

/// The rule for each pulse and background.
pub(super) fn rules(counts: &Instructions, outcomes: &[DetectionOutcome]) -> Result<String> {
    let mut text = String::new();
    for sigma in time_to_detect::SIGMAS {
        for background in time_to_detect::BACKGROUNDS {
            let is_here = |outcome: &DetectionOutcome| {
                outcome.sigma == sigma && outcome.background == background
            };
            let entries = super::rules(counts, outcomes, is_here)?;
            let chosen = chosen(&entries)?;
            let paper = entries.first().context("no rules")?;
            let is_chosen = |outcome: &&DetectionOutcome| {
                is_here(outcome) && outcome.rule.label() == chosen.label
            };
            let those: Vec<&DetectionOutcome> = outcomes.iter().filter(is_chosen).collect();
            let first = those.first().context("no outcome")?;
            let signal = time_to_detect::signal(sigma, background);
            let cycles = those.iter().map(|outcome| outcome.cycles.value);
            let photons = signal * cycles.sum::<f64>() / those.len() as f64;
            writeln!(
                text,
                "| {sigma} | {background} | {signal:.3} | {} | {:.2} | {} | {photons:.0} | {:.0} | {} |",
                chosen.label,
                first.threshold,
                chosen.mean.text(2),
                chosen.cost,
                paper.mean.text(2)
            )?;
        }
    }
    Ok(text)
}

/// The cost of the estimators.
pub(super) fn estimators(all: &[Entry]) -> String {
    let rows = all
        .iter()
        .map(|entry| format!("| {} | {:.0} |\n", entry.label, entry.cost));
    rows.collect()
}

/// The estimator for each pulse, background and number of signal photons.
pub(super) fn depths(counts: &Instructions, part: &Part) -> Result<String> {
    let mut text = "| pulse σ, bins | background a bin |".to_owned();
    for signal in depth_error::SIGNALS {
        write!(text, " {signal} photons | the paper's |")?;
    }
    writeln!(
        text,
        "\n|---|---|{}",
        "---|---|".repeat(depth_error::SIGNALS.len())
    )?;
    for sigma in depth_error::SIGMAS {
        for background in depth_error::BACKGROUNDS {
            write!(text, "| {sigma} | {background} |")?;
            for signal in depth_error::SIGNALS {
                let scene = [
                    ("sigma", sigma),
                    ("background", background),
                    ("signal", signal),
                ];
                let all = super::estimators(counts, part, |point| point.is_at(scene))?;
                let (papers, others): (Vec<_>, _) = all
                    .into_iter()
                    .partition(|entry| entry.label == Estimator::Paper.label());
                let paper = papers.first().context("no estimators")?;
                let chosen = chosen(&others)?;
                let (error, papers) = (chosen.mean.value, paper.mean.value);
                write!(text, " {} {error:.2} | {papers:.2} |", chosen.label)?;
            }
            text.push('\n');
        }
    }
    Ok(text)
}
