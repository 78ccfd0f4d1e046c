//! The method to take: the cheapest of those that are nearly as fast as the fastest, and exact
//! enough.

use super::measure::Outcome;
use super::method::{Kind, Method};

/// A method may take so many times the least time.
const NEARLY: f64 = 1.1;

/// The share of wrong reports that is always allowed.
const WRONG_ALLOWED: f64 = 0.02;

/// And that which is allowed where frames are wrong as often.
const WRONG_AT_MOST: f64 = 0.05;

/// A method where it is as exact as wanted, between two trials.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// Its number among the methods.
    pub method: usize,
    /// Photons of a peak, at least.
    pub effort: u16,
    /// Laser cycles from one right report to the next.
    pub cycles: f64,
    /// The same of the pixel that nine of ten are faster than, or more; infinite if it never reports.
    pub slow_cycles: f64,
    /// Millimetres that 68 % of the reports are off, at most.
    pub error_mm: f64,
    /// Instructions a laser cycle and pixel.
    pub instructions: f64,
    /// The standard deviation of the time, as a share of it.
    uncertain: f64,
}

/// The answer, and how it came about.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// How exact it had to be.
    pub within_mm: f64,
    /// Every method that can be, where it is; the fastest first.
    pub able: Vec<Choice>,
    /// The method to take: one of `able`. None if there is none.
    pub taken: Option<Choice>,
}

/// The error and the share of wrong reports of the frame of L2, the last trial of frames.
#[must_use]
pub fn of_longest_frame(methods: &[Method], outcomes: &[Outcome]) -> Option<(f64, f64)> {
    let frames = outcomes
        .iter()
        .filter(|outcome| methods[outcome.trial.method].kind == Kind::Frames);
    let longest = frames.max_by_key(|outcome| outcome.trial.effort)?;
    Some((longest.figures.error_mm, longest.figures.wrong))
}

/// Chooses among `outcomes`, those of a method in order of effort.
#[must_use]
pub fn answer(methods: &[Method], outcomes: &[Outcome], within_mm: f64) -> Answer {
    let frame_wrong = of_longest_frame(methods, outcomes).map_or(0.0, |frame| frame.1);
    let allowed = frame_wrong.clamp(WRONG_ALLOWED, WRONG_AT_MOST);
    let numbers = (0..methods.len()).filter(|&number| methods[number].kind != Kind::Frames);
    let able = numbers.filter_map(|number| {
        let of_method = outcomes
            .iter()
            .filter(|outcome| outcome.trial.method == number);
        where_exact(&of_method.collect::<Vec<_>>(), within_mm, allowed)
    });
    let mut able: Vec<Choice> = able.collect();
    able.sort_unstable_by(|one, other| one.cycles.total_cmp(&other.cycles));
    let least = able.first().map_or(0.0, |choice| choice.cycles);
    // What may be slower by chance of these photons is not taken.
    let near = able.iter().enumerate().filter(|(place, choice)| {
        *place == 0 || choice.cycles * (1.0 + choice.uncertain) <= NEARLY * least
    });
    let taken = near
        .map(|(_, choice)| choice)
        .min_by(|one, other| one.instructions.total_cmp(&other.instructions))
        .copied();
    Answer {
        within_mm,
        able,
        taken,
    }
}

/// Between the last trial that is not exact enough and the first that is, values change by
/// equal factors.
fn where_exact(trials: &[&Outcome], within_mm: f64, wrong_allowed: f64) -> Option<Choice> {
    // The error of few reports may be smaller by chance.
    let error = |outcome: &Outcome| outcome.figures.error_mm * (1.0 + uncertain(outcome));
    let is_exact =
        |outcome: &&Outcome| error(outcome) <= within_mm && outcome.figures.wrong <= wrong_allowed;
    let first = trials.iter().position(is_exact)?;
    let exact = trials[first];
    let before = first.checked_sub(1).map(|index| trials[index]);
    let part = match before {
        // Only its error was too large, so that it is known how far to go.
        Some(before) if before.figures.wrong <= wrong_allowed => {
            let [from, to] = [before, exact].map(error);
            ((from / within_mm).ln() / (from / to).ln()).clamp(0.0, 1.0)
        }
        _ => 1.0,
    };
    let between = |of: fn(&Outcome) -> f64| {
        let from = before.map_or(of(exact), of);
        from * (of(exact) / from).powf(part)
    };
    let cycles = between(|outcome| outcome.figures.cycles);
    let slow: fn(&Outcome) -> f64 = |outcome| outcome.figures.slow_cycles;
    let slow_cycles = match between(slow) {
        cycles if cycles.is_finite() => cycles,
        // It reports in one of the trials at most.
        _ => before.map_or(f64::INFINITY, slow).min(slow(exact)),
    };
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within u16"
    )]
    let effort = between(|outcome| outcome.trial.effort.into()).ceil() as u16;
    cycles.is_finite().then(|| Choice {
        method: exact.trial.method,
        effort,
        cycles,
        slow_cycles,
        error_mm: between(|outcome| outcome.figures.error_mm),
        instructions: between(|outcome| outcome.instructions),
        uncertain: uncertain(exact),
    })
}

/// The standard deviation of a mean over all reports, as a share of that of one.
fn uncertain(outcome: &Outcome) -> f64 {
    1.0 / (outcome.figures.reports.max(1) as f64).sqrt()
}
