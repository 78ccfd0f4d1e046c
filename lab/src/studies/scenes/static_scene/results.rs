//! What the static scene comes to.

use super::super::one_pixel::PER_BIN;
use super::{DEPTHS, ESTIMATES, MILLION, NOISES, WIDE, scene};
use crate::sweep::mean::Measured;
use crate::sweep::results::{Claim, Figure, Results, Verdict};
use crate::sweep::{Part, PointTally};
use anyhow::Result;
use dtof::rows::grouped;
use dtof_core::PixelAddress;
use dtof_draw::chart::{Axis, Chart, Panel, Point as Dot, Series, Style};
use dtof_draw::palette::{EVENTS, PAPER, Pen, STEPS, frames};
use std::f64::consts::SQRT_2;

/// Every surface of a point with its mean signal photons a laser cycle.
fn surfaces(point: &PointTally) -> Result<Vec<(String, f64)>> {
    let scene = scene(&point.parameters, 0.0)?;
    let mut sums = vec![(0.0, 0.0); scene.surfaces.len()];
    for address in (0..32 * 16).map(PixelAddress) {
        if let Some(view) = scene.truth(address, 0) {
            let (sum, count) = &mut sums[view.surface];
            *sum += scene.rates(address, 0).signal;
            *count += 1.0;
        }
    }
    let names = scene.surfaces.into_iter().map(|surface| surface.name);
    Ok(names
        .zip(sums)
        .map(|(name, (sum, count))| (name, sum / count))
        .collect())
}

/// What a chart over the signal of every surface shows.
struct Shown<'a> {
    finding: &'a str,
    y: Axis,
    /// How the tally of a surface ends, what that is called, and its pen.
    names: &'a [(&'a str, &'a str, Pen)],
    note: &'a str,
}

/// A panel for each of the names, measured by `measured` for the tally
/// `"surface, name"`. The finding holds if `holds` of the dots of all panels.
fn by_signal(
    part: &Part,
    shown: Shown,
    measured: impl Fn(&PointTally, &str) -> Measured,
    holds: impl Fn(&[Vec<Dot>]) -> bool,
) -> Result<Chart> {
    let mut all = Vec::new();
    for (name, ..) in shown.names {
        let mut dots = Vec::new();
        for point in part.at([("pulse_sigma_bins", WIDE)]) {
            for (surface, signal) in surfaces(point)? {
                let measured = measured(point, &format!("{surface}, {name}"));
                dots.push(measured.at(signal));
            }
        }
        // Without an event there is nothing to draw.
        dots.retain(|dot| dot.y.is_finite());
        dots.sort_by(|a, b| a.x.total_cmp(&b.x));
        all.push(dots);
    }
    let panels = shown.names.iter().zip(&all);
    let panels = panels.map(|(&(_, title, pen), dots)| Panel {
        title: title.to_owned(),
        series: vec![Series::unnamed(pen, Style::Dots, dots.clone())],
    });
    Ok(Chart {
        finding: shown.finding.to_owned(),
        holds: holds(&all),
        note: format!("A dot is a surface. Bars hold 99 %. {}", shown.note),
        x: Axis::logarithmic("signal photons a laser cycle, mean of a surface"),
        y: shown.y,
        key: Vec::new(),
        columns: 3,
        panels: panels.collect(),
    })
}

