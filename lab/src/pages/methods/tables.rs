//! The tables: what is chosen for a scene.

use std::fmt::Write as _;

use anyhow::{Context, Result};

use super::{Instructions, chosen, estimators, rules};
use crate::studies::methods::depth_error::{self, Method as Estimator};
use crate::studies::methods::time_to_detect::{self, Outcome};
use crate::sweep::Part;

/// For each pulse and background.
#[allow(clippy::float_cmp, reason = "parameters are as they were written")]
pub(super) fn decision(
    text: &mut String,
    counts: &Instructions,
    outcomes: &[Outcome],
) -> Result<()> {
    text.push_str(
        "## Which rule\n\n\
         By the standard deviation of the pulse and the background. The signal is such that the likelihood ratio needs\n\
         100 to 300 laser cycles. Times are means over a pulse in the middle of its bin and on an edge, with 1 % false\n\
         events in 1000 laser cycles, over those of the likelihood ratio that knows the scene; how sure the latter are, which\n\
         is the same for all rules, is not in the intervals. Photons are those of the pulse until the event. Commands\n\
         take them as `--rule window --window 3 --z 4.45 --l2 1000`; with another L2, leave z to `--false-one-in 100`.\n\
         `--sigma-bins` takes the best of these widths, whatever it costs.\n\n\
         | pulse σ, bins | background a bin and cycle | signal a cycle | rule | α or z | time | photons | instructions | the paper's rule: time |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    for sigma in time_to_detect::SIGMAS {
        for background in time_to_detect::BACKGROUNDS {
            let is_here =
                |outcome: &Outcome| outcome.sigma == sigma && outcome.background == background;
            let entries = rules(counts, outcomes, is_here)?;
            let chosen = chosen(&entries)?;
            let paper = entries.first().context("no rules")?;
            let is_chosen =
                |outcome: &&Outcome| is_here(outcome) && outcome.method.label() == chosen.label;
            let those: Vec<&Outcome> = outcomes.iter().filter(is_chosen).collect();
            let first = those.first().context("no outcome")?;
            let signal = time_to_detect::signal(sigma, background);
            let cycles = those.iter().map(|outcome| outcome.cycles.value);
            #[allow(clippy::cast_precision_loss, reason = "two")]
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
    Ok(())
}

/// For each pulse, background and number of signal photons.
#[allow(clippy::float_cmp, reason = "parameters are as they were written")]
pub(super) fn depth(text: &mut String, counts: &Instructions, part: &Part) -> Result<()> {
    text.push_str(
        "\n## Which depth estimator\n\n\
         By the standard deviation of the pulse, the background and the signal photons of an event, with the error over\n\
         the Cramér-Rao bound, in histograms of a fixed exposure; [below](#which-estimator-for-events-as-they-come) are the events\n\
         that a rule has chosen. A mean background is that outside a window of 5, the paper's is from its quadrants, and the\n\
         centred window's is the mean of the bins farther from the peak than half its width. `--sigma-bins` with the σ of the estimator takes a centred\n\
         window, and leaving it out the centre of mass of 3, its background that of the rule. A background a bin is that of a\n\
         bin and cycle times the event's exposure.\n\
         The rules were tried with three of these pulses.\n\n\
         | estimator | instructions |\n|---|---|\n",
    );
    for entry in estimators(counts, part, |_| true)? {
        writeln!(text, "| {} | {:.0} |", entry.label, entry.cost)?;
    }
    text.push_str("\n| pulse σ, bins | background a bin |");
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
                let all = estimators(counts, part, |point| point.is_at(scene))?;
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
    Ok(())
}
