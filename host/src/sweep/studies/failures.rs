//! Where methods fail: scenes that are not the plain model, and whether events say
//! that something is wrong with them.

pub mod cases;

use std::fmt::Write as _;

use anyhow::{Context, Result};
use dtof_core::fixed::types::U8F8;
use dtof_core::{
    BinPosition, Count, DepthEstimator, Detection, DetectionRule, Flags, Histogram, PaperRule,
    RangeGate, WindowRule, detect, z_for,
};
use rand_pcg::Pcg64;

use self::cases::{BACKGROUNDS, Case, background_name, cases};
use super::one_pixel::{PER_BIN, in_parts};
use crate::chart::{Axis, Chart, Series, Style, line_chart};
use crate::summary::grouped;
use crate::sweep::mean::add;
use crate::sweep::results::{Figure, Results, Share, Table};
use crate::sweep::{Part, Point, PointTally, Study, Tally, point};

/// Bins of a histogram.
pub const BINS: usize = 128;
/// How the pixels operate.
const X: u16 = 4;
const L1: u16 = 40;
const L2: u16 = 2000;
/// The fewest photons of an event, in the peak or in the window.
const MINIMUM_COUNT: u32 = 5;
/// Standard deviation of the pulse in bins.
const SIGMA: f64 = 1.0;
/// An event farther from every surface is false: 1 + 2σ bins, at least 2.
const FALSE: i64 = 3 * PER_BIN;

/// Held against the plain scene.
pub const STUDY: Study = Study {
    name: "failures",
    about: "false, missing and wrong events in scenes that are not plain, and their flags",
    revision: 1,
    few_seeds: 30,
    all_seeds: 200,
    points,
    trial,
    results,
};

/// What decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// The paper's with this α.
    Paper(u8),
    /// The window of 3 bins, with the z for a false event in 100 exposures.
    Window,
}

impl Rule {
    /// All.
    pub const ALL: [Self; 3] = [Self::Paper(4), Self::Paper(8), Self::Window];

    /// Its name in tallies and tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Paper(4) => "α = 4",
            Self::Paper(_) => "α = 8",
            Self::Window => "window of 3",
        }
    }

    /// One decision, with the depth of each of [`ESTIMATORS`].
    fn look(self, histogram: &Histogram<BINS>, gate: &RangeGate<BINS>) -> Option<[Detection; 2]> {
        let minimum = Count::saturating(MINIMUM_COUNT);
        match self {
            Self::Paper(alpha) => {
                let rule = PaperRule::new(U8F8::from_num(alpha), minimum);
                estimated(histogram, gate, &rule)
            }
            Self::Window => {
                let rule = WindowRule::new(3, z_for(100, gate, X, L1, L2), minimum);
                estimated(histogram, gate, &rule.ok()?)
            }
        }
    }
}

/// Their names: the paper's, and the centred window for the pulse.
pub const ESTIMATORS: [&str; 2] = ["centre of mass", "centred"];

fn estimated<R: DetectionRule>(
    histogram: &Histogram<BINS>,
    gate: &RangeGate<BINS>,
    rule: &R,
) -> Option<[Detection; 2]> {
    let paper = detect(histogram, gate, rule, &DepthEstimator::CentreOfMass3)?;
    let centred = DepthEstimator::for_pulse(U8F8::from_num(SIGMA));
    Some([paper, detect(histogram, gate, rule, &centred)?])
}

fn points() -> Vec<Point> {
    let count = cases().map_or(0, |cases| cases.len());
    let numbers = (0u32..).take(count);
    numbers
        .map(|number| point([("case", f64::from(number))]))
        .collect()
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let mut numbered = (0u32..).map(f64::from).zip(cases()?);
    let case = numbered.find(|(number, _)| (number - point["case"]).abs() < 0.5);
    let (_, case) = case.context("no such case")?;
    let mut tally = Tally::from([("exposures".to_owned(), case.exposures)]);
    for _ in 0..case.exposures {
        exposure(&case, rng, &mut tally)?;
    }
    Ok(tally)
}

