//! Whether pixels and blocks together have the requested rate of false alarms.

use super::setting::{L2, LEVELS, ONE_IN, Setting, by_level, levels_name, with_one_patience_alone};
use super::simulated_array::SimulatedArray;
use crate::sweep::charts::{joined, joined_key, level, level_key, panel};
use crate::sweep::mean::{Measured, add, add_count};
use crate::sweep::results::{Figure, Results, ends};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid};
use anyhow::Result;
use dtof_core::Array;
use dtof_data::options::rows::grouped;
use dtof_draw::chart::{Axis, Chart};
use dtof_draw::palette::{Pen, STEPS};
use dtof_light::rates::Rates;
use rand_pcg::Pcg64;
use std::fmt::Write as _;

/// Background photons a bin and laser cycle.
const BACKGROUNDS: [f64; 3] = [0.01, 0.05, 0.2];
const PATIENCES: [f64; 2] = [40.0, 1000.0];
/// The pens of the patiences.
const PENS: [Pen; 2] = [STEPS[1], STEPS[5]];
const ARRAY: Array = Array::new(8, 8).unwrap();
/// Laser cycles to settle, then windows that count.
const BEFORE: u64 = 2000;
const WINDOWS: u64 = 20;

/// The share of pixels that a false report covers in 1000 laser cycles.
pub const STUDY: Study = Study {
    name: "binning-rate",
    about: "false alarms of pixels and blocks together, for 0 to 3 levels, with and without tracking",
    revision: 1,
    few_seeds: 1,
    all_seeds: 120,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    let points = grid([
        ("tracking", &[0.0, 1.0]),
        ("levels", &LEVELS),
        ("patience", &PATIENCES),
        ("background", &BACKGROUNDS),
    ]);
    with_one_patience_alone(points, PATIENCES[0])
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let setting = Setting::of(point)?;
    let settings = setting.settings(setting.z())?;
    let rates = vec![Rates::without_target(point["background"]); ARRAY.pixels() as usize];
    let mut array = SimulatedArray::new(ARRAY, &rates, &settings)?;
    array.run(BEFORE, rng, |_| {})?;
    let mut tally = Tally::new();
    for _ in 0..WINDOWS {
        let mut events = Vec::new();
        array.run(L2.into(), rng, |event| events.push(*event))?;
        let mut covered = vec![false; ARRAY.pixels() as usize];
        for event in &events {
            for pixel in ARRAY.pixels_of(event.pixel, event.level) {
                covered[usize::from(pixel.raw())] = true;
            }
            add(&mut tally, "reports", &event.level.to_string(), 1);
        }
        let covered = covered.iter().filter(|&&covered| covered).count() as u64;
        add_count(&mut tally, "covered", covered);
        add_count(&mut tally, "windows", ARRAY.pixels().into());
    }
    Ok(tally)
}

/// The share of pixels that a false report covers.
fn covered(point: &PointTally) -> Measured {
    point.share("covered", "windows")
}

fn results(part: &Part) -> Result<Results> {
    let mut csv =
        "tracking,levels,patience,background,covered,low,high,reports 0,reports 1,reports 2,reports 3\n"
            .to_owned();
    let requested = 1.0 / f64::from(ONE_IN);
    let mut panels = Vec::new();
    let mut shares = Vec::new();
    let mut fewest = u64::MAX;
    for tracking in [0.0, 1.0] {
        for levels in LEVELS {
            let mut series = vec![level(&BACKGROUNDS, requested)];
            for (patience, pen) in PATIENCES.into_iter().zip(PENS) {
                let at = [
                    ("tracking", tracking),
                    ("levels", levels),
                    ("patience", patience),
                ];
                for point in part.at(at) {
                    let covered = covered(point);
                    let reports = by_level(point, "reports");
                    fewest = fewest.min(reports.iter().sum());
                    shares.push(covered.value / requested);
                    let background = point.parameter("background");
                    let covered = covered.cells(5);
                    let reports = reports.map(|count| count.to_string()).join(",");
                    writeln!(
                        csv,
                        "{tracking},{levels},{patience},{background},{covered},{reports}"
                    )?;
                }
                let curve = joined(pen, part.dots(at, "background", covered));
                if !curve.points.is_empty() {
                    series.push(curve);
                }
            }
            let with = if tracking > 0.0 { ", tracking" } else { "" };
            panels.push(panel(levels_name(levels) + with, series));
        }
    }
    let (least, most) = ends(shares);
    let patiences = PATIENCES.into_iter().zip(PENS);
    let patiences =
        patiences.map(|(patience, pen)| joined_key(pen, format!("patience {patience}")));
    let key = [level_key("1 %, as asked for")]
        .into_iter()
        .chain(patiences);
    let chart = Chart {
        finding: format!(
            "Pixels and blocks have {least:.2} to {most:.2} times the false alarms asked for"
        ),
        holds: least >= 0.7 && most <= 1.3,
        note:
            "The share of pixels that a false report covers in 1000 laser cycles; bars hold 99 % \
               as if pixels were independent."
                .to_owned(),
        x: Axis::logarithmic("background photons a bin and laser cycle"),
        y: Axis::linear("pixels covered, %")
            .percent()
            .within(0.0, 0.02),
        key: key.collect(),
        columns: 4,
        panels,
    };
    Ok(Results {
        figures: vec![Figure::new("binning-rate", &chart)?],
        values: [
            ("least", format!("{least:.2}")),
            ("most", format!("{most:.2}")),
            ("fewest", grouped(fewest)),
        ]
        .into(),
        tables: vec![("results/data/binning_rate.csv", csv)],
        ..Results::default()
    })
}
