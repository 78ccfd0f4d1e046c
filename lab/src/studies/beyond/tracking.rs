//! The gain of tracking for a target that stays, and its cost for one that does not.

use super::setting::{L2, SIGMA, Setting};
use super::simulated_array::{SimulatedArray, is_right, verdict};
use crate::sweep::charts::{joined, joined_key, level, panel};
use crate::sweep::mean::{Measured, Z_99, add, add_count, add_value};
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid, whole};
use anyhow::Result;
use dtof_core::{Array, DepthEvent};
use dtof_draw::chart::{Axis, Chart, Point as Dot};
use dtof_draw::palette::{EVENTS, PAPER};
use dtof_light::rates::Rates;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;
use std::fmt::Write as _;

const BACKGROUNDS: [f64; 2] = [0.01, 0.05];
const SIGNALS: [f64; 3] = [0.1, 0.145, 0.3];
/// The motion of the target, by number.
const STEADY: u16 = 0;
const DRIFTS: u16 = 1;
const JUMPS: u16 = 2;
const VANISHES: u16 = 3;
/// A drift, in bins each 100 laser cycles.
const DRIFT: f64 = 0.1;
/// A jump, in bins.
const JUMP: f64 = 30.0;
const ARRAY: Array = Array::new(8, 8).unwrap();
/// Laser cycles with the target at its first position, and after that.
const BEFORE: u64 = 3000;
const AFTER: u64 = 3000;
/// Signal and background of the scene in the title.
const HEADLINE: (f64, f64) = (0.145, 0.05);

/// Tracking with steady, drifting, jumping and vanishing targets.
pub const STUDY: Study = Study {
    name: "tracking",
    about: "laser cycles an event with tracking and without: steady, drifting, jumping, vanishing targets",
    revision: 2,
    few_seeds: 2,
    all_seeds: 60,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    grid([
        ("target", &[0.0, 1.0, 2.0, 3.0]),
        ("background", &BACKGROUNDS),
        ("signal", &SIGNALS),
        ("tracking", &[0.0, 1.0]),
    ])
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let setting = Setting::of(point)?;
    let target = whole(point, "target");
    let start = 40.0 + Uniform::new(0.0, 1.0)?.sample(rng);
    let rates = |position: f64, signal: f64| {
        let rates = Rates {
            background: point["background"],
            signal,
            position,
            sigma: SIGMA,
        };
        vec![rates; ARRAY.pixels() as usize]
    };
    let signal = point["signal"];
    let settings = setting.settings(setting.z())?;
    let mut array = SimulatedArray::new(ARRAY, &rates(start, signal), &settings)?;
    let mut events: Vec<DepthEvent> = Vec::new();
    let mut tally = Tally::new();
    if target == DRIFTS {
        let mut position = start;
        while array.cycle() < BEFORE + AFTER {
            array.set(&rates(position, signal))?;
            array.run(100, rng, |event| events.push(*event))?;
            position += DRIFT;
        }
        // The position at the end of the exposure; the motion during it is ignored.
        let at = |event: &DepthEvent| start + DRIFT * event.cycle.raw() as f64 / 100.0;
        let settled = |event: &&DepthEvent| event.cycle.raw() >= u64::from(L2);
        for event in events.iter().filter(settled) {
            add_count(&mut tally, verdict(event, at(event)), 1);
        }
        tally.insert("cycles".to_owned(), (BEFORE + AFTER - u64::from(L2)) * 64);
        return Ok(tally);
    }
    array.run(BEFORE, rng, |event| events.push(*event))?;
    match target {
        JUMPS => array.set(&rates(start + JUMP, signal))?,
        VANISHES => array.set(&rates(start, 0.0))?,
        _ => {}
    }
    array.run(AFTER, rng, |event| events.push(*event))?;
    let mut first = vec![None; ARRAY.pixels() as usize];
    for event in &events {
        let pixel = usize::from(event.pixel.raw());
        if event.cycle.raw() < BEFORE {
            if event.cycle.raw() >= u64::from(L2) && target == STEADY {
                count(&mut tally, event, start);
            }
            continue;
        }
        match target {
            JUMPS if is_right(event, start + JUMP) => {
                first[pixel].get_or_insert(event.cycle.raw() - BEFORE + 1);
            }
            VANISHES => {
                // A ghost: counted by the thousand laser cycles since the target vanished.
                let later = (event.cycle.raw() - BEFORE) / u64::from(L2);
                let who = if is_right(event, start) {
                    "ghost"
                } else {
                    "elsewhere"
                };
                add(&mut tally, who, &later.to_string(), 1);
            }
            STEADY => count(&mut tally, event, start),
            _ => {}
        }
    }
    match target {
        JUMPS => {
            for cycles in first {
                add_value(&mut tally, "noticed", cycles.unwrap_or(AFTER).cast_signed());
            }
        }
        VANISHES => {
            tally.insert("pixels".to_owned(), u64::from(ARRAY.pixels()));
        }
        _ => {
            let cycles = (BEFORE + AFTER - u64::from(L2)) * u64::from(ARRAY.pixels());
            tally.insert("cycles".to_owned(), cycles);
        }
    }
    Ok(tally)
}

