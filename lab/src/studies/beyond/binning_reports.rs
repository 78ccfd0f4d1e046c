//! How often a pixel of a dim wall is reported, by itself or in a block.

use super::field::{Field, L2, Reports, SIGMA, Setting, is_right, level};
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, Point, Study, Tally, grid, whole};
use anyhow::Result;
use dtof::input::source::Geometry;
use dtof_draw::chart::{Axis, Chart, Key, Panel, Point as Dot, Series, Style};
use dtof_draw::palette::{Pen, STEPS};
use dtof_theory::rates::Rates;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;
use std::fmt::Write as _;

const BACKGROUND: f64 = 0.05;
/// Signal photons a laser cycle.
const SIGNALS: [f64; 6] = [0.025, 0.05, 0.1, 0.145, 0.3, 1.0];
const LEVELS: [f64; 4] = [0.0, 1.0, 2.0, 3.0];
const PATIENCES: [f64; 3] = [40.0, 64.0, 250.0];
const PENS: [Pen; 4] = [STEPS[0], STEPS[2], STEPS[4], STEPS[6]];
const ONE_IN: u32 = 100;
const ARRAY: Geometry = Geometry::new(8, 8);
/// Laser cycles before what counts, and those that count.
const BEFORE: u64 = 1000;
const CYCLES: u64 = 4000;

/// Reports of a flat target over its signal, at equal false alarms.
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
    let mut points = grid([
        ("patience", &PATIENCES),
        ("levels", &LEVELS),
        ("signal", &SIGNALS),
    ]);
    points.retain(|point| point["levels"] > 0.0 || point["patience"] == PATIENCES[0]);
    points
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let setting = Setting {
        levels: level(point["levels"])?,
        patience: whole(point, "patience"),
        tracking: false,
        one_in: ONE_IN,
    };
    let position = 40.0 + Uniform::new(0.0, 1.0)?.sample(rng);
    let rates = Rates {
        background: BACKGROUND,
        signal: point["signal"],
        position,
        sigma: SIGMA,
    };
    let settings = setting.settings(setting.z())?;
    let mut field = Field::new(ARRAY, &vec![rates; ARRAY.addresses()], &settings)?;
    let mut events = Vec::new();
    field.run(BEFORE, rng, |_| {})?;
    field.run(CYCLES, rng, |event| events.push(*event))?;
    let mut reports = Reports::new(ARRAY);
    let mut tally = Tally::new();
    let mut add = |what: &str, number: u64| *tally.entry(what.to_owned()).or_default() += number;
    for event in &events {
        let covered: Vec<usize> = field.covered(event, &reports).collect();
        for &pixel in &covered {
            reports.note(pixel, event);
        }
        let verdict = if is_right(event, position) {
            "right"
        } else {
            "wrong"
        };
        add(&format!("{verdict} {}", event.level), covered.len() as u64);
    }
    add("cycles", CYCLES * ARRAY.addresses() as u64);
    Ok(tally)
}

/// Laser cycles between right reports of a pixel; of the pixel itself, and all.
fn between(part: &Part, levels: f64, patience: f64, signal: f64) -> Result<[f64; 2]> {
    let patience = if levels > 0.0 { patience } else { PATIENCES[0] };
    let at = [
        ("levels", levels),
        ("patience", patience),
        ("signal", signal),
    ];
    let point = part.one(at)?;
    let right = [0, 1, 2, 3].map(|level| point.count(&format!("right {level}")));
    let cycles = point.count("cycles") as f64;
    Ok([right[0], right.iter().sum()].map(|reports| cycles / reports as f64))
}

fn results(part: &Part) -> Result<Results> {
    let mut csv = "patience,levels,signal,cycles,right 0,right 1,right 2,right 3,wrong 0,wrong 1,wrong 2,wrong 3\n".to_owned();
    for point in part.points() {
        let counts = ["right", "wrong"].map(|verdict| {
            [0, 1, 2, 3]
                .map(|level| point.count(&format!("{verdict} {level}")).to_string())
                .join(",")
        });
        writeln!(
            csv,
            "{},{},{},{},{}",
            point.parameter("patience"),
            point.parameter("levels"),
            point.parameter("signal"),
            point.count("cycles"),
            counts.join(",")
        )?;
    }
    let mut panels = Vec::new();
    for patience in PATIENCES {
        let mut series = Vec::new();
        for (levels, pen) in LEVELS.into_iter().zip(PENS) {
            let mut dots = Vec::new();
            for signal in SIGNALS {
                let [_, all] = between(part, levels, patience, signal)?;
                if all.is_finite() {
                    dots.push(Dot::exact(signal, all));
                }
            }
            series.push(Series::unnamed(pen, Style::JoinedDots, dots));
        }
        panels.push(Panel {
            title: format!("patience {patience}"),
            series,
        });
    }
    let default = PATIENCES[1];
    let of = |levels, signal| between(part, levels, default, signal);
    let dim = [of(0.0, 0.05)?[1], of(2.0, 0.05)?[1], of(3.0, 0.05)?[1]];
    let bright = [of(0.0, 0.145)?[1], of(2.0, 0.145)?[1], of(3.0, 0.145)?[1]];
    let kept = of(3.0, 0.145)?[0];
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
            .map(|(levels, pen)| {
                let name = match levels {
                    0.0 => "pixels alone".to_owned(),
                    1.0 => "1 level".to_owned(),
                    _ => format!("{levels} levels"),
                };
                Key::new(pen, Style::JoinedDots, name)
            })
            .collect(),
        columns: 3,
        panels,
    };
    let whole = |value: f64| format!("{value:.0}");
    Ok(Results {
        figures: vec![Figure::new("binning-reports", &chart)?],
        values: [
            ("alone", whole(dim[0])),
            ("two", whole(dim[1])),
            ("three", whole(dim[2])),
            ("bright alone", whole(bright[0])),
            ("bright two", whole(bright[1])),
            ("bright three", whole(bright[2])),
            ("kept", format!("{:.0}", 100.0 * bright[0] / kept)),
        ]
        .into(),
        tables: vec![("results/data/binning_reports.csv", csv)],
        ..Results::default()
    })
}
