//! The figures and the table.

use super::super::systems::{Background, System};
use super::claims::claims;
use super::outcome::{ChangeOutcome, REMOVED, SCENES, at_text, holding, on_pc, outcome};
use super::{REFERENCES, SIGNALS};
use crate::sweep::charts::{joined, joined_key, panel};
use crate::sweep::mean::Measured;
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, whole};
use anyhow::Result;
use dtof_data::options::rows::grouped;
use dtof_draw::chart::{Axis, Chart, Key, Panel, Point as Dot, Series, Style};
use dtof_draw::palette::{EVENTS, NEUTRAL, PAPER, STEPS, frames};
use std::fmt::Write as _;

pub fn results(part: &Part) -> Result<Results> {
    let steps = part.points().iter().map(|point| {
        let papers = outcome(point, Background::Average, REFERENCES[0].1);
        papers.steps
    });
    Ok(Results {
        figures: vec![left(part)?, a_frame(part)?],
        claims: claims(part),
        values: [("steps", grouped(steps.sum()))].into(),
        tables: vec![("results/data/dynamic-depth.csv", csv(part)?)],
    })
}

fn left(part: &Part) -> Result<Figure> {
    let pens = [PAPER, EVENTS];
    let mut panels = Vec::new();
    for background in Background::ALL {
        for (fan, scene) in SCENES {
            let series = [0, 1].map(|reference| {
                let points = on_pc(part, fan, background, reference).into_iter();
                let dots = points.map(|(signal, outcome)| outcome.left.at(signal));
                joined(pens[reference], dots)
            });
            let ends = [SIGNALS[0], SIGNALS[SIGNALS.len() - 1]];
            let limit = Dot::curve(ends, |_| 1.0 - REMOVED);
            let limit = Series::unnamed(NEUTRAL, Style::Dashed, limit);
            let title = format!("{scene}, {}", background.name());
            panels.push(panel(title, series.into_iter().chain([limit])));
        }
    }
    let from = holding(part, Background::Average, |of| {
        of.removed.interval.0 > REMOVED
    });
    let chart = Chart {
        finding: format!(
            "With the average, dynamic depth takes away over 70 % {}",
            at_text(&from)
        ),
        holds: !from.is_empty(),
        note: "Bars hold 99 %.".to_owned(),
        x: Axis::logarithmic("signal photons a laser cycle"),
        y: Axis::logarithmic("changes reported, % of the events").percent(),
        key: vec![
            joined_key(PAPER, "against the mean before (paper)"),
            joined_key(EVENTS, "against the mean reported last"),
            Key::new(NEUTRAL, Style::Dashed, "the paper's 30 % that are left"),
        ],
        columns: 2,
        panels,
    };
    Figure::new("dynamic-depth", &chart)
}

/// The reports of a pixel compared with the frames of a sensor that sees the same photons.
fn a_frame(part: &Part) -> Result<Figure> {
    let cars = on_pc(part, 0.0, Background::Average, 0);
    let dots = |of: fn(&ChangeOutcome) -> Measured| -> Vec<Dot> {
        let dots = cars.iter().map(|(signal, outcome)| of(outcome).at(*signal));
        dots.collect()
    };
    let events = dots(|of| of.still.a_frame(of.still.events));
    let changes = dots(|of| of.still.a_frame(of.still.changes));
    let one = Dot::curve(SIGNALS, |_| 1.0);
    let most = |dots: &[Dot]| dots.iter().map(|dot| dot.y).fold(0.0, f64::max);
    let chart = Chart {
        finding: format!(
            "A still wall gives up to {:.0} events a frame, with dynamic depth {:.1} at most",
            most(&events),
            most(&changes)
        ),
        holds: most(&events) > 10.0 * most(&changes),
        note: "PC, average of all bins. Bars hold 99 %.".to_owned(),
        x: Axis::logarithmic("signal photons a laser cycle"),
        y: Axis::logarithmic("readings of the wall for each of frames of 2000"),
        key: Vec::new(),
        columns: 1,
        panels: vec![Panel::only(vec![
            Series::named("events", EVENTS, Style::JoinedDots, events),
            Series::named("dynamic depth", STEPS[1], Style::JoinedDots, changes),
            Series::named("frames of 2000", frames(2000), Style::Dashed, one),
        ])],
    };
    Figure::new("dynamic-depth-frames", &chart)
}

fn csv(part: &Part) -> Result<String> {
    let mut csv = "system,scene,background,reference,signal,events,changes,removed,steps,found,found_from,found_to,\
                   delay_cycles,false,false_from,false_to,still_pixels,still_frames,still_events,still_changes\n"
        .to_owned();
    for point in part.points() {
        let system = System::of(&point.parameters).name;
        let (_, scene) = SCENES[usize::from(whole(&point.parameters, "fan"))];
        for background in Background::ALL {
            for (_, reference) in REFERENCES {
                let of = outcome(point, background, reference);
                writeln!(
                    csv,
                    "{system},{scene},{},{reference},{},{},{},{:.4},{},{},{:.0},{},{},{},{},{}",
                    background.name(),
                    point.parameter("signal"),
                    of.events,
                    of.changes,
                    of.removed.value,
                    of.steps,
                    of.found.cells(4),
                    of.delay.value,
                    of.is_false.cells(4),
                    of.still.pixels,
                    of.still.frames,
                    of.still.events,
                    of.still.changes,
                )?;
            }
        }
    }
    Ok(csv)
}
