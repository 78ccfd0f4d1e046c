//! Reports of blocks whose pixels see different depths: edges, slants, and objects of a single
//! pixel.

use super::setting::{LEVELS, SIGMA, Setting, VERDICT_HEAD, by_level, verdict_cells};
use super::simulated_array::{Reports, SimulatedArray, verdict};
use crate::sweep::charts::{joined, joined_key, panel};
use crate::sweep::mean::{Measured, add_count};
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid, numbers, whole};
use anyhow::Result;
use dtof_core::Array;
use dtof_draw::chart::{Axis, Chart};
use dtof_draw::palette::{Pen, STEPS};
use dtof_light::rates::Rates;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;
use std::fmt::Write as _;

const BACKGROUND: f64 = 0.05;
/// Signal of the dim surface, and of the brighter one.
const DIM: f64 = 0.05;
const BRIGHT: f64 = 0.145;
const PATIENCES: [f64; 3] = [40.0, 64.0, 250.0];
const PENS: [Pen; 3] = [STEPS[2], STEPS[4], STEPS[6]];
const ARRAY: Array = Array::new(32, 32).unwrap();
/// Bins between the two surfaces.
const STEP: f64 = 30.0;
const BEFORE: u64 = 1000;
const CYCLES: u64 = 2000;
/// The scenes, by number.
const SCENES: [&str; 6] = [
    "edge, both dim",
    "edge, one brighter",
    "slant of 0.3 bins",
    "slant of 0.6 bins",
    "slant of 1 bin",
    "objects of one pixel",
];
const OBJECTS: usize = 5;

/// Wrong reports of blocks.
pub const STUDY: Study = Study {
    name: "binning-edges",
    about: "wrong reports of blocks at edges and on slants, and objects of one pixel",
    revision: 2,
    few_seeds: 1,
    all_seeds: 16,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    let mut points = grid([
        ("scene", &numbers(SCENES.len())),
        ("levels", &LEVELS),
        ("patience", &PATIENCES),
    ]);
    // Single pixels are needed only for the objects.
    points.retain(|point| {
        let alone = point["scene"] == OBJECTS as f64 && point["patience"] == PATIENCES[0];
        point["levels"] > 0.0 || alone
    });
    points
}

/// Signal and position of each pixel. Each seed places the scene differently.
fn scene(number: usize, rng: &mut Pcg64) -> Result<Vec<(f64, f64)>> {
    let unit = Uniform::new(0.0, 1.0)?;
    let near = 30.0 + unit.sample(rng);
    let shift = 12.0 + 8.0 * unit.sample(rng);
    let pixel = |pixel: usize| {
        let (column, row) = ((pixel % 32) as f64, (pixel / 32) as f64);
        // An edge that is tilted by 20 degrees.
        let is_left = column + row * 20f64.to_radians().tan() < shift + 6.0;
        match number {
            0 | 1 if is_left => (if number == 1 { BRIGHT } else { DIM }, near),
            0 | 1 => (DIM, near + STEP),
            2 => (DIM, near + 0.3 * column),
            3 => (DIM, near + 0.6 * column),
            4 => (DIM, near + column),
            // One pixel of 8 x 8, at a different place in each block.
            _ if pixel % 8 == (pixel / 256) % 8 && (pixel / 32) % 8 == (pixel / 8) % 4 + 2 => {
                (BRIGHT, near)
            }
            _ => (DIM, near + STEP),
        }
    };
    Ok((0..ARRAY.pixels() as usize).map(pixel).collect())
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let setting = Setting::of(point)?;
    let number = usize::from(whole(point, "scene"));
    let seen = scene(number, rng)?;
    let rates = seen.iter().map(|&(signal, position)| Rates {
        background: BACKGROUND,
        signal,
        position,
        sigma: SIGMA,
    });
    let rates: Vec<Rates> = rates.collect();
    let settings = setting.settings(setting.z())?;
    let mut array = SimulatedArray::new(ARRAY, &rates, &settings)?;
    let mut reports = Reports::new(ARRAY);
    let mut events = Vec::new();
    array.run(BEFORE + CYCLES, rng, |event| events.push(*event))?;
    let mut tally = Tally::new();
    for event in &events {
        for pixel in reports.take(event) {
            if event.cycle.raw() < BEFORE {
                continue;
            }
            let (signal, position) = seen[pixel];
            let verdict = verdict(event, position);
            let who = if number == OBJECTS && signal == BRIGHT {
                "object "
            } else {
                ""
            };
            let name = format!("{who}{verdict} {}", event.level);
            add_count(&mut tally, &name, 1);
        }
    }
    tally.insert("runs".to_owned(), 1);
    Ok(tally)
}

