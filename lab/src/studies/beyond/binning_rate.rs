//! Whether pixels and blocks together have the requested rate of false alarms.

use super::setting::{L2, LEVELS, ONE_IN, Setting, by_level, levels_name, with_one_patience_alone};
use super::simulated_array::SimulatedArray;
use crate::sweep::mean::Measured;
use crate::sweep::results::{Figure, Results, ends};
use crate::sweep::{Part, Point, Study, Tally, grid};
use anyhow::Result;
use dtof_core::Array;
use dtof_draw::chart::{Axis, Chart, Key, Panel, Point as Dot, Series, Style};
use dtof_draw::palette::{Pen, REFERENCE, STEPS};
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
            *tally.entry(format!("reports {}", event.level)).or_default() += 1;
        }
        let covered = covered.iter().filter(|&&covered| covered).count() as u64;
        *tally.entry("covered".to_owned()).or_default() += covered;
        *tally.entry("windows".to_owned()).or_default() += u64::from(ARRAY.pixels());
    }
    Ok(tally)
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
            let at = [("tracking", tracking), ("levels", levels)];
            let line = [BACKGROUNDS[0], BACKGROUNDS[2]].map(|x| Dot::exact(x, requested));
            let mut series = vec![Series::unnamed(REFERENCE, Style::Dashed, line.into())];
            for (patience, pen) in PATIENCES.into_iter().zip(PENS) {
                let mut dots = Vec::new();
                for point in part
                    .at(at)
                    .filter(|point| point.parameter("patience") == patience)
                {
                    let covered: Measured = point.share("covered", "windows");
                    let reports = by_level(point, "reports");
                    fewest = fewest.min(reports.iter().sum());
                    shares.push(covered.value / requested);
                    let background = point.parameter("background");
                    dots.push(covered.at(background));
                    let [a, b, c, d] = reports;
                    writeln!(
                        csv,
                        "{tracking},{levels},{patience},{background},{},{a},{b},{c},{d}",
                        covered.cells(5)
                    )?;
                }
                if !dots.is_empty() {
                    series.push(Series::unnamed(pen, Style::JoinedDots, dots));
                }
            }
            let with = if tracking > 0.0 { ", tracking" } else { "" };
            panels.push(Panel {
                title: levels_name(levels) + with,
                series,
            });
        }
    }
    let (least, most) = ends(shares);
    let mut key = vec![Key::new(
        REFERENCE,
        Style::Dashed,
        "1 %, as asked for".to_owned(),
    )];
    for (patience, pen) in PATIENCES.into_iter().zip(PENS) {
        key.push(Key::new(
            pen,
            Style::JoinedDots,
            format!("patience {patience}"),
        ));
    }
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
        key,
        columns: 4,
        panels,
    };
    Ok(Results {
        figures: vec![Figure::new("binning-rate", &chart)?],
        values: [
            ("least", format!("{least:.2}")),
            ("most", format!("{most:.2}")),
            ("fewest", dtof_data::options::rows::grouped(fewest)),
        ]
        .into(),
        tables: vec![("results/data/binning_rate.csv", csv)],
        ..Results::default()
    })
}
