//! The method to take: the cheapest of those that are exact enough and nearly as fast as the fastest. One answer
//! keeps every pixel; if blocks are faster, they are another.

use super::measure::TrialOutcome;
use super::method::Method;

/// A method may take this many times the shortest time.
const NEARLY: f64 = 1.1;

/// The share of wrong reports that is always allowed.
const WRONG_ALLOWED: f64 = 0.02;

/// The share of wrong reports that is allowed if frames have as many.
const WRONG_AT_MOST: f64 = 0.05;

/// A method may leave this share of the pixels more without a right report than the full-resolution trial that leaves the
/// fewest. Times are those of the middle half of the pixels, and errors those of pixels that report: neither shows pixels
/// that have fallen silent. Of 64 pixels the share has a standard deviation of at most 0.063 by chance.
const SILENT_ALLOWED: f64 = 0.1;

/// A method at the point where it becomes exact enough, interpolated between two trials.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// Index of the method.
    pub method: usize,
    /// The fewest photons of a peak.
    pub effort: u16,
    /// Laser cycles from one right report to the next.
    pub cycles: f64,
    /// The same for the pixel at the 90th percentile, or less; infinite if it never reports.
    pub slow_cycles: f64,
    /// The 68th percentile of the error, in millimetres.
    pub error_mm: f64,
    /// Instructions a laser cycle and pixel.
    pub instructions: f64,
    /// The share of the reports that are of blocks.
    pub of_blocks: f64,
    /// Relative standard deviation of the time.
    uncertainty: f64,
}

/// What is allowed at most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// The error, in millimetres.
    pub within_mm: f64,
    /// The share of wrong reports.
    pub wrong: f64,
    /// The share of the pixels without a right report.
    pub silent: f64,
}

/// The answer, and the methods it was chosen from.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// What is allowed.
    pub limits: Limits,
    /// All methods that become exact enough, the fastest first.
    pub candidates: Vec<Choice>,
    /// The method to take at full resolution, if one is exact enough.
    pub best: Option<Choice>,
    /// The method of blocks to take where time matters more than resolution, if one is faster.
    pub fastest: Option<Choice>,
}

/// The longest frames that were measured: of L2, unless there are fewer laser cycles.
pub(super) fn longest_frame<'a>(
    methods: &[Method],
    outcomes: &'a [TrialOutcome],
) -> Option<&'a TrialOutcome> {
    let frames = outcomes.iter().filter(|outcome| {
        methods
            .get(outcome.trial.method)
            .is_some_and(Method::is_frames)
    });
    frames.max_by_key(|outcome| outcome.trial.effort)
}

/// Chooses among `outcomes`, in which those of each method are in order of effort.
#[must_use]
pub fn answer(methods: &[Method], outcomes: &[TrialOutcome], within_mm: f64) -> Answer {
    let frame_wrong = longest_frame(methods, outcomes).map_or(0.0, |frame| frame.figures.wrong);
    let events_of_all = outcomes.iter().filter(|outcome| {
        let method = methods.get(outcome.trial.method);
        method.is_some_and(|method| !method.is_frames() && method.has_full_resolution())
    });
    let least_silent = events_of_all.map(|outcome| outcome.figures.silent);
    let least_silent = least_silent.min_by(f64::total_cmp).unwrap_or(0.0);
    let limits = Limits {
        within_mm,
        wrong: frame_wrong.clamp(WRONG_ALLOWED, WRONG_AT_MOST),
        silent: least_silent + SILENT_ALLOWED,
    };
    let numbers = (0..methods.len()).filter(|&number| !methods[number].is_frames());
    let candidates = numbers.filter_map(|number| {
        let of_method = outcomes
            .iter()
            .filter(|outcome| outcome.trial.method == number);
        where_exact(&of_method.collect::<Vec<_>>(), &limits)
    });
    let mut candidates: Vec<Choice> = candidates.collect();
    candidates.sort_unstable_by(|one, other| one.cycles.total_cmp(&other.cycles));
    let has_full_resolution = |choice: &Choice| methods[choice.method].has_full_resolution();
    let full = candidates
        .iter()
        .filter(|choice| has_full_resolution(choice));
    let best = nearly_fastest(full);
    let of_blocks = nearly_fastest(candidates.iter()).filter(|all| !has_full_resolution(all));
    let fastest = of_blocks.filter(|blocks| best.is_none_or(|best| blocks.cycles < best.cycles));
    Answer {
        limits,
        candidates,
        best,
        fastest,
    }
}

/// The cheapest of `candidates` that are nearly as fast as the first, which is the fastest.
fn nearly_fastest<'a>(candidates: impl Iterator<Item = &'a Choice> + Clone) -> Option<Choice> {
    let least = candidates.clone().next()?.cycles;
    // The uncertainty counts against a method, unless it is the fastest.
    let near = candidates.enumerate().filter(|(place, choice)| {
        *place == 0 || choice.cycles * (1.0 + choice.uncertainty) <= NEARLY * least
    });
    near.map(|(_, choice)| choice)
        .min_by(|one, other| one.instructions.total_cmp(&other.instructions))
        .copied()
}

/// Interpolates geometrically between the last trial that is not exact enough and the first that is. `None` if too many
/// pixels are silent there; a higher least count only silences more.
fn where_exact(trials: &[&TrialOutcome], limits: &Limits) -> Option<Choice> {
    let within_mm = limits.within_mm;
    // The error of few reports may be small by chance.
    let error = |outcome: &TrialOutcome| outcome.figures.error_mm * (1.0 + uncertainty(outcome));
    let is_exact = |outcome: &&TrialOutcome| {
        error(outcome) <= within_mm && outcome.figures.wrong <= limits.wrong
    };
    let first = trials.iter().position(is_exact)?;
    let exact = trials[first];
    let before = first.checked_sub(1).map(|index| trials[index]);
    let part = match before {
        // Only its error was too large: the errors show how far to go.
        Some(before) if before.figures.wrong <= limits.wrong => {
            let [from, to] = [before, exact].map(error);
            ((from / within_mm).ln() / (from / to).ln()).clamp(0.0, 1.0)
        }
        _ => 1.0,
    };
    let between = |of: fn(&TrialOutcome) -> f64| {
        let from = before.map_or(of(exact), of);
        from * (of(exact) / from).powf(part)
    };
    let cycles = between(|outcome| outcome.figures.cycles);
    let slow: fn(&TrialOutcome) -> f64 = |outcome| outcome.figures.slow_cycles;
    let slow_cycles = match between(slow) {
        cycles if cycles.is_finite() => cycles,
        // It reports in at most one of the trials.
        _ => before.map_or(f64::INFINITY, slow).min(slow(exact)),
    };
    // A share may be 0.
    let silent = exact.figures.silent;
    let silent = before.map_or(silent, |before| {
        let from = before.figures.silent;
        from + part * (silent - from)
    });
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within u16"
    )]
    let effort = between(|outcome| outcome.trial.effort.into()).ceil() as u16;
    (cycles.is_finite() && silent <= limits.silent).then(|| Choice {
        method: exact.trial.method,
        effort,
        cycles,
        slow_cycles,
        error_mm: between(|outcome| outcome.figures.error_mm),
        instructions: between(|outcome| outcome.instructions),
        of_blocks: exact.figures.of_blocks,
        uncertainty: uncertainty(exact),
    })
}

/// The standard deviation of a mean over all reports, relative to that of one report.
fn uncertainty(outcome: &TrialOutcome) -> f64 {
    1.0 / (outcome.figures.reports.max(1) as f64).sqrt()
}
