//! The depth error of events, on the histograms at which a rule fires.
//!
//! A rule ends the exposure as soon as a peak is high enough. So the histogram of an event differs
//! from that of a fixed exposure: random excess counts ended it.

mod outcome;
mod pixel;

use self::pixel::{Pixel, exposure};
use crate::studies::methods::passage::Rule;
use crate::studies::methods::time_to_detect::signal;
use crate::sweep::charts::{joined, joined_key, panel};
use crate::sweep::mean::{add, add_error, add_value};
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, Point, Study, Tally, grid};
use anyhow::Result;
use dtof_core::fixed::types::U8F8;
use dtof_core::{DepthEstimator, WindowRule};
use dtof_data::options::rows::grouped;
use dtof_draw::chart::{Axis, Chart};
use dtof_draw::palette::{CENTRED, PAPER};
use dtof_light::rates::Rates;
use rand_core::Rng;
use rand_pcg::Pcg64;
use std::fmt::Write as _;

pub use self::outcome::{DepthErrors, EventDepthOutcome, outcomes};

pub use crate::studies::methods::time_to_detect::{BACKGROUNDS, SIGMAS};

/// The first looks, in laser cycles: early, with few photons, and late, with enough photons for
/// most pulses. L1 is one less.
pub const FIRST_LOOKS: [u32; 2] = [40, 400];
/// The estimators: names in tallies, and in tables and figures.
pub const ESTIMATORS: [(&str, &str); 2] =
    [("mass3", "centroid of 3"), ("centred", "centred window")];
/// Exposures of a trial, with the pulse at positions evenly spread over a bin.
const EXPOSURES: u32 = 64;

/// The estimators on the events of the rules.
pub const STUDY: Study = Study {
    name: "event-depth",
    about: "depth error of the events of a rule as they come, by pulse, background and estimator",
    revision: 3,
    few_seeds: 30,
    all_seeds: 300,
    points,
    trial,
    results,
};

/// [`ESTIMATORS`] for a pulse of `sigma` bins.
fn estimators(sigma: f64) -> [DepthEstimator; 2] {
    let centred = DepthEstimator::for_pulse(U8F8::saturating_from_num(sigma));
    [DepthEstimator::Centroid3, centred]
}

/// The window rule that suits a pulse of `sigma` bins.
fn suited(sigma: f64) -> Rule {
    Rule::Window(WindowRule::width_for_pulse(U8F8::saturating_from_num(
        sigma,
    )))
}

/// The paper's rule and the window rule, at both first looks.
fn pixels(sigma: f64, background: f64) -> Result<Vec<Pixel>> {
    let mut pixels = Vec::new();
    for first in FIRST_LOOKS {
        for rule in [Rule::Paper, suited(sigma)] {
            pixels.push(Pixel::new(rule, first, background)?);
        }
    }
    Ok(pixels)
}

/// Each scene with a target, and without one to count false alarms.
fn points() -> Vec<Point> {
    grid([
        ("sigma", &SIGMAS),
        ("background", &BACKGROUNDS),
        ("target", &[0.0, 1.0]),
    ])
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let (sigma, background) = (point["sigma"], point["background"]);
    let pixels = pixels(sigma, background)?;
    let estimators = estimators(sigma);
    let steps = 256 / EXPOSURES;
    let mut tally = Tally::from([("exposures".to_owned(), EXPOSURES.into())]);
    for index in 0..EXPOSURES {
        // In 1/256 bin, as in the core.
        let place = (64 << 8) + index * steps + rng.next_u32() % steps;
        let rates = Rates {
            background,
            signal: signal(sigma, background) * point["target"],
            position: f64::from(place) / 256.0,
            sigma,
        };
        let events = exposure(&rates, &pixels, &estimators, rng)?;
        for (pixel, event) in pixels.iter().zip(events) {
            let Some(event) = event else { continue };
            let name = pixel.name();
            add(&mut tally, &name, "events", 1);
            let middle = f64::from(event.peak) + 0.5;
            if (middle - rates.position).abs() > 2.0 * sigma + 1.0 {
                // A false alarm, not an error of depth.
                add(&mut tally, &name, "elsewhere", 1);
                continue;
            }
            add(&mut tally, &name, "cycles", event.cycles.into());
            add(&mut tally, &name, "signal", event.signal);
            let errors = event
                .positions
                .map(|position| i64::from(position - place.cast_signed()));
            for (error, (estimator, _)) in errors.into_iter().zip(ESTIMATORS) {
                add_error(&mut tally, &format!("{name} {estimator}"), error);
            }
            // On the same event: a paired difference is more precise.
            let [mass, centred] = errors.map(|error| error * error);
            add_value(&mut tally, &format!("{name} excess"), centred - mass);
        }
    }
    Ok(tally)
}

