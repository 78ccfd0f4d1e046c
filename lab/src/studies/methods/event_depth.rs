//! How well events are placed as they come: on the histograms that the rule has chosen.
//!
//! A rule stops as soon as a peak stands clear, so that the histogram of an event is not
//! one of a fixed exposure: what was by chance high enough ended it.

mod outcome;
mod pixel;

use std::fmt::Write as _;

use anyhow::Result;
use dtof_core::fixed::types::U8F8;
use dtof_core::{DepthEstimator, WindowRule};
use rand_core::Rng;
use rand_pcg::Pcg64;

pub use self::outcome::{Outcome, Placed, outcomes};
use self::pixel::{Pixel, exposure};
use crate::studies::methods::passage::Method;
use crate::studies::methods::time_to_detect::signal;
use crate::sweep::mean::{add, add_error, add_value};
use crate::sweep::results::{Figure, Results, Table};
use crate::sweep::{Part, Point, Study, Tally, point};
use dtof::chart::{Axis, Chart, Point as Dot, Series, Style, line_chart};
use dtof::rows::grouped;
use dtof_theory::rates::Rates;

pub use crate::studies::methods::time_to_detect::{BACKGROUNDS, SIGMAS};

/// The first looks, in laser cycles: when there may be few photons, and when most pulses
/// have photons to spare. L1 is one less.
pub const FIRST_LOOKS: [u32; 2] = [40, 400];
/// The estimators, as tallies, tables and figures call them. The first two are a pixel's; the
/// third, which none has, tells what the window has a background of its own for.
pub const ESTIMATORS: [(&str, &str); 3] = [
    ("mass3", "centre of mass of 3"),
    ("centred", "centred window"),
    ("centred-rules", "centred window, the rule's background"),
];
/// Exposures of a trial, the pulse in as many places, evenly over a bin.
const EXPOSURES: u32 = 64;

/// The estimators on what the rules choose.
pub const STUDY: Study = Study {
    name: "event-depth",
    about: "depth error of the events of a rule as they come, by pulse, background and estimator",
    revision: 2,
    few_seeds: 30,
    all_seeds: 300,
    points,
    trial,
    results,
};

/// The estimators that a pixel may have, of [`ESTIMATORS`], for a pulse of `sigma` bins.
fn estimators(sigma: f64) -> [DepthEstimator; 2] {
    let centred = DepthEstimator::for_pulse(U8F8::saturating_from_num(sigma));
    [DepthEstimator::Centroid3, centred]
}

/// The window rule that suits a pulse of `sigma` bins.
fn suited(sigma: f64) -> Method {
    Method::Window(WindowRule::width_for_pulse(U8F8::saturating_from_num(
        sigma,
    )))
}

/// The paper's rule and the window's, at either first look.
fn pixels(sigma: f64, background: f64) -> Result<Vec<Pixel>> {
    let mut pixels = Vec::new();
    for first in FIRST_LOOKS {
        for method in [Method::Paper, suited(sigma)] {
            pixels.push(Pixel::new(method, first, background)?);
        }
    }
    Ok(pixels)
}

/// Each scene with a target, and without to count false events.
fn points() -> Vec<Point> {
    let mut points = Vec::new();
    for sigma in SIGMAS {
        for background in BACKGROUNDS {
            for target in [0.0, 1.0] {
                points.push(point([
                    ("sigma", sigma),
                    ("background", background),
                    ("target", target),
                ]));
            }
        }
    }
    points
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let (sigma, background) = (point["sigma"], point["background"]);
    let pixels = pixels(sigma, background)?;
    let estimators = estimators(sigma);
    let steps = 256 / EXPOSURES;
    let mut tally = Tally::from([("exposures".to_owned(), EXPOSURES.into())]);
    for index in 0..EXPOSURES {
        // In 1/256 bins, as the core counts.
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
                // A false event, not an error of depth.
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
            // On the same event: surer than the two apart.
            let [mass, centred, _] = errors.map(|error| error * error);
            add_value(&mut tally, &format!("{name} excess"), centred - mass);
        }
    }
    Ok(tally)
}