/// The share of wrong pixels among those that blocks of these levels cover.
fn wrong(point: &PointTally) -> Measured {
    let sum = |verdict: &str| -> u64 { by_level(point, verdict)[1..].iter().sum() };
    Measured::share(sum("wrong"), sum("wrong") + sum("right"))
}

fn results(part: &Part) -> Result<Results> {
    let mut csv = format!("scene,levels,patience,{VERDICT_HEAD},object right 0\n");
    for point in part.points() {
        let scene = SCENES[usize::from(whole(&point.parameters, "scene"))];
        let at = point.parameter_cells(["levels", "patience"]);
        let (reports, objects) = (verdict_cells(point), point.count("object right 0"));
        writeln!(csv, "{scene},{at},{reports},{objects}")?;
    }
    let panels = SCENES.iter().enumerate().take(OBJECTS);
    let panels = panels.map(|(number, name)| {
        let series = LEVELS[1..].iter().zip(PENS).map(|(&levels, pen)| {
            let at = [("scene", number as f64), ("levels", levels)];
            joined(pen, part.dots(at, "patience", wrong))
        });
        panel(*name, series)
    });
    let at = |scene: usize, levels| {
        part.one([
            ("scene", scene as f64),
            ("levels", levels),
            ("patience", PATIENCES[1]),
        ])
    };
    let most = |levels| {
        let shares = (0..OBJECTS - 1).map(|scene| wrong(at(scene, levels)).value);
        shares.fold(0.0, f64::max)
    };
    let alone = part.one([("scene", OBJECTS as f64), ("levels", 0.0)]);
    let seen = |levels| {
        let with = at(OBJECTS, levels).count("object right 0");
        with as f64 / alone.count("object right 0") as f64
    };
    let percent = |share: f64| format!("{:.1}", 100.0 * share);
    let chart = Chart {
        finding: format!(
            "Of what two levels of blocks report at edges and on slants up to {} % is wrong, of \
             three levels {} %",
            percent(most(2.0)),
            percent(most(3.0))
        ),
        holds: true,
        note:
            "Slants are from pixel to pixel. Wrong by more than 3 bins, of all pixels that a block's event stands for; bars hold \
               99 % as if they were independent."
                .to_owned(),
        x: Axis::logarithmic("patience, laser cycles"),
        y: Axis::linear("wrong, %").percent(),
        key: LEVELS[1..]
            .iter()
            .zip(PENS)
            .map(|(levels, pen)| joined_key(pen, format!("up to level {levels}")))
            .collect(),
        columns: 3,
        panels: panels.collect(),
    };
    Ok(Results {
        figures: vec![Figure::new("binning-edges", &chart)?],
        values: [
            ("two", percent(most(2.0))),
            ("three", percent(most(3.0))),
            ("objects one", format!("{:.0}", 100.0 * seen(1.0))),
            ("objects two", format!("{:.0}", 100.0 * seen(2.0))),
            ("objects three", format!("{:.0}", 100.0 * seen(3.0))),
        ]
        .into(),
        tables: vec![("results/data/binning_edges.csv", csv)],
        ..Results::default()
    })
}
