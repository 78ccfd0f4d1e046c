//! How fast a pulse is detected, compared with a likelihood ratio test that knows everything except
//! the position.

mod time;

use self::time::time;
use crate::studies::methods::passage::{BINS, LOOKS, Ladder, Passage, Rule, count_false};
use crate::sweep::charts::panel;
use crate::sweep::mean::{Measured, add_count};
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid, point};
use anyhow::Result;
use dtof_data::options::rows::grouped;
use dtof_draw::chart::{Axis, Chart, Series, Style};
use dtof_light::bounds::likelihood_ratio::{LikelihoodRatio, signal_for_information};
use dtof_light::looks::exposure::Exposures;
use dtof_light::rates::Rates;
use rand_pcg::Pcg64;
use std::fmt::Write as _;

/// Standard deviations of the pulse in bins.
pub const SIGMAS: [f64; 3] = [0.5, 1.0, 1.5];
/// The figure of each pulse.
const FIGURES: [&str; 3] = [
    "time-to-detect-0.5",
    "time-to-detect-1.0",
    "time-to-detect-1.5",
];
/// Background photons a bin and laser cycle.
pub const BACKGROUNDS: [f64; 3] = [0.01, 0.05, 0.2];
/// Positions of the pulse within its bin, and their names.
pub const PLACES: [(f64, &str); 2] = [(0.5, "centred"), (0.0, "on an edge")];
/// False alarms per exposure at which rules are compared.
pub const FALSE_SHARE: f64 = 0.01;
/// Nats a laser cycle: determines the signal for each background. The likelihood ratio needs 100 to
/// 300 laser cycles.
const INFORMATION: f64 = 9.0 / 200.0;
/// Exposures of a trial.
const EXPOSURES: u64 = 50;

/// Compared with the likelihood ratio, at equal rates of false alarms.
pub const STUDY: Study = Study {
    name: "time-to-detect",
    about: "laser cycles to an event against the likelihood ratio, by pulse and background",
    revision: 4,
    few_seeds: 20,
    all_seeds: 200,
    points,
    trial,
    results,
};

/// Exposures without a target for each scene known to the likelihood ratio, and with a target at
/// each position.
fn points() -> Vec<Point> {
    let mut points = Vec::new();
    for scene in grid([("sigma", &SIGMAS), ("background", &BACKGROUNDS)]) {
        let with_target = PLACES.map(|(place, _)| (1.0, place));
        for (target, place) in [(0.0, 0.0)].into_iter().chain(with_target) {
            let mut point = point([("target", target), ("place", place)]);
            point.extend(scene.clone());
            points.push(point);
        }
    }
    points
}

/// Thresholds around those of the comparison.
fn ladders() -> Vec<Ladder> {
    let rules = Rule::RULES.map(|rule| match rule {
        Rule::Paper => Ladder::new(rule, 12, 24, 4),
        Rule::Average => Ladder::new(rule, 18, 36, 4),
        _ => Ladder::new(rule, 15, 19, 4),
    });
    let mut ladders = rules.to_vec();
    ladders.push(Ladder::new(Rule::Oracle, 5, 11, 1));
    ladders
}

/// The signal, the same for every position: that for a pulse halfway between the middle of a bin
/// and its edge.
#[must_use]
pub fn signal(sigma: f64, background: f64) -> f64 {
    signal_for_information(background, 0.25, sigma, INFORMATION)
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let (background, sigma) = (point["background"], point["sigma"]);
    let signal = signal(sigma, background);
    let rates = Rates {
        background,
        signal: signal * point["target"],
        position: 64.0 + point["place"],
        sigma,
    };
    let ladders = ladders();
    let exposures = Exposures::new(&rates, u16::try_from(BINS)?, LOOKS)?;
    let scene = LikelihoodRatio::new(u32::try_from(BINS)?, background, signal, sigma);
    let mut passage = Passage::new(&ladders, exposures, Some(&scene))?;
    if point["target"] == 0.0 {
        return Ok(count_false(&mut passage, EXPOSURES, rng));
    }
    let mut tally = Tally::from([("exposures".to_owned(), EXPOSURES)]);
    for _ in 0..EXPOSURES {
        for (ladder, passed) in ladders.iter().zip(passage.run(rng)) {
            for index in 0..ladder.thresholds.len() {
                let cycles = passed.get(index).copied();
                let lasted = u64::from(cycles.unwrap_or(LOOKS.expiry()));
                let counts = [
                    ("events", u64::from(cycles.is_some())),
                    ("cycles", lasted),
                    ("squares", lasted * lasted),
                ];
                for (what, count) in counts {
                    add_count(&mut tally, &ladder.key(index, what), count);
                }
            }
        }
    }
    Ok(tally)
}

/// The result of a rule in a scene.
#[derive(Clone, Copy, Debug)]
pub struct DetectionOutcome {
    /// Standard deviation of the pulse in bins.
    pub sigma: f64,
    /// Position of the pulse within its bin.
    pub place: &'static str,
    /// Background photons a bin and laser cycle.
    pub background: f64,
    /// The rule.
    pub rule: Rule,
    /// The threshold for a share of [`FALSE_SHARE`] of false alarms.
    pub threshold: f64,
    /// Mean laser cycles to an event, over as many exposures as it takes. The interval includes the
    /// uncertainty of the times, of the share of expired exposures, and of the threshold.
    pub cycles: Measured,
    /// Ratio of `cycles` to those of the likelihood ratio.
    pub ratio: Measured,
}