/// Counts a right or wrong event, and its error.
fn count(tally: &mut Tally, event: &DepthEvent, position: f64) {
    add_count(tally, verdict(event, position), 1);
    if is_right(event, position) {
        #[allow(clippy::cast_possible_truncation, reason = "a few bins in 1/256")]
        let error = (f64::from(event.position().raw()) - 256.0 * position).round() as i64;
        add_value(tally, "error", error);
    }
}

/// Laser cycles per right event, with the 99 % interval of a count.
fn cycles_an_event(point: &PointTally) -> Measured {
    let (cycles, right) = (point.count("cycles") as f64, point.count("right") as f64);
    let half = Z_99 * right.sqrt();
    Measured {
        value: cycles / right,
        interval: (cycles / (right + half), cycles / (right - half).max(1.0)),
    }
}

fn results(part: &Part) -> Result<Results> {
    let one = |target: u16, (signal, background): (f64, f64), tracking| {
        part.one([
            ("target", f64::from(target)),
            ("background", background),
            ("signal", signal),
            ("tracking", tracking),
        ])
    };
    // Ratio with tracking to without.
    let gain = |target, scene| {
        let [with, without] = [1.0, 0.0].map(|tracking| {
            let point = one(target, scene, tracking);
            let cycles = if target == JUMPS {
                Measured::mean(point, "noticed")
            } else {
                cycles_an_event(point)
            };
            cycles.value
        });
        with / without
    };
    let panels = [
        (STEADY, "steady"),
        (DRIFTS, "drifting"),
        (JUMPS, "jump of 30 bins"),
    ];
    let panels = panels.map(|(target, title)| {
        let mut series = vec![level(&SIGNALS, 1.0)];
        for (background, pen) in BACKGROUNDS.into_iter().zip([PAPER, EVENTS]) {
            let gain = |signal| gain(target, (signal, background));
            series.push(joined(pen, Dot::curve(SIGNALS, gain)));
        }
        panel(title, series)
    });
    let (steady, jump) = (gain(STEADY, HEADLINE), gain(JUMPS, HEADLINE));
    let chart = Chart {
        finding: format!(
            "A target that stays is reported in {steady:.2} times the laser cycles, one that jumps \
             is noticed in {jump:.2} times as many"
        ),
        holds: steady <= 0.7 && jump <= 1.1,
        note: format!(
            "With tracking over without, both with 1 % false alarms in {L2} laser cycles; the title \
             is of {} signal photons a cycle and a background of {} a bin.",
            HEADLINE.0, HEADLINE.1
        ),
        x: Axis::logarithmic("signal photons a laser cycle"),
        y: Axis::linear("cycles an event, or to notice a jump, over those without")
            .within(0.0, 1.4),
        key: vec![
            joined_key(PAPER, "background 0.01"),
            joined_key(EVENTS, "background 0.05"),
        ],
        columns: 3,
        panels: panels.into(),
    };
    let ghost = |tracking, later: u64| {
        let point = one(VANISHES, HEADLINE, tracking);
        let share = point.share(&format!("ghost {later}"), "pixels");
        format!("{:.2}", 100.0 * share.value)
    };
    Ok(Results {
        figures: vec![Figure::new("tracking", &chart)?],
        values: [
            ("steady", format!("{steady:.2}")),
            ("jump", format!("{jump:.2}")),
            ("drift", format!("{:.2}", gain(DRIFTS, HEADLINE))),
            ("few", format!("{:.2}", gain(STEADY, (0.145, 0.01)))),
            ("ghost with", ghost(1.0, 1)),
            ("ghost without", ghost(0.0, 1)),
            ("ghost later", ghost(1.0, 2)),
        ]
        .into(),
        tables: vec![("results/data/tracking.csv", csv(part)?)],
        ..Results::default()
    })
}

fn csv(part: &Part) -> Result<String> {
    let mut csv = "target,background,signal,tracking,right,wrong,cycles,cycles to notice,ghost 0,ghost 1,ghost 2,pixels\n".to_owned();
    for point in part.points() {
        let noticed = if point.parameter("target") == f64::from(JUMPS) {
            format!("{:.1}", Measured::mean(point, "noticed").value)
        } else {
            String::new()
        };
        let at = point.parameter_cells(["target", "background", "signal", "tracking"]);
        let reports = point.count_cells(["right", "wrong", "cycles"]);
        let ghosts = point.count_cells(["ghost 0", "ghost 1", "ghost 2", "pixels"]);
        writeln!(csv, "{at},{reports},{noticed},{ghosts}")?;
    }
    Ok(csv)
}