/// Whether every dot lies below that of the other at the same signal, where both are
/// known to half of their value.
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
        Shown {
            finding: "Brighter surfaces report more often, at most once in 110 laser cycles",
            y: Axis::linear("events of a pixel in 10,000 laser cycles, mean"),
            names: &[("events", "", EVENTS)],
            note: "L1 = 100 and X = 10 allow no more than 90 events.",
        },
        Measured::mean,
        |all| {
            let ends = (all[0].first(), all[0].last());
            let most = all[0].iter().all(|dot| dot.y <= 90.0);
            most && matches!(ends, (Some(first), Some(last)) if 10.0 * first.y < last.y)
        },
    )?;
    let pens = [frames(2000), EVENTS, STEPS[1]];
    let names = |names: [&'static str; 3]| [0, 1, 2].map(|at| (names[at], DEPTHS[at], pens[at]));
    let depth = by_signal(
        part,
        Shown {
            finding: "The mean of ten events errs less than the last event",
            y: Axis::logarithmic("root mean square error, bins"),
            names: &names(DEPTHS),
            note: "Of pixels with ten events or more; errors beyond three bins are left out.",
        },
        |point, name| Measured::root_mean_square(point, name).times(1.0 / PER_BIN as f64),
        |all| is_below(&all[2], &all[1]),
    )?;
    let noise = by_signal(
        part,
        Shown {
            finding: "The last event is noisier than a frame, the mean of ten less noisy",
            y: Axis::logarithmic("standard deviation, bins"),
            names: &names(NOISES),
            note: "From the difference of two depths of the same pixel, with twenty events or more.",
        },
        |point, name| {
            let difference = Measured::root_mean_square(point, name);
            difference.times(1.0 / SQRT_2 / PER_BIN as f64)
        },
        |all| is_below(&all[0], &all[1]) && is_below(&all[2], &all[0]),
    )?;
    let by_events = (
        ESTIMATES[0],
        "by the number of events, as in the paper",
        PAPER,
    );
    let reflectivity = by_signal(
        part,
        Shown {
            finding: "Photons an exposure tell the reflectivity better than the number of events",
            y: Axis::linear("estimate over truth, after one scale for the scene"),
            names: &[by_events, (ESTIMATES[1], "by photons and exposure", EVENTS)],
            note: "1 would be right. A pixel without an event counts as 0.",
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
        values: [("pixels", grouped(512 * part.seed_count()))].into(),
        ..Results::default()
    })
}

/// For each scene what `text` makes of it.
fn of_each(part: &Part, text: impl FnMut(&PointTally) -> Result<String>) -> Result<String> {
    let texts: Result<Vec<String>> = part.points().iter().map(text).collect();
    let names = [
        "static scene",
        "demo scene",
        "static scene with a pulse of σ = 0.5 bin",
    ];
    let texts = names
        .iter()
        .zip(texts?)
        .map(|(name, text)| format!("{name} {text}"));
    Ok(texts.collect::<Vec<_>>().join("; "))
}

/// What is said of the noise of a depth against that of the frame, and their ratio
/// on every surface of which half of the pixels or more say it.
fn noises(part: &Part, depth: &str) -> Result<(String, Vec<Measured>)> {
    let mut all = Vec::new();
    let text = of_each(part, |point| {
        let mut ratios: Vec<(Measured, String)> = Vec::new();
        let mut few = Vec::new();
        let [mut beyond, mut frames_beyond] = [0; 2];
        for (surface, _) in surfaces(point)? {
            let name = |depth: &str| format!("{surface}, noise of {depth}");
            beyond += point.count(&format!("{} false", name(depth)));
            frames_beyond += point.count(&format!("{} false", name(DEPTHS[0])));
            let pixels = point.count(&format!("{surface}, events values"));
            if 2 * point.count(&format!("{} values", name(depth))) < pixels {
                few.push(surface);
                continue;
            }
            let noise = |depth: &str| Measured::root_mean_square(point, &name(depth));
            ratios.push((noise(depth).over(noise(DEPTHS[0])), surface));
        }
        ratios.sort_by(|(a, _), (b, _)| a.value.total_cmp(&b.value));
        let [least, most] = [ratios.first(), ratios.last()].map(|ratio| {
            let text = |(ratio, surface): &(Measured, String)| {
                format!("{} times ({surface})", ratio.text(2))
            };
            ratio.map_or("-".to_owned(), text)
        });
        all.extend(ratios.iter().map(|(ratio, _)| *ratio));
        let few = match few.join(", ") {
            few if few.is_empty() => String::new(),
            few => format!("; fewer than half of the pixels have twenty events: {few}"),
        };
        Ok(format!(
            "noise {least} to {most} that of the frame; {beyond} beyond three bins, of frames {frames_beyond}{few}"
        ))
    })?;
    Ok((text, all))
}

/// Whether a depth is noisier than the frame, by the ratios of the surfaces.
fn noisier(ratios: &[Measured]) -> Verdict {
    let all = |holds: fn(&Measured) -> bool| !ratios.is_empty() && ratios.iter().all(holds);
    if all(|ratio| ratio.interval.0 > 1.0) {
        Verdict::Agrees
    } else if all(|ratio| ratio.interval.1 < 1.0) {
        Verdict::Refuted
    } else if ratios.iter().any(|ratio| ratio.interval.1 < 1.0) {
        Verdict::Differs
    } else {
        Verdict::NotDecided
    }
}

