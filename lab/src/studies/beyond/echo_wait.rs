//! How long an exposure waits for a second echo: the echoes found, and the cost for the first.

use super::light::Light;
use super::setting::{BINS, L1, SIGMA, X, window_rule};
use crate::sweep::charts::{joined, joined_key, panel};
use crate::sweep::mean::Measured;
use crate::sweep::results::{Figure, Results, ends};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid, tally, whole};
use anyhow::{Context, Result};
use dtof_core::fixed::types::U8F8;
use dtof_core::{
    AsyncPixel, DepthEstimator, EchoNumber, LaserCycle, PixelAddress, PixelConfig, Statistics,
    WindowRule,
};
use dtof_draw::chart::{Axis, Chart, Point as Dot};
use dtof_draw::palette::{Pen, REFERENCE, STEPS};
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;
use std::fmt::Write as _;

/// The default of the program, which is common with two echoes.
const L2: u16 = 2000;
const WAITS: [f64; 5] = [2.0, 4.0, 8.0, 16.0, UNTIL_L2];
const UNTIL_L2: f64 = 255.0;
const BACKGROUNDS: [f64; 2] = [0.01, 0.05];
/// Signal photons of the first surface a laser cycle.
const FIRST: [f64; 2] = [0.145, 1.0];
/// Ratio of the second surface to the first.
const RATIOS: [(f64, &str, Pen); 5] = [
    (NONE, "no second", REFERENCE),
    (0.1, "1/10", STEPS[0]),
    (0.25, "1/4", STEPS[1]),
    (0.5, "1/2", STEPS[2]),
    (1.0, "as bright", STEPS[3]),
];
const NONE: f64 = 0.0;
/// Panels, row by row: the first surface and the background.
const SCENES: [(f64, f64); 4] = [
    (FIRST[0], BACKGROUNDS[0]),
    (FIRST[1], BACKGROUNDS[0]),
    (FIRST[0], BACKGROUNDS[1]),
    (FIRST[1], BACKGROUNDS[1]),
];
/// Bins from the first surface to the second.
const DISTANCE: f64 = 20.0;
/// The largest distance of an event from its surface, in bins.
const NEAR: f64 = 3.0;
/// Bins excluded on either side of an echo.
const REACH: u8 = 4;
/// Exposures of a trial.
const EXPOSURES: u64 = 50;

/// Both echoes, and the laser cycles of the first, by the wait.
pub const STUDY: Study = Study {
    name: "echo-wait",
    about: "both surfaces of a pixel, and the laser cycles an event of the first, over the wait",
    revision: 1,
    few_seeds: 2,
    all_seeds: 100,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    grid([
        ("background", &BACKGROUNDS),
        ("first", &FIRST),
        ("ratio", &RATIOS.map(|(ratio, ..)| ratio)),
        ("wait", &WAITS),
    ])
}

fn config(wait: u16) -> Result<PixelConfig<BINS, WindowRule>> {
    let two = EchoNumber::new(2).context("two")?;
    let estimator = DepthEstimator::for_pulse(U8F8::from_num(SIGMA));
    let config = PixelConfig::with_rule(window_rule(L1, L2)?).x(X);
    let config = config.l1(L1).l2(L2).estimator(estimator);
    Ok(config
        .echoes(two, REACH)
        .echo_wait(wait.try_into()?)
        .build()?)
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let config = config(whole(point, "wait"))?;
    let near = 40.0 + Uniform::new(0.0, 1.0)?.sample(rng);
    let cycles = f64::from(X);
    let first = point["first"] * cycles;
    let mut surfaces = vec![(first, near)];
    if point["ratio"] > NONE {
        surfaces.push((first * point["ratio"], near + DISTANCE));
    }
    let light = Light::new(point["background"] * cycles, &surfaces)?;
    let (mut pixel, mut statistics) = (
        AsyncPixel::<BINS>::new(PixelAddress::new(0)),
        Statistics::new(),
    );
    let (mut cycle, mut exposures) = (LaserCycle::new(0), 0);
    let [mut firsts, mut both, mut wrong] = [0; 3];
    let mut seen = [false; 2];
    while exposures < EXPOSURES {
        pixel.count_batch(&config, &light.draw(rng));
        cycle = LaserCycle::new(cycle.raw() + u64::from(X));
        pixel.end_laser_cycles(&config, &mut statistics, cycle, X);
        if let Some(event) = pixel.take_event() {
            let position = f64::from(event.position().raw()) / 256.0;
            let is_near = |&(_, place): &(f64, f64)| (position - place).abs() <= NEAR;
            match surfaces.iter().position(is_near) {
                Some(surface) => seen[surface] = true,
                None => wrong += 1,
            }
        }
        // An exposure ended with this look.
        if pixel.exposure() == 0 {
            exposures += 1;
            firsts += u64::from(seen[0]);
            both += u64::from(seen == [true; 2]);
            seen = [false; 2];
        }
    }
    Ok(tally([
        ("exposures", exposures),
        ("cycles", cycle.raw()),
        ("first", firsts),
        ("both", both),
        ("wrong", wrong),
    ]))
}

