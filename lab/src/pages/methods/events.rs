//! Which estimator for the events of a rule, as they come.

use std::fmt::Write as _;

use anyhow::{Context, Result};

use crate::studies::methods::event_depth::{self, ESTIMATORS, FIRST_LOOKS, Outcome};
use crate::studies::methods::passage::Method as Rule;
use crate::sweep::Part;

/// Outcomes with the paper's rule, or with windows.
fn of(outcomes: &[Outcome], is_paper: bool) -> impl Iterator<Item = &Outcome> + Clone {
    let those = outcomes.iter();
    those.filter(move |outcome| (outcome.method == Rule::Paper) == is_paper)
}

/// In how many the estimator of this number is surely the better.
fn better<'a>(outcomes: impl Iterator<Item = &'a Outcome>, number: usize) -> usize {
    let those = outcomes.filter(|outcome| outcome.better() == Some(number));
    those.count()
}

/// From the least to the largest error of the estimator of this number over the first's.
fn range<'a>(outcomes: impl Iterator<Item = &'a Outcome>, number: usize) -> (f64, f64) {
    let ratios = outcomes.map(|outcome| {
        let [first, second] = [0, number].map(|number| outcome.placed[number].error.value);
        second / first
    });
    ratios.fold((f64::INFINITY, 0.0), |(low, high), ratio| {
        (ratio.min(low), ratio.max(high))
    })
}

/// The section, from the study of events.
pub(super) fn section(text: &mut String, part: &Part) -> Result<()> {
    let outcomes = event_depth::outcomes(part)?;
    let least = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::INFINITY, f64::min);
    let bound = least(
        &mut outcomes
            .iter()
            .flat_map(|outcome| outcome.placed.map(|placed| placed.over_bound.value)),
    );
    let in_pulse = least(&mut outcomes.iter().map(|outcome| outcome.in_pulse.value));
    let false_shares = outcomes.iter().map(|outcome| outcome.false_share.value);
    let most_false = false_shares.clone().fold(0.0, f64::max);
    let [paper, window] = [true, false].map(|is_paper| {
        let those = of(&outcomes, is_paper);
        let (low, high) = range(those.clone(), 1);
        format!(
            "its error is {low:.2} to {high:.2} times that of the centre of mass; it is surely better in {} of {} rows and\n\
             surely worse in {}",
            better(those.clone(), 1),
            those.clone().count(),
            better(those, 0)
        )
    });
    let (low, high) = range(of(&outcomes, true), 2);
    let bounds = |is_paper, number: usize| {
        let all =
            of(&outcomes, is_paper).map(move |outcome| outcome.placed[number].over_bound.value);
        let (least, most) = all.fold((f64::INFINITY, 0.0f64), |(least, most), of| {
            (of.min(least), of.max(most))
        });
        format!("{least:.2} to {most:.2}")
    };
    write!(
        text,
        "\n## Which estimator for events as they come\n\n\
         A rule stops as soon as a peak stands clear: the histogram of an event is not one of a fixed exposure, as one\n\
         bin may be too high by chance and its background too low. This is the error of the events themselves, from the study\n\
         `event-depth` ([all figures](data/event_depth.csv)): signal and backgrounds of the first table, the pulse\n\
         anywhere in its bin, X = 4, L2 = 1000, L1 one less than the first look. The window rule has the width that\n\
         `--sigma-bins` takes and the z of `--false-one-in 100`, the paper's the least α, in 1/16, with at most one false event\n\
         in 100 exposures: counts are whole, so that no α gives exactly that. False events are of exposures without a\n\
         target, {:.1} to {:.1} %. Errors are of events whose peak is within 2 σ + 1 bins, {:.1} % of them or more; cycles and signal\n\
         photons are their means. The bound is that of a fixed exposure with these mean counts, averaged over positions in a\n\
         bin: events are chosen by what they hold and may lie below it; the least is at {bound:.2}. The better estimator is so\n\
         for sure, event by event; where either may be, none is named.\n\n\
         Centred window with the paper's rule: {paper}.\n\
         With the window rule: {window}.\n\n\
         The window takes its background from the bins farther from the peak than half its width, whatever the rule. With that of the paper's rule, the\n\
         highest bin of a quadrant and so counts above the mean, too few photons are left to divide by and its steps go too far:\n\
         its error on the same events would be {low:.2} to {high:.2} times that of the centre of mass (last column), and {} times the\n\
         bound. With its own it is at {} times the bound with the paper's rule and {} with the window rule.\n\n\
         ![Depth error of events](../figures/event-depth.svg)\n",
        100.0 * least(&mut false_shares.clone()),
        100.0 * most_false,
        100.0 * in_pulse,
        bounds(true, 2),
        bounds(true, 1),
        bounds(false, 1),
    )?;
    for first in FIRST_LOOKS {
        let those = outcomes
            .iter()
            .filter(|outcome| outcome.first_look == first);
        table(text, first, those)?;
    }
    Ok(())
}

fn table<'a>(
    text: &mut String,
    first_look: u32,
    outcomes: impl Iterator<Item = &'a Outcome>,
) -> Result<()> {
    write!(
        text,
        "\nFirst look after {first_look} laser cycles; root mean square errors in bins:\n\n\
         | pulse σ, bins | background a bin and cycle | rule | α or z | false events, % | exposures with an event, % | cycles | photons | centre of mass of 3 | over the bound | centred window | over the bound | better | centred, the rule's background |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n"
    )?;
    for outcome in outcomes {
        let [mass, centred, rules] = outcome.placed;
        let better = outcome.better().map(|number| ESTIMATORS.get(number));
        let better = match better {
            None => "either",
            Some(estimator) => estimator.context("no such estimator")?.1,
        };
        writeln!(
            text,
            "| {} | {} | {} | {:.2} | {:.1} | {:.0} | {:.0} | {:.0} | {} | {:.2} | {} | {:.2} | {better} | {:.3} |",
            outcome.sigma,
            outcome.background,
            outcome.method.label(),
            outcome.threshold,
            100.0 * outcome.false_share.value,
            100.0 * outcome.event_share.value,
            outcome.cycles,
            outcome.signal,
            mass.error.text(3),
            mass.over_bound.value,
            centred.error.text(3),
            centred.over_bound.value,
            rules.error.value
        )?;
    }
    Ok(())
}
