//! What the study of failures comes to: for every case and method a verdict, and
//! whether flags tell the wrong events.

use anyhow::Result;

use super::cases::cases;
use super::{Case, Method};
use crate::studies::scenes::one_pixel::PER_BIN;
use crate::sweep::mean::Measured;
use crate::sweep::{Part, PointTally};

/// How a method does in a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// False alarms surely below 2 %, most exposures bring an event, and the error
    /// is less than twice that of the plain scene. Without a target: no more than one
    /// false alarm in 100 exposures.
    Survives,
    /// Neither of the others.
    Degrades,
    /// A tenth of the events or more is false, or half of the exposures or more are
    /// without one.
    Fails,
}

impl Verdict {
    /// As a table shows it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Survives => "survives",
            Self::Degrades => "degrades",
            Self::Fails => "fails",
        }
    }
}

/// Whether wrong events have a flag. Wrong are false alarms; and all, if the error is
/// surely twice that of the plain scene or more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Warning {
    /// It is not sure that there are more wrong events than one in 100 exposures, which
    /// any threshold lets through.
    NotNeeded,
    /// There are, but not without a flag.
    Flagged,
    /// There are without a flag.
    Silent,
}

impl Warning {
    /// As a table shows it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotNeeded => "not needed",
            Self::Flagged => "flagged",
            Self::Silent => "silent",
        }
    }

    /// Of so many wrong events of all `events`, in so many exposures. Where few exposures
    /// bring an event it takes few to be wrong: more than a tenth of them, for sure.
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
pub struct Outcome {
    /// What decides, and finds the depth.
    pub method: Method,
    /// How many.
    pub events: u64,
    /// False alarms an event, none without an event; without a target, false alarms an
    /// exposure.
    pub false_share: Option<Measured>,
    /// Exposures without an event.
    pub without: Measured,
    /// Mean laser cycles of the exposure of an event; 0 if there are none.
    pub cycles: f64,
    /// Root mean square error of the events that are not false, in bins; 0 if there
    /// are none.
    pub error: f64,
    /// Their mean error: below 0 if events are too near.
    pub mean_error: f64,
    /// Whether the error is, for sure, twice that of the plain scene or more.
    pub is_far_off: bool,
    /// Events whose peak counter was full, of all events.
    pub saturated: f64,
    /// Events whose window reached past the gate.
    pub clipped: f64,
    /// Events whose TDC took a hit in more than half of the laser cycles.
    pub piled_up: f64,
    /// Events of another surface than the first.
    pub other_surface: f64,
    /// How it does.
    pub verdict: Verdict,
    /// Whether flags tell what is wrong.
    pub warning: Warning,
}

/// Every method in every case.
///
/// # Errors
/// If `part` is not of this study.
pub fn outcomes(part: &Part) -> Result<Vec<(Case, Vec<Outcome>)>> {
    let plain = part.one([("case", 0.0)])?;
    let of = |(case, point): (Case, &PointTally)| {
        let outcomes = Method::all().map(|method| outcome(&case, point, plain, method));
        let outcomes = outcomes.collect();
        (case, outcomes)
    };
    Ok(cases()?.into_iter().zip(part.points()).map(of).collect())
}

fn outcome(case: &Case, point: &PointTally, plain: &PointTally, method: Method) -> Outcome {
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
        // Without a target every event is false, and how many there are is asked alone.
        let of_events = if has_target { events } else { 0 };
        Warning::new(false_events, count("false flagged"), of_events, exposures)
    };
    Outcome {
        method,
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
