//! The results of the study of failures: for every case and method a verdict, and whether wrong
//! events are flagged.

use anyhow::Result;

use super::cases::cases;
use super::{Case, Method};
use crate::studies::scenes::one_pixel::PER_BIN;
use crate::sweep::mean::Measured;
use crate::sweep::{Part, PointTally};

/// The verdict on a method in a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// False alarms significantly below 2 %, an event in most exposures, and an error of less than
    /// twice that of the plain scene. Without a target: at most one false alarm in 100 exposures.
    Survives,
    /// Neither survives nor fails.
    Degrades,
    /// At least a tenth of the events is false, or at least half of the exposures have no event.
    Fails,
}

impl Verdict {
    /// Its name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Survives => "survives",
            Self::Degrades => "degrades",
            Self::Fails => "fails",
        }
    }
}

/// Whether wrong events are flagged. Wrong events are false alarms, or all events if the error is
/// significantly at least twice that of the plain scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Warning {
    /// Wrong events are not significantly above one in 100 exposures, which any threshold lets
    /// through.
    NotNeeded,
    /// There are wrong events, and they are flagged.
    Flagged,
    /// There are wrong events without a flag.
    Silent,
}

impl Warning {
    /// Its name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotNeeded => "not needed",
            Self::Flagged => "flagged",
            Self::Silent => "silent",
        }
    }

    /// Of `wrong` events, `flagged` have a flag. There are too many if they significantly exceed 1
    /// % of the `exposures` or 10 % of the `events`.
    fn new(wrong: u64, flagged: u64, events: u64, exposures: u64) -> Self {
        let are_many = |wrong| {
            Measured::share(wrong, exposures).interval.0 > 0.01
                || (events > 0 && Measured::share(wrong, events).interval.0 > 0.1)
        };
        if are_many(wrong - flagged) {
            Self::Silent
        } else if are_many(wrong) {
            Self::Flagged
        } else {
            Self::NotNeeded
        }
    }
}

/// A method in a case.
#[derive(Clone, Copy, Debug)]
pub struct FailureOutcome {
    /// The rule and the depth estimator.
    pub method: Method,
    /// Whether the case has a target.
    pub has_target: bool,
    /// Number of events.
    pub events: u64,
    /// False alarms per event, `None` without events; without a target, false alarms per exposure.
    pub false_share: Option<Measured>,
    /// The share of exposures without an event.
    pub without: Measured,
    /// Mean laser cycles of the exposures with an event; 0 without events.
    pub cycles: f64,
    /// Root mean square error of the events that are not false, in bins; 0 without such events.
    pub error: f64,
    /// Their mean error in bins, negative if events are too near.
    pub mean_error: f64,
    /// Whether the error is significantly at least twice that of the plain scene.
    pub is_far_off: bool,
    /// The share of events with a full peak counter.
    pub saturated: f64,
    /// The share of events whose window reached past the gate.
    pub clipped: f64,
    /// The share of events whose TDC took a hit in more than half of the laser cycles.
    pub piled_up: f64,
    /// The share of events from a surface other than the first.
    pub other_surface: f64,
    /// The verdict.
    pub verdict: Verdict,
    /// Whether wrong events are flagged.
    pub warning: Warning,
}

/// The outcomes of every method in every case.
///
/// # Errors
/// Fails if a gate does not fit the bins.
pub fn outcomes(part: &Part) -> Result<Vec<(Case, Vec<FailureOutcome>)>> {
    let plain = part.one([("case", 0.0)]);
    let of = |(case, point): (Case, &PointTally)| {
        let outcomes = Method::all().map(|method| outcome(&case, point, plain, method));
        let outcomes = outcomes.collect();
        (case, outcomes)
    };
    Ok(cases()?.into_iter().zip(part.points()).map(of).collect())
}

fn outcome(case: &Case, point: &PointTally, plain: &PointTally, method: Method) -> FailureOutcome {
    let name = method.name();
    let count = |what: &str| point.count(&format!("{name} {what}"));
    let (events, exposures) = (count("events"), point.count("exposures"));
    let (false_events, flagged) = (count("false"), count("flagged"));
    let share = |what: &str| count(what) as f64 / events.max(1) as f64;
    let bins = |parts: f64| {
        if parts.is_nan() {
            0.0
        } else {
            parts / PER_BIN as f64
        }
    };
    let [error, plain_error] = [point, plain].map(|point| Measured::root_mean_square(point, &name));
    let has_target = case.surfaces(0).next().is_some();
    let false_share = if has_target {
        (events > 0).then(|| Measured::share(false_events, events))
    } else {
        Some(Measured::share(false_events, exposures))
    };
    let without = Measured::share(exposures - events, exposures);
    let is_far_off = error.interval.0 >= 2.0 * plain_error.value;
    let verdict = match false_share {
        Some(share) if !has_target && share.interval.0 <= 0.01 => Verdict::Survives,
        Some(share) if share.value < 0.1 && (without.value < 0.5 || !has_target) => {
            if share.interval.1 >= 0.02 || error.value >= 2.0 * plain_error.value {
                Verdict::Degrades
            } else {
                Verdict::Survives
            }
        }
        _ => Verdict::Fails,
    };
    let warning = if is_far_off {
        Warning::new(events, flagged, events, exposures)
    } else {
        // Without a target every event is false; only their number matters.
        let of_events = if has_target { events } else { 0 };
        Warning::new(false_events, count("false flagged"), of_events, exposures)
    };
    FailureOutcome {
        method,
        has_target,
        events,
        false_share,
        without,
        cycles: count("cycles") as f64 / events.max(1) as f64,
        error: bins(error.value),
        mean_error: bins(Measured::mean(point, &name).value),
        is_far_off,
        saturated: share("saturated"),
        clipped: share("clipped"),
        piled_up: share("piled up"),
        other_surface: share("other surface"),
        verdict,
        warning,
    }
}
