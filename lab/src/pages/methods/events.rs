//! Which estimator for the events of a rule.

use std::fmt::Write as _;

use anyhow::{Context, Result};

use crate::studies::methods::event_depth::{self, ESTIMATORS, EventDepthOutcome, FIRST_LOOKS};
use crate::studies::methods::passage::Rule;
use crate::sweep::Part;
use crate::sweep::results::ends;
use crate::sweep::values::Values;

/// Outcomes with the paper's rule, or with windows.
fn of(
    outcomes: &[EventDepthOutcome],
    is_paper: bool,
) -> impl Iterator<Item = &EventDepthOutcome> + Clone {
    let those = outcomes.iter();
    those.filter(move |outcome| (outcome.rule == Rule::Paper) == is_paper)
}

/// The number of outcomes in which this estimator is significantly better.
fn better<'a>(outcomes: impl Iterator<Item = &'a EventDepthOutcome>, number: usize) -> usize {
    let those = outcomes.filter(|outcome| outcome.better() == Some(number));
    those.count()
}

/// The range of the ratio of this estimator's error to that of the first.
fn range<'a>(outcomes: impl Iterator<Item = &'a EventDepthOutcome>, number: usize) -> (f64, f64) {
    let ratios = outcomes.map(|outcome| {
        let [first, second] = [0, number].map(|number| outcome.errors[number].error.value);
        second / first
    });
    ends(ratios)
}

/// The range of the ratio of this estimator's error to the bound.
fn over_bound<'a>(
    outcomes: impl Iterator<Item = &'a EventDepthOutcome>,
    number: usize,
) -> (f64, f64) {
    ends(outcomes.map(|outcome| outcome.errors[number].over_bound.value))
}

/// The section on the study of events.
pub(super) fn section(values: &mut Values, part: &Part) -> Result<()> {
    let outcomes = event_depth::outcomes(part)?;
    let all = || outcomes.iter();
    let bound = (0..ESTIMATORS.len()).map(|number| over_bound(all(), number).0);
    let (bound, _) = ends(bound);
    let (in_pulse, _) = ends(all().map(|outcome| outcome.in_pulse.value));
    let (least, most) = ends(all().map(|outcome| outcome.false_share.value));
    values.set("bound", format!("{bound:.2}"));
    values.set("in-pulse", format!("{:.1}", 100.0 * in_pulse));
    values.set("false.least", format!("{:.1}", 100.0 * least));
    values.set("false.most", format!("{:.1}", 100.0 * most));
    let mut compared = String::new();
    for (rule, is_paper) in [("the paper's rule", true), ("window rule", false)] {
        let those = of(&outcomes, is_paper);
        let (low, high) = range(those.clone(), 1);
        let (least, most) = over_bound(those.clone(), 1);
        let [surely, worse] = [1, 0].map(|number| better(those.clone(), number));
        let count = those.count();
        writeln!(
            compared,
            "| {rule} | {low:.2} to {high:.2} | {least:.2} to {most:.2} | {surely} of {count} | {worse} |"
        )?;
    }
    values.set("compared", compared);
    let mut tables = String::new();
    for first in FIRST_LOOKS {
        let those = all().filter(|outcome| outcome.first_look == first);
        table(&mut tables, first, those)?;
    }
    values.set("events", tables.trim_end());
    Ok(())
}

fn table<'a>(
    text: &mut String,
    first_look: u32,
    outcomes: impl Iterator<Item = &'a EventDepthOutcome>,
) -> Result<()> {
    write!(
        text,
        "\nFirst look after {first_look} laser cycles; root mean square errors in bins:\n\n\
         | pulse σ, bins | background a bin and cycle | rule | α or z | false alarms, % | exposures with an event, % | cycles | photons | centroid of 3 | over the bound | centred window | over the bound | better |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|\n"
    )?;
    for outcome in outcomes {
        let [mass, centred] = outcome.errors;
        let better = outcome.better().map(|number| ESTIMATORS.get(number));
        let better = match better {
            None => "either",
            Some(estimator) => estimator.context("no such estimator")?.1,
        };
        writeln!(
            text,
            "| {} | {} | {} | {:.2} | {:.1} | {:.0} | {:.0} | {:.0} | {} | {:.2} | {} | {:.2} | {better} |",
            outcome.sigma,
            outcome.background,
            outcome.rule.label(),
            outcome.threshold,
            100.0 * outcome.false_share.value,
            100.0 * outcome.event_share.value,
            outcome.cycles,
            outcome.signal,
            mass.error.text(3),
            mass.over_bound.value,
            centred.error.text(3),
            centred.over_bound.value
        )?;
    }
    Ok(())
}
