//! The paper's claims on its static scene.

use super::super::systems::{Background, System};
use super::surfaces::surfaces;
use super::{DEPTHS, ESTIMATES, MILLION};
use crate::sweep::mean::Measured;
use crate::sweep::results::{Claim, Verdict, span};
use crate::sweep::{Part, PointTally};
use anyhow::Result;
use dtof_data::options::rows::grouped;

/// Surfaces of the file.
const BRIGHTEST: &str = "white board";
const WALL: &str = "wall";

/// Whether a point is the PC with the paper's background estimate, on which the verdicts are based.
fn is_papers(point: &PointTally) -> bool {
    point.is_at([("fpga", 0.0), ("average", 1.0)])
}

/// The texts of `text` for each scene.
fn of_each(part: &Part, mut text: impl FnMut(&PointTally) -> Result<String>) -> Result<String> {
    let mut texts = Vec::new();
    for point in part.points() {
        let system = System::of(&point.parameters);
        let background = Background::ALL[usize::from(point.is_at([("average", 0.0)]))];
        texts.push(format!(
            "{}, {}, B = {}: {}",
            system.with_pulse(point.parameter("sigma")),
            background.name(),
            point.parameter("background"),
            text(point)?
        ));
    }
    Ok(texts.join("; "))
}

/// The spans of values on the PC with the average, and in the other scenes.
fn spans(part: &Part, digits: usize, of: impl Fn(&PointTally) -> f64) -> String {
    let points = part.points().iter();
    let values: Vec<(bool, f64)> = points.map(|point| (is_papers(point), of(point))).collect();
    spans_of(digits, &values)
}

/// The same of values, each with whether it is of the PC with the average.
fn spans_of(digits: usize, values: &[(bool, f64)]) -> String {
    let [papers, others] = [true, false].map(|is_papers| {
        let those = values.iter().filter(|value| value.0 == is_papers);
        span(those.map(|value| value.1), digits)
    });
    format!("{papers} (PC, average), {others} (quadrants, FPGA)")
}

/// The claim on the noise of a depth relative to that of the frame, with a verdict on the ratios on surfaces
/// where at least half of the pixels have enough events.
fn noise(
    part: &Part,
    name: &'static str,
    depth: &str,
    verdict: fn(&[Measured]) -> Verdict,
) -> Result<Claim> {
    let (mut papers, mut all) = (Vec::new(), Vec::new());
    let details = of_each(part, |point| {
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
        all.extend(
            ratios
                .iter()
                .map(|(ratio, _)| (is_papers(point), ratio.value)),
        );
        if is_papers(point) {
            papers.extend(ratios.iter().map(|(ratio, _)| *ratio));
        }
        let few = match few.join(", ") {
            few if few.is_empty() => String::new(),
            few => format!("; fewer than half of the pixels have twenty events: {few}"),
        };
        Ok(format!(
            "noise {least} to {most} that of the frame; {beyond} beyond 1.5 bins, of frames {frames_beyond}{few}"
        ))
    })?;
    let here = format!("noise over that of the frame {}", spans_of(2, &all));
    Ok(Claim::new(name, here, verdict(&papers)).with_details(details))
}

/// Whether a depth is noisier than the frame on every surface.
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

/// Whether the noise of a depth is at most 1.5 times that of the frame on the worst surface.
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

/// Events of a surface per reading of a frame of 2000.
fn a_frame(point: &PointTally, surface: &str) -> Measured {
    let events = Measured::mean(point, &format!("{surface}, events"));
    let pixels = point.count(&format!("{surface}, events values")) as f64;
    events.times(pixels / point.count(&format!("{surface} frames")) as f64)
}

fn frame_rate(part: &Part, papers: &[&PointTally]) -> Result<Claim> {
    let rate = |point: &PointTally| a_frame(point, BRIGHTEST);
    Ok(Claim::new(
        "frame-rate",
        format!(
            "events of the brightest surface for each of its readings in frames of 2000: {}",
            spans(part, 1, |point| rate(point).value)
        ),
        Verdict::graded(
            papers.iter().all(|point| rate(point).interval.0 > 2.0),
            papers.iter().any(|point| rate(point).interval.0 > 1.0),
        ),
    )
    .with_details(of_each(part, |point| Ok(rate(point).text(1)))?))
}