/// One exposure, which each rule ends for itself.
fn exposure(case: &Case, rng: &mut Pcg64, tally: &mut Tally) -> Result<()> {
    let mut pixel = case.pixel(rng)?;
    let mut histogram = Histogram::<BINS>::new();
    let mut waiting = Rule::ALL.to_vec();
    for cycle in 1..u32::from(L2) {
        pixel.next_cycle(cycle, |code| {
            if case.gate.contains(code) {
                histogram.add(code);
            }
        })?;
        if cycle <= u32::from(L1) || cycle % u32::from(X) != 0 {
            continue;
        }
        waiting.retain(|&rule| {
            let Some(found) = rule.look(&histogram, &case.gate) else {
                return true;
            };
            add(tally, rule.name(), "events", 1);
            add(tally, rule.name(), "cycles", cycle.into());
            for (estimator, detection) in ESTIMATORS.into_iter().zip(found) {
                let name = format!("{} {estimator}", rule.name());
                add_event(tally, &name, &detection, case.surfaces(cycle));
            }
            false
        });
        if waiting.is_empty() {
            break;
        }
    }
    Ok(())
}

/// What an event of the method `name` says, with surfaces at `surfaces`.
fn add_event(
    tally: &mut Tally,
    name: &str,
    detection: &Detection,
    surfaces: impl Iterator<Item = f64>,
) {
    let position = BinPosition::of(detection.peak.bin, detection.depth.offset);
    let errors = surfaces.map(|surface| (i64::from(position.raw()) - in_parts(surface)).abs());
    // In the order of the pulses: the first is the nearest unless another is nearer.
    let (index, error) = errors
        .enumerate()
        .min_by_key(|(_, error)| *error)
        .unwrap_or((0, i64::MAX));
    let flags = detection.depth.flags;
    let (is_false, is_flagged) = (error > FALSE, flags != Flags::NONE);
    let counts = [
        ("false", is_false),
        ("false flagged", is_false && is_flagged),
        ("flagged", is_flagged),
        ("saturated", flags.contains(Flags::SATURATED)),
        ("clipped", flags.contains(Flags::CLIPPED)),
        ("other surface", !is_false && index > 0),
    ];
    for (what, _) in counts.into_iter().filter(|&(_, counts)| counts) {
        add(tally, name, what, 1);
    }
    if !is_false {
        add(tally, name, "squares", error.unsigned_abs().pow(2));
    }
}

/// How a method does in a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// False events surely below 2 %, most exposures bring an event, and the error
    /// is less than twice that of the plain scene.
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
            Self::Fails => "**fails**",
        }
    }
}

/// A method in a case.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// What decides.
    pub rule: Rule,
    /// Of [`ESTIMATORS`].
    pub estimator: &'static str,
    /// False events an event; none without an event.
    pub false_share: Option<Share>,
    /// Exposures without an event.
    pub without: Share,
    /// Mean laser cycles of the exposure of an event; 0 if there are none.
    pub cycles: f64,
    /// Root mean square error of the events that are not false, in bins; 0 if there
    /// are none.
    pub error: f64,
    /// Events whose peak counter was full, of all events.
    pub saturated: f64,
    /// Events whose window reached past the gate.
    pub clipped: f64,
    /// Events of another surface than the first.
    pub other_surface: f64,
    /// How it does.
    pub verdict: Verdict,
    /// Whether an exposure in a hundred or more brings a wrong event and fewer than nine
    /// in ten of these are flagged: false ones, if they are 2 % of the events or more, or
    /// any if the error is too large.
    pub is_silent: bool,
}

/// Every method in every case.
///
/// # Errors
/// If `part` is not of this study.
pub fn outcomes(part: &Part) -> Result<Vec<(Case, Vec<Outcome>)>> {
    let plain = part.one([("case", 0.0)])?;
    let of = |(case, point): (Case, &PointTally)| {
        let rules = Rule::ALL.into_iter();
        let methods = rules.flat_map(|rule| ESTIMATORS.map(|estimator| (rule, estimator)));
        let outcomes = methods.map(|(rule, estimator)| outcome(point, plain, rule, estimator));
        (case, outcomes.collect())
    };
    Ok(cases()?.into_iter().zip(part.points()).map(of).collect())
}