fn results(part: &Part) -> Result<Results> {
    let outcomes = outcomes(part)?;
    let exposures = part.one([("target", 1.0)]).count("exposures");
    Ok(Results {
        figures: vec![Figure::new("event-depth", &chart(&outcomes))?],
        values: [("exposures", grouped(exposures))].into(),
        tables: vec![("results/data/event_depth.csv", csv(&outcomes)?)],
        ..Results::default()
    })
}

/// A panel for each rule and pulse, from the earlier first look.
fn chart(outcomes: &[EventDepthOutcome]) -> Chart {
    let pens = [PAPER, CENTRED];
    let early = || {
        let outcomes = outcomes.iter();
        outcomes.filter(|outcome| outcome.first_look == FIRST_LOOKS[0])
    };
    let mut panels = Vec::new();
    for (is_paper, rule) in [(true, "paper's rule"), (false, "window rule")] {
        for sigma in SIGMAS {
            let is_here = |outcome: &&EventDepthOutcome| {
                (outcome.rule == Rule::Paper) == is_paper && outcome.sigma == sigma
            };
            let series = pens.into_iter().enumerate().map(|(number, pen)| {
                let dots = early().filter(is_here).map(|outcome| {
                    let error = outcome.errors[number].error;
                    error.at(outcome.background)
                });
                joined(pen, dots)
            });
            panels.push(panel(format!("{rule}, σ {sigma}"), series));
        }
    }
    let estimators = ESTIMATORS.into_iter().zip(pens);
    let key = estimators.map(|((_, name), pen)| joined_key(pen, name));
    // Whether the window is better than the centroid for the events of the paper's rule.
    let of_paper = || early().filter(|outcome| outcome.rule == Rule::Paper);
    let better = of_paper().filter(|outcome| outcome.better() == Some(1));
    let worse = of_paper().any(|outcome| outcome.better() == Some(0));
    Chart {
        finding: "With the paper's rule, a centred window places events better than the centroid"
            .to_owned(),
        holds: 2 * better.count() > of_paper().count() && !worse,
        note: "Bars hold 99 %.".to_owned(),
        x: Axis::logarithmic("background photons a bin and laser cycle"),
        y: Axis::linear("root mean square depth error of events, bins"),
        key: key.collect(),
        columns: 3,
        panels,
    }
}

fn csv(outcomes: &[EventDepthOutcome]) -> Result<String> {
    let mut csv = "first_look,sigma,background,rule,threshold,false_share,events,event_share,in_pulse,cycles,signal,\
                   estimator,error,low,high,bias,bias_low,bias_high,over_bound,better\n"
        .to_owned();
    for outcome in outcomes {
        let better = outcome.better();
        for (index, (name, _)) in ESTIMATORS.into_iter().enumerate() {
            let errors = outcome.errors[index];
            writeln!(
                csv,
                "{},{},{},{},{:.4},{:.4},{},{:.4},{:.4},{:.1},{:.1},{name},{},{},{:.3},{}",
                outcome.first_look,
                outcome.sigma,
                outcome.background,
                outcome.rule.name(),
                outcome.threshold,
                outcome.false_share.value,
                outcome.events,
                outcome.event_share.value,
                outcome.in_pulse.value,
                outcome.cycles,
                outcome.signal,
                errors.error.cells(4),
                errors.bias.cells(4),
                errors.over_bound.value,
                match better {
                    Some(better) if better == index => "yes",
                    Some(_) => "no",
                    None => "",
                }
            )?;
        }
    }
    Ok(csv)
}