fn redundant(part: &Part, papers: &[&PointTally]) -> Result<Claim> {
    let rate = |point: &PointTally| a_frame(point, WALL);
    // Shares of all events, and of all readings of frames.
    let shares = |point: &PointTally| -> Result<[Measured; 2]> {
        let [mut events, mut frames] = [0, 0];
        for (surface, _) in surfaces(point)? {
            events += point.count(&format!("{surface}, events above 0"));
            frames += point.count(&format!("{surface} frames"));
        }
        let of = |what: &str| point.count(&format!("{WALL}{what}"));
        Ok([
            Measured::share(of(", events above 0"), events),
            Measured::share(of(" frames"), frames),
        ])
    };
    let mut less = true;
    let mut of_events = Vec::new();
    for point in part.points() {
        let [events, frames] = shares(point)?;
        less &= !is_papers(point) || events.interval.1 < frames.interval.0;
        of_events.push((is_papers(point), events.value * 100.0));
    }
    Ok(Claim::new(
        "redundant",
        format!(
            "events of the wall for each of its readings in frames of 2000: {}; its share of all events, %: {}",
            spans(part, 2, |point| rate(point).value),
            spans_of(1, &of_events)
        ),
        Verdict::graded(
            papers.iter().all(|point| rate(point).interval.1 < 1.0),
            less,
        ),
    )
    .with_details(format!(
        "events of the wall for each of its readings in frames of 2000, and its share of all events and of all readings: {}",
        of_each(part, |point| {
            let [events, frames] = shares(point)?.map(|share| share.value * 100.0);
            Ok(format!(
                "{}, {events:.1} % and {frames:.1} %",
                rate(point).text(2)
            ))
        })?
    )))
}

pub fn claims(part: &Part) -> Result<Vec<Claim>> {
    let papers: Vec<&PointTally> = part
        .points()
        .iter()
        .filter(|point| is_papers(point))
        .collect();
    let sum = |name: &str| -> u64 { papers.iter().map(|point| point.count(name)).sum() };
    let [by_100, by_109, at_110] = [100, 109, 110].map(|by| sum(&format!("events by {by}")));
    let correlation =
        |point: &PointTally| Measured::mean(point, "rank correlation").times(1.0 / MILLION);
    let lowest = papers.iter().map(|point| correlation(point).interval.0);
    let lowest = lowest.fold(1.0, f64::min);
    let percent =
        |point: &PointTally, name: &str| Measured::mean(point, name).times(100.0 / MILLION);
    let errors = papers
        .iter()
        .map(|point| percent(point, ESTIMATES[0]).value);
    let worst = errors.fold(0.0, f64::max);
    let ranks = |point: &PointTally| {
        let name = format!("{}, ranks", ESTIMATES[0]);
        Measured::mean(point, &name).times(1.0 / MILLION)
    };
    let ordered = papers.iter().all(|point| ranks(point).interval.0 > 0.8);
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
                spans(part, 3, |point| correlation(point).value)
            ),
            Verdict::graded(lowest > 0.8, lowest > 0.5),
        )
        .with_details(of_each(part, |point| Ok(correlation(point).text(3)))?),
        noise(part, "last", DEPTHS[1], noisier)?,
        noise(part, "mean", DEPTHS[2], comparable)?,
        Claim::new(
            "reflectivity",
            format!(
                "rms error after one scale, %: {}; by counts and exposure {}",
                spans(part, 1, |point| percent(point, ESTIMATES[0]).value),
                spans(part, 1, |point| percent(point, ESTIMATES[1]).value)
            ),
            Verdict::graded(worst < 10.0, worst < 25.0 || ordered),
        )
        .with_details(format!(
                "rms error after one scale, of pixels with an event {}",
                of_each(part, |point| {
                    let mut without = 0;
                    let mut pixels = 0;
                    for (surface, _) in surfaces(point)? {
                        without += point.count(&format!("{surface} without an event"));
                        pixels += point.count(&format!("{surface}, events values"));
                    }
                    Ok(format!(
                        "{} % (by counts and exposure {} %), rank correlation {}, without an event {} of {} pixels",
                        percent(point, ESTIMATES[0]).text(1),
                        percent(point, ESTIMATES[1]).text(1),
                        ranks(point).text(3),
                        grouped(without),
                        grouped(pixels),
                    ))
                })?
            )),
        frame_rate(part, &papers)?,
        redundant(part, &papers)?,
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
