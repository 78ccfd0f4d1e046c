//! The figure, the table and the claims.

use super::{REFERENCES, SCENES, THRESHOLDS, name};
use crate::sweep::mean::Measured;
use crate::sweep::results::{Claim, Figure, Results, Verdict};
use crate::sweep::{Part, PointTally};
use anyhow::Result;
use dtof::rows::grouped;
use dtof_draw::chart::{Axis, Chart, Key, Panel, Series, Style};
use dtof_draw::palette::{EVENTS, PAPER};
use std::fmt::Write as _;

/// The paper's threshold in millimetres.
const PAPER_MM: u32 = 100;
/// The paper's least share of events taken away.
const REMOVED: f64 = 0.7;
/// Changes an event below which a wall is silent.
const SILENT: f64 = 1e-4;

/// How a way of finding changes fares in a scene.
struct Outcome {
    /// Events that are not followed by a change.
    removed: Measured,
    /// The others.
    left: Measured,
    /// True steps that are reported.
    found: Measured,
    /// Changes that there were not.
    is_false: Measured,
    /// Laser cycles from a step to its report.
    delay: Measured,
    changes: u64,
    steps: u64,
    still_pixels: u64,
    still_events: u64,
    still_changes: u64,
}

fn outcome(point: &PointTally, threshold_mm: u32, reference: &str) -> Outcome {
    let name = name(threshold_mm, reference);
    let count = |what: &str| point.count(&format!("{name} {what}"));
    let delay = format!("{name} delay");
    let (events, changes) = (point.count("depth events"), count("changes"));
    Outcome {
        removed: Measured::share(events - changes, events),
        left: Measured::share(changes, events),
        found: Measured::share(point.count(&format!("{delay} values")), count("steps")),
        is_false: Measured::share(count("false"), changes),
        delay: Measured::mean(point, &delay),
        changes,
        steps: count("steps"),
        still_pixels: count("still pixels"),
        still_events: count("still events"),
        still_changes: count("still changes"),
    }
}

fn scenes(part: &Part) -> Result<Vec<(&'static str, &PointTally)>> {
    let numbers = (0u8..).zip(SCENES);
    numbers
        .map(|(number, name)| Ok((name, part.one([("scene", number.into())])?)))
        .collect()
}

pub fn results(part: &Part) -> Result<Results> {
    let scenes = scenes(part)?;
    let steps = scenes
        .iter()
        .map(|(_, point)| outcome(point, PAPER_MM, REFERENCES[0].1).steps);
    Ok(Results {
        figures: vec![figure(&scenes)?],
        claims: claims(&scenes),
        values: [("steps", grouped(steps.sum()))].into(),
        tables: vec![("results/data/dynamic-depth.csv", csv(&scenes)?)],
    })
}

/// The share of the steps that is found, of the two cars.
fn found_cars(scenes: &[(&str, &PointTally)], reference: usize) -> [Measured; 2] {
    [0, 1].map(|car| outcome(scenes[car].1, PAPER_MM, REFERENCES[reference].1).found)
}

fn figure(scenes: &[(&str, &PointTally)]) -> Result<Figure> {
    let pens = [PAPER, EVENTS];
    let panels = scenes.iter().map(|&(scene, point)| {
        let series = REFERENCES
            .into_iter()
            .zip(pens)
            .map(|((_, reference), pen)| {
                let points = THRESHOLDS.map(|threshold_mm| {
                    let outcome = outcome(point, threshold_mm, reference);
                    outcome.left.at(threshold_mm.into())
                });
                Series::unnamed(pen, Style::JoinedDots, points.to_vec())
            });
        Panel {
            title: scene.to_owned(),
            series: series.collect(),
        }
    });
    let key = |(reference, pen)| Key::new(pen, Style::JoinedDots, format!("against {reference}"));
    let references = ["the mean before (paper)", "the mean reported last"];
    let found = |reference| found_cars(scenes, reference);
    let chart = Chart {
        finding: "Against the mean before, dynamic depth misses a moving car".to_owned(),
        holds: found(0).iter().all(|share| share.interval.1 < 0.01)
            && found(1).iter().all(|share| share.interval.0 > 0.9),
        note: "Bars hold 99 %; an open dot is an upper limit where there was no change.".to_owned(),
        x: Axis::logarithmic("threshold, mm").within(40.0, 1250.0),
        y: Axis::logarithmic("changes reported, % of the events")
            .percent()
            .within(1e-7, 1.0),
        key: references.into_iter().zip(pens).map(key).collect(),
        columns: 2,
        panels: panels.collect(),
    };
    Figure::new("dynamic-depth", &chart)
}