fn results(part: &Part) -> Result<Results> {
    let outcomes = outcomes(part)?;
    let exposures = part.at([("target", 1.0)]).next();
    let exposures = exposures.map_or(0, |point| point.count("exposures"));
    let svg = line_chart(&Chart {
        title: "Depth error of events as they come (pulse σ 0.5, 1 and 1.5 bins from below)",
        x: Axis {
            range: Some((200.0, 660.0)),
            ..Axis::linear("mean laser cycles of the event")
        },
        y: Axis::linear("root mean square error (bins)"),
        series: series(&outcomes),
    })?;
    let better = |number: usize, is_paper: bool| {
        let those = outcomes
            .iter()
            .filter(|outcome| (outcome.method == Method::Paper) == is_paper);
        let those = those.filter(|outcome| outcome.better() == Some(number));
        those.count()
    };
    let half = outcomes.len() / 2;
    Ok(Results {
        figures: vec![Figure {
            name: "event-depth",
            svg,
            caption: format!(
                "Root mean square depth error of the events whose peak is in the pulse, within 2 σ + 1 bins, over their mean laser \
                 cycles, with about 1 % false events an exposure and the first look after {} laser cycles; signal as in \
                 `time-to-detect`, the pulse anywhere in its bin. Joined are the backgrounds of a pulse, 0.01 to 0.2 a bin and laser \
                 cycle. No pixel's window has the background of the paper's rule: it tells what its own is for. \
                 With this first look or one after {} laser cycles, {half} cases a rule, the centred window for the pulse's σ is \
                 surely better than the centre of mass of 3 in {} of them with the paper's rule and surely worse in {}; with the \
                 window rule that suits the pulse better in {}, worse in {} ({} exposures a scene)",
                FIRST_LOOKS[0],
                FIRST_LOOKS[1],
                better(1, true),
                better(0, true),
                better(1, false),
                better(0, false),
                grouped(exposures)
            ),
        }],
        claims: Vec::new(),
        tables: vec![Table {
            path: "results/data/event_depth.csv",
            csv: csv(&outcomes)?,
        }],
    })
}

/// The backgrounds of a pulse, rule and estimator, from the earlier first look.
#[allow(clippy::float_cmp, reason = "parameters are as they were written")]
fn series(outcomes: &[Outcome]) -> Vec<Series> {
    let mut all = Vec::new();
    let rules = [(true, "paper's rule"), (false, "window rule")];
    let mut colour = 0;
    for (is_paper, rule) in rules {
        // A window rule's background is a mean as well.
        let count = if is_paper { 3 } else { 2 };
        for (index, (_, estimator)) in ESTIMATORS.into_iter().take(count).enumerate() {
            let mut name = Some(format!("{rule}, {estimator}"));
            for sigma in SIGMAS {
                let those = outcomes.iter().filter(|outcome| {
                    outcome.first_look == FIRST_LOOKS[0]
                        && outcome.sigma == sigma
                        && (outcome.method == Method::Paper) == is_paper
                });
                let dot = |outcome: &Outcome| {
                    let error = outcome.placed[index].error;
                    Dot {
                        x: outcome.cycles,
                        y: error.value,
                        interval: Some(error.interval),
                    }
                };
                all.push(Series {
                    name: name.take(),
                    colour,
                    style: Style::JoinedDots,
                    points: those.map(dot).collect(),
                });
            }
            colour += 1;
        }
    }
    all
}

fn csv(outcomes: &[Outcome]) -> Result<String> {
    let mut csv = "first_look,sigma,background,rule,threshold,false_share,events,event_share,in_pulse,cycles,signal,\
                   estimator,error,low,high,bias,bias_low,bias_high,over_bound,better\n"
        .to_owned();
    for outcome in outcomes {
        let better = outcome.better();
        for (index, (name, _)) in ESTIMATORS.into_iter().enumerate() {
            let Placed {
                error,
                bias,
                over_bound,
            } = outcome.placed[index];
            writeln!(
                csv,
                "{},{},{},{},{:.4},{:.4},{},{:.4},{:.4},{:.1},{:.1},{name},{:.4},{:.4},{:.4},{:.4},{:.4},{:.4},{:.3},{}",
                outcome.first_look,
                outcome.sigma,
                outcome.background,
                outcome.method.name(),
                outcome.threshold,
                outcome.false_share.value,
                outcome.events,
                outcome.event_share.value,
                outcome.in_pulse.value,
                outcome.cycles,
                outcome.signal,
                error.value,
                error.interval.0,
                error.interval.1,
                bias.value,
                bias.interval.0,
                bias.interval.1,
                over_bound.value,
                match better {
                    Some(better) if index < 2 => {
                        if better == index { "yes" } else { "no" }
                    }
                    _ => "",
                }
            )?;
        }
    }
    Ok(csv)
}
