//! The paper's claims on dynamic depth.

use super::super::systems::Background;
use super::outcome::{ChangeOutcome, REMOVED, SCENES, at_text, by_range, holding, on_pc, outcome};
use super::{FPGA_SIGNAL, REFERENCES, SIGNALS};
use crate::sweep::Part;
use crate::sweep::mean::Measured;
use crate::sweep::results::{Claim, Verdict, span};
use dtof_data::options::rows::grouped;

/// Changes per event below which a wall counts as silent.
const SILENT: f64 = 1e-4;

/// The spans of a number of the car and of the fan over all signals, with both backgrounds.
fn spans(part: &Part, digits: usize, of: impl Fn(&ChangeOutcome) -> f64) -> String {
    let texts = Background::ALL.map(|background| {
        let scenes = SCENES.map(|(fan, scene)| {
            let outcomes = on_pc(part, fan, background, 0);
            let numbers = outcomes.iter().map(|(_, outcome)| of(outcome));
            format!("{scene} {}", span(numbers, digits))
        });
        format!("{}, {}", background.name(), scenes.join(", "))
    });
    texts.join("; ")
}

/// `text` of the car and of the fan at every signal.
fn at_signals(
    part: &Part,
    background: Background,
    text: impl Fn(&ChangeOutcome) -> String,
) -> String {
    let scenes = SCENES.map(|(fan, scene)| {
        let outcomes = on_pc(part, fan, background, 0);
        let texts: Vec<String> = outcomes.iter().map(|(_, outcome)| text(outcome)).collect();
        format!("{scene} {}", texts.join(", "))
    });
    scenes.join("; ")
}

/// The same with both backgrounds.
fn with_both(part: &Part, text: impl Fn(&ChangeOutcome) -> String) -> String {
    let backgrounds = Background::ALL.map(|background| {
        format!(
            "{}: {}",
            background.name(),
            at_signals(part, background, &text)
        )
    });
    format!(
        "at {} signal photons a laser cycle; {}",
        signals(),
        backgrounds.join("; ")
    )
}

fn signals() -> String {
    SIGNALS.map(|signal| signal.to_string()).join(", ")
}

fn percent(share: Measured) -> String {
    if share.value.is_nan() {
        return "none".to_owned();
    }
    format!("{:.1} %", share.value * 100.0)
}

fn times(measured: Measured) -> String {
    match measured.value {
        value if value < 0.01 => format!("{value:.5}"),
        value => format!("{value:.2}"),
    }
}

/// The steps of the car that are found.
fn motion(of: &ChangeOutcome) -> String {
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
}

pub fn claims(part: &Part) -> Vec<Claim> {
    let from = |holds: fn(&ChangeOutcome) -> bool| {
        Background::ALL.map(|background| holding(part, background, holds))
    };
    let removed = from(|of| of.removed.interval.0 > REMOVED);
    let is_silent = |of: &ChangeOutcome| {
        let share = Measured::share(of.still.changes, of.still.events);
        share.interval.1 < SILENT
    };
    let silent = from(is_silent);
    let changes =
        |of: &ChangeOutcome| Measured::share(of.still.changes, of.still.events).value * 1000.0;
    let fpga = part.one([("fpga", 1.0)]);
    let fpga = [0, 1].map(|way| outcome(fpga, Background::Quadrants, REFERENCES[way].1));
    let cars = [0, 1].map(|way| on_pc(part, 0.0, Background::Average, way));
    let finds = |of: &ChangeOutcome| of.found.interval.0 > 0.9 && of.is_false.value < 0.5;
    let [before, reported] = [0, 1].map(|way| {
        let mut outcomes = cars[way].iter().map(|car| &car.1).chain([&fpga[way]]);
        outcomes.any(finds)
    });
    let brightest = |way: usize| &cars[way][SIGNALS.len() - 1].1;
    let on_the_car = cars[0]
        .iter()
        .map(|(_, of)| percent(Measured::share(of.moving.changes, of.changes)));
    let fewer = |of: &ChangeOutcome| of.still.a_frame(of.still.changes).interval.1 < 1.0;
    let redundant = from(fewer);
    let fewer_events = from(|of| of.still.a_frame(of.still.events).interval.1 < 1.0);
    let more = from(|of| of.moving.a_frame(of.moving.events).interval.0 > 2.0);
    vec![
        Claim::new(
            "removed",
            format!(
                "over 70 % {} (quadrants: {}); in %: {}; FPGA: {}",
                at_text(&removed[0]),
                at_text(&removed[1]),
                spans(part, 1, |of| of.removed.value * 100.0),
                percent(fpga[0].removed)
            ),
            by_range(&removed[0]),
        )
        .with_details(format!(
            "{}; FPGA, car at {FPGA_SIGNAL}: {}",
            with_both(part, |of| percent(of.removed)),
            percent(fpga[0].removed)
        )),
        Claim::new(
            "motion",
            format!(
                "steps found against the mean before {}, reported last {} (car, {} photons); on the FPGA {}, {}",
                percent(brightest(0).found),
                percent(brightest(1).found),
                SIGNALS[SIGNALS.len() - 1],
                percent(fpga[0].found),
                percent(fpga[1].found)
            ),
            Verdict::graded(before, reported),
        )
        .with_details(format!(
                "car, average, at {} photons: against the mean before {}; against the mean reported last {}; \
                 changes that are of the car and not of the wall, at {}: {}; \
                 FPGA at {FPGA_SIGNAL}: against the mean before {}; against the mean reported last {}",
                SIGNALS[SIGNALS.len() - 1],
                motion(brightest(0)),
                motion(brightest(1)),
                signals(),
                on_the_car.collect::<Vec<_>>().join(", "),
                motion(&fpga[0]),
                motion(&fpga[1])
            )),
        Claim::new(
            "wall",
            format!(
                "silent {} (quadrants: {}); changes in a thousand events of still pixels: {}; FPGA: {} of {} events",
                at_text(&silent[0]),
                at_text(&silent[1]),
                spans(part, 2, changes),
                grouped(fpga[0].still.changes),
                grouped(fpga[0].still.events)
            ),
            by_range(&silent[0]),
        )
        .with_details(format!(
            "changes of still pixels in a thousand of their events {}; FPGA, car at {FPGA_SIGNAL}: {} of {} events",
            with_both(part, |of| format!("{:.2}", changes(of))),
            grouped(fpga[0].still.changes),
            grouped(fpga[0].still.events)
        )),
        Claim::new(
            "frame-rate",
            format!(
                "more than twice the readings in frames of 2000 {}; times: {}",
                at_text(&more[0]),
                spans(part, 2, |of| of.moving.a_frame(of.moving.events).value)
            ),
            by_range(&more[0]),
        )
        .with_details(format!(
            "events of what moves for each of its readings in frames of 2000 {}",
            with_both(part, |of| times(of.moving.a_frame(of.moving.events)))
        )),
        Claim::new(
            "redundant",
            format!(
                "fewer events of still pixels than frames {}, with dynamic depth {}; changes a frame: {}",
                at_text(&fewer_events[0]),
                at_text(&redundant[0]),
                spans(part, 2, |of| of.still.a_frame(of.still.changes).value)
            ),
            // The paper itself uses dynamic depth to achieve this.
            Verdict::graded(
                by_range(&fewer_events[0]) == Verdict::Agrees,
                !redundant[0].is_empty(),
            ),
        )
        .with_details(format!(
            "of still pixels: events a frame {}; changes a frame {}",
            with_both(part, |of| times(of.still.a_frame(of.still.events))),
            with_both(part, |of| times(of.still.a_frame(of.still.changes)))
        )),
    ]
}