/// Whether a depth is as noisy as the frame, within half as much again, by the
/// worst surface.
fn comparable(ratios: &[Measured]) -> Verdict {
    let any = |least: f64| ratios.iter().any(|ratio| ratio.interval.0 > least);
    if any(2.0) {
        Verdict::Refuted
    } else if any(1.5) {
        Verdict::Differs
    } else if !ratios.is_empty() && ratios.iter().all(|ratio| ratio.interval.1 <= 1.5) {
        Verdict::Agrees
    } else {
        Verdict::NotDecided
    }
}

fn claims(part: &Part) -> Result<Vec<Claim>> {
    let sum = |name: &str| -> u64 { part.points().iter().map(|point| point.count(name)).sum() };
    let [by_100, by_109, at_110] = [100, 109, 110].map(|by| sum(&format!("events by {by}")));
    let correlation =
        |point: &PointTally| Measured::mean(point, "rank correlation").times(1.0 / MILLION);
    let lowest = part
        .points()
        .iter()
        .map(|point| correlation(point).interval.0);
    let lowest = lowest.fold(1.0, f64::min);
    let (last, last_ratios) = noises(part, DEPTHS[1])?;
    let (mean, mean_ratios) = noises(part, DEPTHS[2])?;
    let percent =
        |point: &PointTally, name: &str| Measured::mean(point, name).times(100.0 / MILLION);
    let errors = part
        .points()
        .iter()
        .map(|point| percent(point, ESTIMATES[0]).value);
    let worst = errors.fold(0.0, f64::max);
    Ok(vec![
        Claim::new(
            "first",
            format!(
                "{by_100} of {} events by 100, {by_109} by 109, {} at 110",
                grouped(sum("events of all pixels")),
                grouped(at_110)
            ),
            Verdict::of(by_100 == 0 && by_109 == 0 && at_110 > 0),
        ),
        Claim::new(
            "bright",
            format!(
                "rank correlation of events with the signal {}",
                of_each(part, |point| Ok(correlation(point).text(3)))?
            ),
            Verdict::graded(lowest > 0.8, lowest > 0.5),
        ),
        Claim::new("last", last, noisier(&last_ratios)),
        Claim::new("mean", mean, comparable(&mean_ratios)),
        Claim::new(
            "reflectivity",
            format!(
                "rms error after one scale {}",
                of_each(part, |point| {
                    let percent = |name: &str| percent(point, name).text(1);
                    let without = surfaces(point)?
                        .into_iter()
                        .map(|(surface, _)| point.count(&format!("{surface} without an event")));
                    let seen = |name| percent(&format!("{name}, with an event"));
                    Ok(format!(
                        "{} % (by counts and exposure {} %) with the {} of {} pixels without an event as 0, {} % ({} %) without them",
                        percent(ESTIMATES[0]),
                        percent(ESTIMATES[1]),
                        grouped(without.sum()),
                        grouped(512 * part.seed_count()),
                        seen(ESTIMATES[0]),
                        seen(ESTIMATES[1]),
                    ))
                })?
            ),
            Verdict::graded(worst < 10.0, worst < 25.0),
        ),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ratios<const N: usize>(ratios: [(f64, f64); N]) -> Vec<Measured> {
        let measured = |interval: (f64, f64)| Measured {
            value: f64::midpoint(interval.0, interval.1),
            interval,
        };
        ratios.map(measured).to_vec()
    }

    #[test]
    fn the_worst_surface_decides() {
        let of = |worst| comparable(&ratios([(0.8, 0.9), worst]));
        assert_eq!(of((1.3, 1.5)), Verdict::Agrees);
        assert_eq!(of((1.4, 1.6)), Verdict::NotDecided);
        assert_eq!(of((1.6, 2.5)), Verdict::Differs);
        assert_eq!(of((2.1, 2.5)), Verdict::Refuted);
        assert_eq!(comparable(&[]), Verdict::NotDecided);
    }

    #[test]
    fn noisier_on_every_surface() {
        let of = |worst| noisier(&ratios([(1.2, 1.4), worst]));
        assert_eq!(of((1.1, 1.5)), Verdict::Agrees);
        assert_eq!(of((0.9, 1.1)), Verdict::NotDecided);
        assert_eq!(of((0.8, 0.9)), Verdict::Differs);
        assert_eq!(noisier(&ratios([(0.8, 0.9)])), Verdict::Refuted);
        assert_eq!(noisier(&[]), Verdict::NotDecided);
    }
}