#[allow(clippy::cast_precision_loss, reason = "far fewer than 2^52")]
fn outcome(point: &PointTally, plain: &PointTally, rule: Rule, estimator: &'static str) -> Outcome {
    let count = |point: &PointTally, what: &str| {
        point.count(&format!("{} {estimator} {what}", rule.name()))
    };
    let events = point.count(&format!("{} events", rule.name()));
    let exposures = point.count("exposures");
    let error = |point: &PointTally| {
        let events = point.count(&format!("{} events", rule.name()));
        let right = events - count(point, "false");
        let mean = count(point, "squares") as f64 / right.max(1) as f64;
        mean.sqrt() / PER_BIN as f64
    };
    let share = |what: &str| count(point, what) as f64 / events.max(1) as f64;
    let false_events = count(point, "false");
    let false_share = (events > 0).then(|| Share::new(false_events, events));
    let without = Share::new(exposures - events, exposures);
    let may_be_false = false_share.is_some_and(|share| share.interval.1 >= 0.02);
    let are_false = false_share.is_some_and(|share| share.value >= 0.02);
    // Fewer are what any threshold lets through.
    let many = |wrong: u64| wrong * 100 >= exposures;
    let large_error = error(point) >= 2.0 * error(plain);
    let verdict = match false_share {
        Some(share) if share.value < 0.1 && without.value < 0.5 => {
            if may_be_false || large_error {
                Verdict::Degrades
            } else {
                Verdict::Survives
            }
        }
        _ => Verdict::Fails,
    };
    let few = |flagged: u64, of: u64| many(of) && (flagged as f64) < 0.9 * of as f64;
    let is_silent = are_false && few(count(point, "false flagged"), false_events)
        || large_error && few(count(point, "flagged"), events);
    Outcome {
        rule,
        estimator,
        false_share,
        without,
        cycles: point.count(&format!("{} cycles", rule.name())) as f64 / events.max(1) as f64,
        error: error(point),
        saturated: share("saturated"),
        clipped: share("clipped"),
        other_surface: share("other surface"),
        verdict,
        is_silent,
    }
}

fn results(part: &Part) -> Result<Results> {
    let outcomes = outcomes(part)?;
    let mut series = Vec::new();
    for (colour, rule) in Rule::ALL.into_iter().enumerate() {
        for is_weak in [false, true] {
            let mut points = Vec::new();
            for background in BACKGROUNDS {
                let name = background_name(background, is_weak);
                let found = outcomes.iter().find(|(case, _)| case.name == name);
                let of_case = found.map_or(&[][..], |(_, outcomes)| outcomes);
                // Both estimators have the same false events but for a few near the limit.
                let outcome = of_case.iter().find(|outcome| outcome.rule == rule);
                let outcome = outcome.filter(|outcome| outcome.without.value < 0.9);
                let share = outcome.and_then(|outcome| outcome.false_share);
                points.extend(share.map(|share| share.at(background)));
            }
            let name = rule.name();
            series.push(Series {
                name: Some(if is_weak {
                    format!("{name}, weak signal")
                } else {
                    name.to_owned()
                }),
                colour: 2 * colour + usize::from(is_weak),
                style: Style::JoinedDots,
                points,
            });
        }
    }
    let svg = line_chart(&Chart {
        title: "False events of all events over the background",
        x: Axis {
            range: Some((0.03, 200_000.0)),
            ..Axis::logarithmic("background counts a bin after 40 laser cycles")
        },
        y: Axis {
            range: Some((0.0, 0.04)),
            ..Axis::linear("share of events that are false")
        },
        series,
    })?;
    let exposures = part
        .points()
        .first()
        .map_or(0, |point| point.count("exposures"));
    Ok(Results {
        figures: vec![Figure {
            name: "failures-background",
            svg,
            caption: format!(
                "Events farther than 3 bins from the target, of all events, over the background at equal signal to noise: \
                 A/√B = 2.24 in a laser cycle, or 0.54 if weak; pulse σ 1 bin, centre of mass. At 500 counts the counters \
                 are full before L2. {} exposures a dot, a fifth of them at 500; a dot is missing where fewer than a tenth of the exposures brought an event",
                grouped(exposures)
            ),
        }],
        claims: Vec::new(),
        tables: vec![Table {
            name: "failures",
            csv: csv(&outcomes)?,
        }],
    })
}

fn csv(outcomes: &[(Case, Vec<Outcome>)]) -> Result<String> {
    let mut csv = "case,rule,estimator,false,false_low,false_high,without_event,cycles,error,saturated,clipped,\
                   other_surface,verdict,silent\n"
        .to_owned();
    for (case, outcomes) in outcomes {
        for outcome in outcomes {
            let share = outcome.false_share.map_or(",,".to_owned(), |share| {
                let (low, high) = share.interval;
                format!("{:.4},{low:.4},{high:.4}", share.value)
            });
            writeln!(
                csv,
                "\"{}\",{},{},{share},{:.4},{:.1},{:.3},{:.3},{:.3},{:.3},{},{}",
                case.name,
                outcome.rule.name(),
                outcome.estimator,
                outcome.without.value,
                outcome.cycles,
                outcome.error,
                outcome.saturated,
                outcome.clipped,
                outcome.other_surface,
                outcome.verdict.name().trim_matches('*'),
                outcome.is_silent
            )?;
        }
    }
    Ok(csv)
}
