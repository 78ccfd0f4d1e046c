//! The figures of the static scene.

use super::super::one_pixel::PER_BIN;
use super::claims::claims;
use super::surfaces::surfaces;
use super::{DEPTHS, ESTIMATES, NOISES, PC_L1, PC_LIGHTS};
use crate::sweep::charts::{joined, joined_key, panel};
use crate::sweep::mean::Measured;
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, PointTally};
use anyhow::Result;
use dtof_data::options::rows::grouped;
use dtof_draw::chart::{Axis, Chart, Panel, Point as Dot};
use dtof_draw::palette::STEPS;
use std::f64::consts::SQRT_2;

/// A chart over the signal of every surface.
struct SurfaceChart<'a> {
    finding: &'a str,
    y: Axis,
    /// Suffixes of a surface's tally, and the titles of their panels.
    names: &'a [(&'a str, &'a str)],
    note: &'a str,
}

/// A panel for each name, with `measured` of the tally `"surface, name"`, on the PC with the
/// average at both backgrounds. The finding holds if `holds` is true for the dots of all panels at
/// each background.
fn by_signal(
    part: &Part,
    shown: SurfaceChart,
    measured: impl Fn(&PointTally, &str) -> Measured,
    holds: impl Fn(&[Vec<Dot>]) -> bool,
) -> Result<Chart> {
    let names = shown.names.iter();
    let mut panels: Vec<Panel> = names.map(|name| panel(name.1, [])).collect();
    let mut all_hold = true;
    let mut key = Vec::new();
    for ((background, _), pen) in PC_LIGHTS.into_iter().zip([STEPS[3], STEPS[0]]) {
        let point = part.one([("fpga", 0.0), ("average", 1.0), ("background", background)]);
        let mut all = Vec::new();
        for ((name, _), panel) in shown.names.iter().zip(&mut panels) {
            let dots = surfaces(point)?
                .into_iter()
                .map(|(surface, signal)| measured(point, &format!("{surface}, {name}")).at(signal));
            // Without an event there is nothing to draw.
            let mut dots: Vec<Dot> = dots.filter(|dot| dot.y.is_finite()).collect();
            dots.sort_by(|a, b| a.x.total_cmp(&b.x));
            panel.series.push(joined(pen, dots.clone()));
            all.push(dots);
        }
        all_hold &= holds(&all);
        key.push(joined_key(pen, format!("B = {background}")));
    }
    Ok(Chart {
        finding: shown.finding.to_owned(),
        holds: all_hold,
        note: format!(
            "A dot is a surface, before the PC. Bars hold 99 %. {}",
            shown.note
        ),
        x: Axis::logarithmic("signal photons a laser cycle"),
        y: shown.y,
        key,
        columns: 3,
        panels,
    })
}

/// Whether every dot lies below its counterpart at the same signal, if both are known within half
/// of their value.
fn is_below(dots: &[Dot], others: &[Dot]) -> bool {
    let is_known = |dot: &&Dot| {
        let (low, high) = dot.interval.unwrap_or((dot.y, dot.y));
        high - low < dot.y / 2.0
    };
    let pairs = dots.iter().filter(is_known).filter_map(|dot| {
        let same = |other: &&Dot| other.x.total_cmp(&dot.x).is_eq();
        Some((dot.y, others.iter().filter(is_known).find(same)?.y))
    });
    let pairs: Vec<(f64, f64)> = pairs.collect();
    !pairs.is_empty() && pairs.iter().all(|(dot, other)| dot < other)
}

pub fn results(part: &Part) -> Result<Results> {
    let events = by_signal(
        part,
        SurfaceChart {
            finding: "Brighter surfaces report more often, at most once in 110 laser cycles",
            y: Axis::linear("events of a pixel in 10,000 laser cycles, mean"),
            names: &[("events", "")],
            note: &format!("L1 = {PC_L1} and X = 10 allow no more than 90 events."),
        },
        Measured::mean,
        |all| {
            let ends = (all[0].first(), all[0].last());
            let most = all[0].iter().all(|dot| dot.y <= 90.0);
            most && matches!(ends, (Some(first), Some(last)) if 3.0 * first.y < last.y)
        },
    )?;
    let names = |names: [&'static str; 3]| [0, 1, 2].map(|at| (names[at], DEPTHS[at]));
    let depth = by_signal(
        part,
        SurfaceChart {
            finding: "The mean of ten events errs less than the last event",
            y: Axis::logarithmic("root mean square error, bins"),
            names: &names(DEPTHS),
            note: "Of pixels with ten events or more; errors beyond 1.5 bins are left out.",
        },
        |point, name| Measured::root_mean_square(point, name).times(1.0 / PER_BIN as f64),
        |all| is_below(&all[2], &all[1]),
    )?;
    let noise = by_signal(
        part,
        SurfaceChart {
            finding: "The last event is noisier than a frame, and than the mean of ten",
            y: Axis::logarithmic("standard deviation, bins"),
            names: &names(NOISES),
            note: "From the difference of two depths of the same pixel, with twenty events or more.",
        },
        |point, name| {
            let difference = Measured::root_mean_square(point, name);
            difference.times(1.0 / SQRT_2 / PER_BIN as f64)
        },
        |all| is_below(&all[0], &all[1]) && is_below(&all[2], &all[1]),
    )?;
    let by_events = (ESTIMATES[0], "by the number of events, as in the paper");
    let reflectivity = by_signal(
        part,
        SurfaceChart {
            finding: "Photons an exposure tell the reflectivity better than the number of events",
            y: Axis::linear("estimate over truth, after one scale for the scene"),
            names: &[by_events, (ESTIMATES[1], "by photons and exposure")],
            note: "1 would be right. Of pixels with an event.",
        },
        |point, name| Measured::mean(point, name).times(1e-3),
        |all| {
            let off = |dots: &[Dot]| dots.iter().map(|dot| (dot.y - 1.0).powi(2)).sum::<f64>();
            off(&all[1]) < off(&all[0])
        },
    )?;
    Ok(Results {
        figures: vec![
            Figure::new("static-events", &events)?,
            Figure::new("static-depth", &depth)?,
            Figure::new("static-noise", &noise)?,
            Figure::new("static-reflectivity", &reflectivity)?,
        ],
        claims: claims(part)?,
        values: [("pixels", grouped(64 * 32 * part.seed_count()))].into(),
        ..Results::default()
    })
}