/// The share of exposures that found both surfaces.
fn share(point: &PointTally) -> Measured {
    point.share("both", "exposures")
}

/// Laser cycles per event of the first surface.
fn cycles_a_first(point: &PointTally) -> f64 {
    point.count("cycles") as f64 / point.count("first") as f64
}

/// False events per exposure.
fn wrong(point: &PointTally) -> f64 {
    point.count("wrong") as f64 / point.count("exposures") as f64
}

/// The smallest and the largest value over all scenes with this ratio and wait.
fn range(part: &Part, ratio: f64, wait: f64, value: fn(&PointTally) -> f64) -> (f64, f64) {
    let points = part.at([("ratio", ratio), ("wait", wait)]);
    ends(points.map(value))
}

fn found(part: &Part, ratio: f64, wait: f64) -> (f64, f64) {
    range(part, ratio, wait, |point| share(point).value)
}

/// Percent, rounded down.
fn percent(share: f64) -> String {
    format!("{:.0}", (100.0 * share).floor())
}

fn results(part: &Part) -> Result<Results> {
    let panels = SCENES.map(|(first, background)| {
        let series = RATIOS.map(|(ratio, _, pen)| {
            let at = [
                ("first", first),
                ("background", background),
                ("ratio", ratio),
            ];
            let dots = part.at(at).map(|point| {
                let cycles = cycles_a_first(point);
                if ratio == NONE {
                    Dot::exact(cycles, 0.0)
                } else {
                    share(point).at(cycles)
                }
            });
            joined(pen, dots)
        });
        panel(format!("first {first}, background {background}"), series)
    });
    let half = found(part, 0.5, 4.0).0;
    // The rate of reports of a lone surface relative to a wait until L2.
    let gain = ends(SCENES.map(|(first, background)| {
        let [longest, short] = [UNTIL_L2, 4.0].map(|wait| {
            cycles_a_first(part.one([
                ("first", first),
                ("background", background),
                ("ratio", NONE),
                ("wait", wait),
            ]))
        });
        longest / short
    }));
    let (least, most) = (format!("{:.0}", gain.0), format!("{:.0}", gain.1));
    let chart = Chart {
        finding: format!(
            "In four scenes a wait of 4 reports a lone surface {least} to {most} times as often as one \
             until L2, and finds a second half as bright in {} % of exposures or more",
            percent(half)
        ),
        holds: gain.0 >= 2.0 && half >= 0.5,
        note: format!(
            "Along each curve: waits of 2 (the lowest or leftmost dot), 4, 8, 16 and until L2 ({L2}). The second surface lies {DISTANCE} bins \
             behind; the key says how bright over the first. First: signal photons a laser cycle; background: a bin and \
             laser cycle. σ {SIGMA} bin."
        ),
        x: Axis::logarithmic("laser cycles a report of the first surface"),
        y: Axis::linear("exposures with both, %")
            .percent()
            .within(0.0, 1.08),
        key: RATIOS.map(|(_, name, pen)| joined_key(pen, name)).into(),
        columns: 2,
        panels: panels.into(),
    };
    let of = |wait: f64| percent(found(part, 0.5, wait).0);
    Ok(Results {
        figures: vec![Figure::new("echo-wait", &chart)?],
        values: [
            ("table", table(part)?),
            ("half 4", of(4.0)),
            ("half 8", of(8.0)),
            ("half 16", of(16.0)),
            ("least gain", least),
            ("most gain", most),
            ("exposures", (EXPOSURES * STUDY.all_seeds).to_string()),
        ]
        .into(),
        tables: vec![("results/data/echo_wait.csv", csv(part)?)],
        ..Results::default()
    })
}

/// A row for each wait, with the range over the scenes.
fn table(part: &Part) -> Result<String> {
    let mut rows = String::new();
    for wait in WAITS {
        let until = if wait == UNTIL_L2 {
            "until L2".to_owned()
        } else {
            wait.to_string()
        };
        let (least, most) = range(part, NONE, wait, cycles_a_first);
        write!(rows, "| {until} | {least:.0} to {most:.0} |")?;
        for (ratio, ..) in RATIOS.into_iter().filter(|&(ratio, ..)| ratio > NONE) {
            let (least, most) = found(part, ratio, wait);
            write!(rows, " {} to {} |", percent(least), percent(most))?;
        }
        let wrong = ends(part.at([("wait", wait)]).map(wrong)).1;
        writeln!(rows, " {:.1} |", 100.0 * wrong)?;
    }
    Ok(rows)
}

fn csv(part: &Part) -> Result<String> {
    let mut csv =
        "background,first,ratio,wait,cycles a first,both,low,high,wrong,exposures\n".to_owned();
    for point in part.points() {
        let at = point.parameter_cells(["background", "first", "ratio", "wait"]);
        let (cycles, both) = (cycles_a_first(point), share(point).cells(4));
        let counts = point.count_cells(["wrong", "exposures"]);
        writeln!(csv, "{at},{cycles:.1},{both},{counts}")?;
    }
    Ok(csv)
}
