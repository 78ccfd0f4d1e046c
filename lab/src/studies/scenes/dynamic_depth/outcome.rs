//! The results of a method of change detection.

use super::super::systems::Background;
use super::{REFERENCES, SIGNALS, name};
use crate::sweep::mean::{Measured, Z_99};
use crate::sweep::results::Verdict;
use crate::sweep::{Part, PointTally};

/// The smallest share of removed events in the paper.
pub const REMOVED: f64 = 0.7;
/// A claim agrees if it holds over a range of signals of this factor.
const RANGE: f64 = 5.0;
pub const SCENES: [(f64, &str); 2] = [(0.0, "car"), (1.0, "fan")];

/// The results of a method of change detection at a point.
pub struct ChangeOutcome {
    /// The share of events that do not cause a change.
    pub removed: Measured,
    /// The share of events that cause a change.
    pub left: Measured,
    /// The share of true steps that are reported.
    pub found: Measured,
    /// The share of false changes.
    pub is_false: Measured,
    /// Laser cycles from a step to its report.
    pub delay: Measured,
    pub events: u64,
    pub changes: u64,
    pub steps: u64,
    pub still: Surface,
    pub moving: Surface,
}

/// The counts of all still pixels, or of all others.
pub struct Surface {
    pub pixels: u64,
    pub frames: u64,
    pub events: u64,
    pub changes: u64,
}

impl Surface {
    /// `count` per reading of a frame of 2000, with a Poisson interval. Events come more regularly,
    /// so the interval is conservative.
    pub fn a_frame(&self, count: u64) -> Measured {
        let value = count as f64 / self.frames as f64;
        let half = Z_99 * (count.max(1) as f64).sqrt() / self.frames as f64;
        Measured {
            value,
            interval: ((value - half).max(0.0), value + half),
        }
    }
}

pub fn outcome(point: &PointTally, background: Background, reference: &str) -> ChangeOutcome {
    let name = name(background, reference);
    let count = |what: &str| point.count(&format!("{name} {what}"));
    let surface = |which: &str| Surface {
        pixels: count(&format!("{which} pixels")),
        frames: point.count(&format!("{which} frames")),
        events: count(&format!("{which} events")),
        changes: count(&format!("{which} changes")),
    };
    let delay = format!("{name} delay");
    let (still, moving) = (surface("still"), surface("moving"));
    let (events, changes) = (still.events + moving.events, count("changes"));
    ChangeOutcome {
        removed: Measured::share(events - changes, events),
        left: Measured::share(changes, events),
        found: Measured::share(point.count(&format!("{delay} values")), count("steps")),
        is_false: Measured::share(count("false"), changes),
        delay: Measured::mean(point, &delay),
        events,
        changes,
        steps: count("steps"),
        still,
        moving,
    }
}

/// The paper's method on the PC, at every signal of a scene.
pub fn on_pc(
    part: &Part,
    fan: f64,
    background: Background,
    reference: usize,
) -> Vec<(f64, ChangeOutcome)> {
    let points = part.at([("fpga", 0.0), ("fan", fan)]);
    let outcomes = points.map(|point| {
        let outcome = outcome(point, background, REFERENCES[reference].1);
        (point.parameter("signal"), outcome)
    });
    outcomes.collect()
}

/// The signals at which `holds` of the car and of the fan.
pub fn holding(
    part: &Part,
    background: Background,
    holds: impl Fn(&ChangeOutcome) -> bool,
) -> Vec<f64> {
    let [cars, fans] = SCENES.map(|(fan, _)| on_pc(part, fan, background, 0));
    let both = cars.iter().zip(&fans);
    let holding = both.filter(|(car, fan)| holds(&car.1) && holds(&fan.1));
    holding.map(|(car, _)| car.0).collect()
}

/// Agrees if the claim holds over a contiguous range of [`RANGE`], differs if it holds anywhere,
/// otherwise refuted.
pub fn by_range(holding: &[f64]) -> Verdict {
    let is_range = |from: f64| {
        let mut range = SIGNALS
            .into_iter()
            .filter(|signal| (from..=from * RANGE).contains(signal));
        range.all(|signal| holding.contains(&signal))
    };
    let mut ends = holding
        .iter()
        .filter(|&&from| SIGNALS.contains(&(from * RANGE)));
    Verdict::graded(ends.any(|&from| is_range(from)), !holding.is_empty())
}

pub fn at_text(holding: &[f64]) -> String {
    match holding.len() {
        0 => "at no signal".to_owned(),
        count if count == SIGNALS.len() => "at every signal".to_owned(),
        _ => {
            let texts = holding.iter().map(f64::to_string);
            format!("at {}", texts.collect::<Vec<_>>().join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_is_of_a_factor_of_five_without_a_gap() {
        assert_eq!(by_range(&[0.2, 0.5, 1.0]), Verdict::Agrees);
        assert_eq!(by_range(&[1.0, 2.0, 5.0]), Verdict::Agrees);
        assert_eq!(by_range(&[0.2, 1.0, 5.0]), Verdict::Differs);
        assert_eq!(by_range(&[5.0]), Verdict::Differs);
        assert_eq!(by_range(&[]), Verdict::Refuted);
    }
}
