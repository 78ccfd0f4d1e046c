//! How often a pixel of a dim wall is reported, alone or in a block.

use super::setting::{
    L2, LEVELS, SIGMA, Setting, VERDICT_HEAD, by_level, levels_name, verdict_cells,
    with_one_patience_alone,
};
use super::simulated_array::{Reports, SimulatedArray, verdict};
use crate::sweep::charts::{joined, joined_key, panel};
use crate::sweep::mean::{Measured, Z_99, add, add_count};
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid};
use anyhow::Result;
use dtof_core::Array;
use dtof_draw::chart::{Axis, Chart, Panel, Point as Dot};
use dtof_draw::palette::{Pen, STEPS};
use dtof_light::rates::Rates;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;
use std::fmt::Write as _;

const BACKGROUND: f64 = 0.05;
/// Signal photons a laser cycle.
const SIGNALS: [f64; 6] = [0.025, 0.05, 0.1, 0.145, 0.3, 1.0];
const PATIENCES: [f64; 3] = [40.0, 64.0, 250.0];
const PENS: [Pen; 4] = [STEPS[0], STEPS[2], STEPS[4], STEPS[6]];
const ARRAY: Array = Array::new(8, 8).unwrap();
/// Laser cycles to settle, and those that count.
const BEFORE: u64 = 1000;
const CYCLES: u64 = 4000;

/// Reports of a flat target by its signal, at equal rates of false alarms.
pub const STUDY: Study = Study {
    name: "binning-reports",
    about: "laser cycles between right reports of a pixel, for 0 to 3 levels of blocks",
    revision: 1,
    few_seeds: 2,
    all_seeds: 40,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    let points = grid([
        ("patience", &PATIENCES),
        ("levels", &LEVELS),
        ("signal", &SIGNALS),
    ]);
    let mut points = with_one_patience_alone(points, PATIENCES[0]);
    points.extend(grid([
        ("lend", &[1.0]),
        ("levels", &[0.0]),
        ("patience", &PATIENCES[1..]),
        ("signal", &SIGNALS),
    ]));
    points
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let mut setting = Setting::of(point)?;
    let z = setting.z();
    // A pixel that lends gives its photons away after the patience and starts over: its own
    // exposure is no longer. Its block does not matter here.
    if point.contains_key("lend") {
        setting.l2 = setting.patience;
    }
    let position = 40.0 + Uniform::new(0.0, 1.0)?.sample(rng);
    let rates = Rates {
        background: BACKGROUND,
        signal: point["signal"],
        position,
        sigma: SIGMA,
    };
    let settings = setting.settings(z)?;
    let mut array = SimulatedArray::new(ARRAY, &vec![rates; ARRAY.pixels() as usize], &settings)?;
    let mut events = Vec::new();
    array.run(BEFORE, rng, |_| {})?;
    array.run(CYCLES, rng, |event| events.push(*event))?;
    let mut reports = Reports::new(ARRAY);
    let mut tally = Tally::new();
    for event in &events {
        let covered = reports.take(event).len() as u64;
        let level = event.level.to_string();
        add(&mut tally, verdict(event, position), &level, covered);
    }
    add_count(&mut tally, "cycles", CYCLES * u64::from(ARRAY.pixels()));
    Ok(tally)
}

/// Right events of pixels that share with two levels, or that lend, relative to pixels without
/// blocks.
fn kept(part: &Part, is_lent: bool, patience: f64, signal: f64) -> Measured {
    let own = |point: &PointTally| point.count("right 0") as f64;
    let alone = part.one([
        ("levels", 0.0),
        ("patience", PATIENCES[0]),
        ("signal", signal),
    ]);
    let at = [("patience", patience), ("signal", signal)];
    let of = if is_lent {
        part.one([("lend", 1.0), at[0], at[1]])
    } else {
        part.one([("levels", 2.0), at[0], at[1]])
    };
    let (of, alone) = (own(of), own(alone).max(1.0));
    // Treats both counts as Poisson.
    let half = Z_99 * (1.0 / of.max(1.0) + 1.0 / alone).sqrt();
    let value = of / alone;
    Measured {
        value,
        interval: ((value * (1.0 - half)).max(0.0), value * (1.0 + half)),
    }
}

