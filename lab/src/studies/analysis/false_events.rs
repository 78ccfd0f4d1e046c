//! False alarms of the paper's rule with its estimated background, at one look and over an
//! exposure: the data that `dtof tune` interpolates.

use crate::sweep::charts::joined_key;
use crate::sweep::mean::Measured;
use crate::sweep::results::{Claim, Comparison, Figure, Results, Verdict, ends};
use crate::sweep::{self, Part, Point, PointTally, Study, Tally};
use anyhow::{Context, Result};
use dtof_core::Count;
use dtof_core::fixed::types::U8F8;
use dtof_core::paper::Threshold;
use dtof_data::options::rows::grouped;
use dtof_draw::chart::{Axis, Chart, Key, Panel, Point as Dot, Series, Style};
use dtof_draw::palette::{NEUTRAL, alpha as pen};
use dtof_light::gaussian::false_positive_rate;
use dtof_light::looks::repeated_looks::{ALPHA_STEPS, FalseAlarms, MINIMUM_COUNT, alpha_bits};
use dtof_light::looks::single_look::SingleLook;
use dtof_light::looks::{repeated_looks, table};
use rand_pcg::Pcg64;

/// Exposures of a trial.
const EXPOSURES: u32 = 50;
/// α of the figures.
const ALPHAS: [u16; 3] = [3, 4, 5];
/// The first look of the figures, in steps of X laser cycles, and the last of an
/// exposure: 36 looks.
const LOOKS: (u32, u32) = (5, 40);

/// Background only, 128 bins, minimum count 5.
pub const STUDY: Study = Study {
    name: "false-events",
    about: "false alarms of one look and of an exposure by background and α",
    revision: 1,
    few_seeds: 40,
    all_seeds: 400,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    table::points().iter().map(of_study).collect()
}

fn of_study(point: &repeated_looks::Point) -> Point {
    sweep::point([
        ("first_mean", point.first_mean),
        ("first_look", point.first.into()),
    ])
}

/// The table's point.
fn of_table(parameters: &Point) -> Result<repeated_looks::Point> {
    let mut points = table::points().into_iter();
    let found = points.find(|point| of_study(point) == *parameters);
    found.context("not a point of the table")
}

/// The count of exposures whose highest firing α, up to the look `last`, lies between that of
/// `step` and the next.
fn name(last: u32, step: usize) -> String {
    format!("{last} {}", f64::from(alpha_bits(step)) / 256.0)
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let point = of_table(point)?;
    let found = FalseAlarms::trial(&point, EXPOSURES, rng)?;
    let mut tally = Tally::from([("exposures".to_owned(), found.exposures)]);
    for (&last, events) in point.lasts.iter().zip(&found.events) {
        for (step, &count) in events.iter().enumerate() {
            // Includes those of the next α.
            let higher = events.get(step + 1).copied().unwrap_or_default();
            if count > higher {
                tally.insert(name(last, step), count - higher);
            }
        }
    }
    Ok(tally)
}

/// The tally of a point as cumulative counts.
fn false_events(point: &PointTally) -> Result<(repeated_looks::Point, FalseAlarms)> {
    let of = of_table(&point.parameters)?;
    let mut sum = FalseAlarms::new(of.lasts.len());
    sum.exposures = point.count("exposures");
    for (&last, events) in of.lasts.iter().zip(&mut sum.events) {
        let mut higher = 0;
        for (step, count) in (0..ALPHA_STEPS).zip(events).rev() {
            higher += point.count(&name(last, step));
            *count = higher;
        }
    }
    Ok((of, sum))
}

/// The share of exposures with a false alarm at α up to the look `last`, by the background at the
/// first look.
fn shares(part: &Part, last: u32, alpha: u16) -> Result<Vec<(f64, Measured)>> {
    let mut shares = Vec::new();
    for point in part.at([("first_look", LOOKS.0.into())]) {
        let (of, found) = false_events(point)?;
        let Some(at) = of.lasts.iter().position(|&look| look == last) else {
            continue;
        };
        let step = (0..ALPHA_STEPS).find(|&step| alpha_bits(step) == alpha * 256);
        let events = found.events[at][step.context("an α that is not simulated")?];
        shares.push((of.first_mean, Measured::share(events, found.exposures)));
    }
    Ok(shares)
}

/// The exact probability of a false alarm at one look.
fn exact(background: f64, alpha: u16) -> f64 {
    let minimum_count = Count::saturating(MINIMUM_COUNT.into());
    let threshold = Threshold::new(U8F8::from_num(alpha), minimum_count);
    SingleLook::new(128, background).false_alarm_probability(&threshold)
}