/// The outcomes of every rule in every scene with a target.
#[must_use]
pub fn outcomes(part: &Part) -> Vec<DetectionOutcome> {
    let mut outcomes = Vec::new();
    for sigma in SIGMAS {
        for (within, place) in PLACES {
            for background in BACKGROUNDS {
                let with_target = part.one([
                    ("sigma", sigma),
                    ("background", background),
                    ("target", 1.0),
                    ("place", within),
                ]);
                let first = outcomes.len();
                for ladder in ladders() {
                    let rule = ladder.rule;
                    // Without a target, the rules do not depend on the pulse: all widths count.
                    let without = [("background", background), ("target", 0.0)];
                    let all = part.at(without);
                    let is_known = |point: &&PointTally| {
                        rule != Rule::Oracle || point.is_at([("sigma", sigma)])
                    };
                    let points: Vec<&PointTally> = all.filter(is_known).collect();
                    let (threshold, cycles) = time(&ladder, &points, with_target);
                    outcomes.push(DetectionOutcome {
                        sigma,
                        place,
                        background,
                        rule,
                        threshold,
                        cycles,
                        ratio: cycles,
                    });
                }
                // The likelihood ratio is the last. It sees the same photons; this correlation
                // makes the interval of the ratio conservative.
                let oracle = outcomes.last().map(|oracle| oracle.cycles);
                for outcome in &mut outcomes[first..] {
                    outcome.ratio = outcome.cycles.over(oracle.unwrap_or(outcome.cycles));
                }
            }
        }
    }
    outcomes
}

/// Whether an outcome is of `rule` with `sigma`, in tenths.
fn is(outcome: &DetectionOutcome, sigma: f64, rule: Rule) -> bool {
    (outcome.sigma - sigma).abs() < 0.01 && outcome.rule == rule
}

/// The mean ratio of a rule over backgrounds and positions of a pulse.
fn mean_ratio(outcomes: &[DetectionOutcome], sigma: f64, rule: Rule) -> f64 {
    let ratios = outcomes.iter().filter(|outcome| is(outcome, sigma, rule));
    let ratios: Vec<f64> = ratios.map(|outcome| outcome.ratio.value).collect();
    ratios.iter().sum::<f64>() / ratios.len().max(1) as f64
}

fn results(part: &Part) -> Result<Results> {
    let outcomes = outcomes(part);
    let mut figures = Vec::new();
    let exposures = part.one([("target", 1.0)]).count("exposures");
    for (name, sigma) in FIGURES.into_iter().zip(SIGMAS) {
        let means = Rule::RULES.map(|rule| (rule, mean_ratio(&outcomes, sigma, rule)));
        let best = means.into_iter().min_by(|a, b| a.1.total_cmp(&b.1));
        let best = best.unwrap_or((Rule::Paper, f64::NAN));
        let panels = PLACES.map(|(_, place)| {
            let series = Rule::RULES.map(|rule| {
                let those = outcomes
                    .iter()
                    .filter(|outcome| is(outcome, sigma, rule) && outcome.place == place);
                let dots = those.map(|outcome| outcome.ratio.at(outcome.background));
                let name = rule.short();
                Series::named(name, rule.pen(), Style::JoinedDots, dots.collect())
            });
            panel(
                format!("pulse {}", place.replace("centred", "centred in its bin")),
                series,
            )
        });
        let bins = match best.0 {
            Rule::Window(width) => width.to_string(),
            _ => String::new(),
        };
        let chart = Chart {
            finding: format!(
                    "Pulse σ {sigma}: a window of {bins} bins is fastest, {:.0} % behind the likelihood ratio",
                    (best.1 - 1.0) * 100.0
                ), holds: !bins.is_empty(),
            note: "Bars hold 99 %, that of the threshold included. Names: the paper's rule, and windows of so many bins."
                .to_owned(),
            x: Axis::logarithmic("background photons a bin and laser cycle"),
            y: Axis::logarithmic("laser cycles to an event over the likelihood ratio's")
                .within(0.95, 8.0),
            key: Vec::new(),
            columns: 2,
            panels: panels.into(),
        };
        figures.push(Figure::new(name, &chart)?);
    }
    Ok(Results {
        figures,
        values: [("exposures", grouped(exposures))].into(),
        tables: vec![("results/data/time_to_detect.csv", csv(&outcomes)?)],
        ..Results::default()
    })
}

fn csv(outcomes: &[DetectionOutcome]) -> Result<String> {
    let mut csv = "sigma,place,background,method,threshold,cycles,ratio,low,high\n".to_owned();
    for outcome in outcomes {
        writeln!(
            csv,
            "{},{},{},{},{:.3},{:.1},{}",
            outcome.sigma,
            outcome.place,
            outcome.background,
            outcome.rule.name(),
            outcome.threshold,
            outcome.cycles.value,
            outcome.ratio.cells(3)
        )?;
    }
    Ok(csv)
}
