//! The figure, the table and the claims.

use super::{CAR_M_PER_S, CYCLES, LASER_RATE_MHZ, REFERENCES, SCENES, THRESHOLDS, name};
use crate::sweep::mean::Measured;
use crate::sweep::results::{Claim, Figure, Results, Share, Table, Verdict};
use crate::sweep::{Part, PointTally};
use anyhow::Result;
use dtof::rows::grouped;
use dtof_draw::chart::{Axis, Chart, Finding, Key, Panel, Series, Style};
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
    removed: Share,
    /// The others.
    left: Share,
    /// True steps that are reported.
    found: Share,
    /// Changes that there were not.
    is_false: Share,
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
        removed: Share::new(events - changes, events),
        left: Share::new(changes, events),
        found: Share::new(point.count(&format!("{delay} values")), count("steps")),
        is_false: Share::new(count("false"), changes),
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
    Ok(Results {
        figures: vec![figure(&scenes)?],
        claims: claims(&scenes),
        tables: vec![table(&scenes)?],
    })
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
    let key = |(reference, pen)| Key {
        pen,
        style: Style::JoinedDots,
        text: format!("against {reference}"),
    };
    let references = ["the mean before (paper)", "the mean reported last"];
    // Of the two cars.
    let found = |reference: usize| {
        let found = scenes
            .iter()
            .take(2)
            .map(|(_, point)| outcome(point, PAPER_MM, REFERENCES[reference].1).found);
        found.collect::<Vec<_>>()
    };
    let chart = Chart {
        finding: Finding::new(
            "Against the mean before, dynamic depth misses a moving car",
            found(0).iter().all(|share| share.interval.1 < 0.01)
                && found(1).iter().all(|share| share.interval.0 > 0.9),
        ),
        note: "Bars hold 99 %; an open dot is an upper limit where there was no change.".to_owned(),
        x: Axis::logarithmic("threshold, mm").within(40.0, 1250.0),
        y: Axis::logarithmic("changes reported, % of the events")
            .percent()
            .within(1e-7, 1.0),
        key: references.into_iter().zip(pens).map(key).collect(),
        columns: 2,
        panels: panels.collect(),
    };
    let steps: u64 = scenes
        .iter()
        .map(|(_, point)| outcome(point, PAPER_MM, REFERENCES[0].1).steps)
        .sum();
    let caption = format!(
        "A car at {CAR_M_PER_S} m/s and a fan at 120 rpm before a wall, {LASER_RATE_MHZ} MHz, {} to {} laser cycles a run; \
         mean of three events, α = 8, L1 = 40, X = 4, L2 = 2000; {} steps at {PAPER_MM} mm ([numbers](data/dynamic-depth.csv)).",
        grouped(CYCLES[0]),
        grouped(CYCLES[2]),
        grouped(steps),
    );
    Figure::new("dynamic-depth", &chart, caption)
}

fn table(scenes: &[(&str, &PointTally)]) -> Result<Table> {
    let mut csv = "scene,reference,threshold_mm,depth_events,changes,removed,steps,found,found_from,found_to,delay_cycles,\
                   false,false_from,false_to,still_pixels,still_events,still_changes\n"
        .to_owned();
    for &(scene, point) in scenes {
        for (_, reference) in REFERENCES {
            for threshold_mm in THRESHOLDS {
                let of = outcome(point, threshold_mm, reference);
                writeln!(
                    csv,
                    "\"{scene}\",{reference},{threshold_mm},{},{},{:.4},{},{:.4},{:.4},{:.4},{:.0},{:.4},{:.4},{:.4},{},{},{}",
                    point.count("depth events"),
                    of.changes,
                    of.removed.value,
                    of.steps,
                    of.found.value,
                    of.found.interval.0,
                    of.found.interval.1,
                    of.delay.value,
                    of.is_false.value,
                    of.is_false.interval.0,
                    of.is_false.interval.1,
                    of.still_pixels,
                    of.still_events,
                    of.still_changes,
                )?;
            }
        }
    }
    Ok(Table {
        path: "results/data/dynamic-depth.csv",
        csv,
    })
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

fn percent(share: Share) -> String {
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
    let paper = |number: usize| outcome(scenes[number].1, PAPER_MM, REFERENCES[0].1);
    let reported = |number: usize| outcome(scenes[number].1, PAPER_MM, REFERENCES[1].1);
    vec![
        Claim {
            claim: "dynamic depth takes away over 70 % of the events (section III-E)",
            paper: "> 70 %",
            here: both(|of| percent(of.removed)),
            verdict: by_scene(scenes, |of| of.removed.interval.0 > REMOVED),
            why: "agrees if so in every scene with 99 % confidence, differs if not in bins of 8.75 ns, where an event is noisier than the threshold; how much depends on how little moves",
        },
        Claim {
            claim: "dynamic depth follows the radial motion (section III-E)",
            paper: "closely track the programmed motion",
            here: both(|of| {
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
            verdict: if [0, 1].map(|scene| paper(scene).found.interval.0 > 0.9) == [true; 2] {
                Verdict::Agrees
            } else if [0, 1].map(|scene| reported(scene).found.interval.0 > 0.9) == [true; 2] {
                Verdict::Differs
            } else {
                Verdict::Refuted
            },
            why: "between two events of 44 laser cycles a car goes less than a millimetre, so that adjacent means never differ by 0.1 m but through noise or an edge; compared with the mean that was reported last they do, and each tenth of a metre is reported: differs if so with 99 % confidence; a step is found from half of what it takes before on, and a change is false unless the truth has moved to that side by half the threshold; a delay below 0 is a mean that is ahead by its noise and by what the centre of mass errs",
        },
        Claim {
            claim: "a wall makes no dynamic depth (section III-E)",
            paper: "no events",
            here: both(|of| {
                format!(
                    "{} changes of {} events of {} still pixels",
                    grouped(of.still_changes),
                    grouped(of.still_events),
                    grouped(of.still_pixels)
                )
            }),
            verdict: by_scene(scenes, |of| {
                Share::new(of.still_changes, of.still_events).interval.1 < SILENT
            }),
            why: "agrees if for sure fewer than one event in 10,000 is a change in every scene, differs if not in bins of 8.75 ns, where an event is noisier than the threshold; the others are false events",
        },
    ]
}