fn csv(scenes: &[(&str, &PointTally)]) -> Result<String> {
    let mut csv = "scene,reference,threshold_mm,depth_events,changes,removed,steps,found,found_from,found_to,delay_cycles,\
                   false,false_from,false_to,still_pixels,still_events,still_changes\n"
        .to_owned();
    for &(scene, point) in scenes {
        for (_, reference) in REFERENCES {
            for threshold_mm in THRESHOLDS {
                let of = outcome(point, threshold_mm, reference);
                writeln!(
                    csv,
                    "\"{scene}\",{reference},{threshold_mm},{},{},{:.4},{},{},{:.0},{},{},{},{}",
                    point.count("depth events"),
                    of.changes,
                    of.removed.value,
                    of.steps,
                    of.found.cells(4),
                    of.delay.value,
                    of.is_false.cells(4),
                    of.still_pixels,
                    of.still_events,
                    of.still_changes,
                )?;
            }
        }
    }
    Ok(csv)
}

/// `text` of both references, scene by scene.
fn everywhere(
    scenes: &[(&str, &PointTally)],
    reference: &str,
    text: impl Fn(&Outcome) -> String,
) -> String {
    let scenes = scenes
        .iter()
        .map(|(scene, point)| format!("{scene} {}", text(&outcome(point, PAPER_MM, reference))));
    scenes.collect::<Vec<_>>().join(", ")
}

/// Agrees if `holds` of the paper's way in every scene, differs if in all but that of
/// the wide bins.
fn by_scene(scenes: &[(&str, &PointTally)], holds: impl Fn(&Outcome) -> bool) -> Verdict {
    let papers = scenes
        .iter()
        .map(|(_, point)| holds(&outcome(point, PAPER_MM, REFERENCES[0].1)));
    match papers.collect::<Vec<_>>()[..] {
        [true, true, true, true] => Verdict::Agrees,
        [true, true, true, false] => Verdict::Differs,
        _ => Verdict::Refuted,
    }
}

fn percent(share: Measured) -> String {
    if share.value.is_nan() {
        return "none".to_owned();
    }
    format!("{:.2} %", share.value * 100.0)
}

fn claims(scenes: &[(&str, &PointTally)]) -> Vec<Claim> {
    let both = |text: fn(&Outcome) -> String| {
        let texts = REFERENCES.map(|(_, reference)| {
            format!(
                "against the {reference}: {}",
                everywhere(scenes, reference, text)
            )
        });
        texts.join("; ")
    };
    let finds_cars = |reference: usize| {
        let found = found_cars(scenes, reference);
        found.iter().all(|share| share.interval.0 > 0.9)
    };
    vec![
        Claim::new(
            "removed",
            both(|of| percent(of.removed)),
            by_scene(scenes, |of| of.removed.interval.0 > REMOVED),
        ),
        Claim::new(
            "motion",
            both(|of| {
                let delay = if of.delay.value.is_nan() {
                    String::new()
                } else {
                    format!(" after {:.0} laser cycles", of.delay.value)
                };
                format!(
                    "{} of {} steps{delay}, {} of {} changes false",
                    percent(of.found),
                    grouped(of.steps),
                    percent(of.is_false),
                    grouped(of.changes)
                )
            }),
            Verdict::graded(finds_cars(0), finds_cars(1)),
        ),
        Claim::new(
            "wall",
            both(|of| {
                format!(
                    "{} changes of {} events of {} still pixels",
                    grouped(of.still_changes),
                    grouped(of.still_events),
                    grouped(of.still_pixels)
                )
            }),
            by_scene(scenes, |of| {
                Measured::share(of.still_changes, of.still_events)
                    .interval
                    .1
                    < SILENT
            }),
        ),
    ]
}