/// Pixels that lend compared with pixels that share.
fn lending(part: &Part) -> Result<(Figure, [String; 4])> {
    let ways = [
        (false, PATIENCES[1], STEPS[0], "share, patience 64"),
        (true, PATIENCES[2], STEPS[3], "lend, patience 250"),
        (true, PATIENCES[1], STEPS[6], "lend, patience 64"),
    ];
    let series = ways.map(|(is_lent, patience, pen, _)| {
        let kept = |signal| kept(part, is_lent, patience, signal).at(signal);
        joined(pen, SIGNALS.map(kept))
    });
    let value = |way: usize, signal| {
        let (is_lent, patience, ..) = ways[way];
        kept(part, is_lent, patience, signal).value
    };
    let percentages = [(0, 0.145), (2, 0.145), (1, 0.145), (2, 0.05)]
        .map(|(way, signal)| format!("{:.0}", 100.0 * value(way, signal)));
    let chart = Chart {
        finding: format!(
            "With a patience of 64 pixels that share keep {} % of their own events, pixels that lend \
             {} % (0.145 signal photons a laser cycle)",
            percentages[0], percentages[1]
        ),
        holds: value(0, 0.145) > 2.0 * value(2, 0.145),
        note: format!(
            "Right events over those of pixels alone, whose exposures last up to {L2} laser cycles. A pixel that \
             lends starts anew after the patience. Bars hold 99 %."
        ),
        x: Axis::logarithmic("signal photons a laser cycle"),
        y: Axis::linear("own events kept, %")
            .percent()
            .within(0.0, 1.1),
        key: ways.map(|(.., pen, name)| joined_key(pen, name)).into(),
        columns: 1,
        panels: vec![Panel::only(series.into())],
    };
    Ok((Figure::new("binning-lend", &chart)?, percentages))
}

/// Laser cycles between right reports of a pixel: its own reports, and all.
fn between(part: &Part, levels: f64, patience: f64, signal: f64) -> [f64; 2] {
    let patience = if levels > 0.0 { patience } else { PATIENCES[0] };
    let point = part.one([
        ("levels", levels),
        ("patience", patience),
        ("signal", signal),
    ]);
    let right = by_level(point, "right");
    let cycles = point.count("cycles") as f64;
    [right[0], right.iter().sum()].map(|reports| cycles / reports as f64)
}

fn results(part: &Part) -> Result<Results> {
    let mut csv = format!("patience,levels,signal,cycles,{VERDICT_HEAD},lend\n");
    for point in part.points() {
        let at = point.parameter_cells(["patience", "levels", "signal"]);
        let (cycles, reports) = (point.count("cycles"), verdict_cells(point));
        let is_lent = u8::from(point.parameters.contains_key("lend"));
        writeln!(csv, "{at},{cycles},{reports},{is_lent}")?;
    }
    let panels = PATIENCES.map(|patience| {
        let series = LEVELS.into_iter().zip(PENS).map(|(levels, pen)| {
            let all = |signal| between(part, levels, patience, signal)[1];
            let dots = Dot::curve(SIGNALS, all).into_iter();
            joined(pen, dots.filter(|dot| dot.y.is_finite()))
        });
        panel(format!("patience {patience}"), series)
    });
    let of = |levels, signal| between(part, levels, PATIENCES[1], signal);
    let [dim, bright] =
        [0.05, 0.145].map(|signal| [0.0, 2.0, 3.0].map(|levels| of(levels, signal)[1]));
    let kept = of(3.0, 0.145)[0];
    let chart = Chart {
        finding: format!(
            "A pixel of 0.05 signal photons a cycle is reported each {:.0} laser cycles with two \
             levels, {:.0} with three, {:.0} alone",
            dim[1], dim[2], dim[0]
        ),
        holds: dim[1] <= 250.0
            && dim[2] <= 120.0
            && bright[1] <= bright[0]
            && bright[2] <= bright[0],
        note: format!(
            "1 % of pixels are covered by a false report in {L2} laser cycles; background \
             {BACKGROUND} a bin and cycle, σ 1 bin."
        ),
        x: Axis::logarithmic("signal photons a laser cycle"),
        y: Axis::logarithmic("laser cycles between right reports of a pixel"),
        key: LEVELS
            .into_iter()
            .zip(PENS)
            .map(|(levels, pen)| joined_key(pen, levels_name(levels)))
            .collect(),
        columns: 3,
        panels: panels.into(),
    };
    let whole = |value: f64| format!("{value:.0}");
    let (lending, [shared, lent, lent_later, lent_dim]) = lending(part)?;
    Ok(Results {
        figures: vec![Figure::new("binning-reports", &chart)?, lending],
        values: [
            ("alone", whole(dim[0])),
            ("two", whole(dim[1])),
            ("three", whole(dim[2])),
            ("bright alone", whole(bright[0])),
            ("bright two", whole(bright[1])),
            ("bright three", whole(bright[2])),
            ("shared", shared),
            ("lent", lent),
            ("lent later", lent_later),
            ("lent dim", lent_dim),
            ("kept", format!("{:.0}", 100.0 * bright[0] / kept)),
        ]
        .into(),
        tables: vec![("results/data/binning_reports.csv", csv)],
        ..Results::default()
    })
}