/// Eq. 10, for all bins except that of the pulse.
fn printed(alpha: u16) -> f64 {
    false_positive_rate(alpha.into(), 127)
}

/// 15 backgrounds a decade from 0.1 to 300.
fn fine_backgrounds() -> impl Iterator<Item = f64> {
    (-15..=37).map(|step| 10f64.powf(f64::from(step) / 15.0))
}

fn results(part: &Part) -> Result<Results> {
    let tallies = part.points().iter().map(false_events);
    let tallies: Vec<_> = tallies.collect::<Result<_>>()?;
    let exposures = grouped(part.points()[0].count("exposures"));
    Ok(Results {
        figures: vec![
            Figure::new("false-events-look", &chart(part, LOOKS.0)?)?,
            Figure::new("false-events-exposure", &chart(part, LOOKS.1)?)?,
        ],
        claims: claims(part)?,
        values: [("exposures", exposures)].into(),
        tables: vec![(
            "../host/light/data/repeated_looks.csv",
            table::csv(&tallies)?,
        )],
    })
}

fn claims(part: &Part) -> Result<Vec<Claim>> {
    let mut pairs = Vec::new();
    for alpha in ALPHAS {
        let shares = shares(part, LOOKS.0, alpha)?;
        pairs.extend(
            shares
                .into_iter()
                .map(|(background, share)| (share, exact(background, alpha))),
        );
    }
    let compared = Comparison::of(pairs);
    let range = |last| -> Result<(f64, f64)> {
        let shares = shares(part, last, 4)?;
        let values = shares.iter().map(|(_, share)| share.value);
        Ok(ends(values))
    };
    let (look, exposure) = (range(LOOKS.0)?, range(LOOKS.1)?);
    // Within a factor of 2 over all backgrounds.
    let is_printed = |(low, high): (f64, f64)| {
        let printed = printed(4);
        Verdict::of(printed / 2.0 < low && high < 2.0 * printed)
    };
    Ok(vec![
        Claim::new(
            "look",
            format!(
                "{:.2} to {:.2} % over 0.1 to 300 background counts a bin; exact form and simulation differ \
                 at {} of {} points",
                look.0 * 100.0,
                look.1 * 100.0,
                compared.outside,
                compared.points
            ),
            is_printed(look),
        ),
        Claim::new(
            "exposure",
            format!(
                "{:.2} to {:.2} % of exposures of {} looks over 0.1 to 200 background counts a bin",
                exposure.0 * 100.0,
                exposure.1 * 100.0,
                LOOKS.1 - LOOKS.0 + 1
            ),
            is_printed(exposure),
        ),
    ])
}

fn chart(part: &Part, last: u32) -> Result<Chart> {
    let is_look = last == LOOKS.0;
    let mut series = Vec::new();
    for alpha in ALPHAS {
        let shares = shares(part, last, alpha)?;
        let dots = shares
            .into_iter()
            .map(|(background, share)| share.at(background));
        let line = |of: fn(f64, u16) -> f64| {
            Dot::curve(fine_backgrounds(), |background| of(background, alpha))
        };
        let (name, pen) = (format!("α = {alpha}"), pen(alpha.into()));
        let style = if is_look {
            Style::Dots
        } else {
            Style::JoinedDots
        };
        series.push(Series::named(name, pen, style, dots.collect()));
        if is_look {
            series.push(Series::unnamed(pen, Style::Line, line(exact)));
        }
        let printed = line(|_, alpha| printed(alpha));
        series.push(Series::unnamed(pen, Style::Dashed, printed));
    }
    let shares = shares(part, last, 4)?;
    let at_4 = shares.iter().map(|(_, share)| share.value);
    let (low, high) = ends(at_4);
    let spread = low * 30.0 < printed(4) && high > printed(4);
    let (finding, key) = if is_look {
        let text =
            "The false alarms of a look change with the background; by Eq. 10 they would not";
        (text, Key::simulated("Eq. 10"))
    } else {
        let text = "One α cannot hold the rate of false alarms: it changes with the background";
        let key = vec![
            joined_key(NEUTRAL, "simulated"),
            Key::new(NEUTRAL, Style::Dashed, "Eq. 10"),
        ];
        (text, key)
    };
    Ok(Chart {
        finding: finding.to_owned(),
        holds: spread,
        note: "Bars hold 99 %; an open dot is an upper limit where there was none.".to_owned(),
        x: Axis::logarithmic("mean background counts a bin at the first look"),
        y: Axis::logarithmic(if is_look {
            "looks with a false alarm, %"
        } else {
            "exposures of 36 looks with a false alarm, %"
        })
        .percent()
        .within(1e-5, 1.0),
        key,
        columns: 1,
        panels: vec![Panel::only(series)],
    })
}
