//! The false alarms of an exposure with a fixed threshold, over backgrounds of several orders of
//! magnitude.

use crate::studies::methods::passage::{BINS, LOOKS, Ladder, Passage, Rule, count_false};
use crate::sweep::charts::{joined, level, level_key, panel};
use crate::sweep::mean::Measured;
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid};
use anyhow::Result;
use dtof_data::options::rows::grouped;
use dtof_draw::chart::{Axis, Chart, Panel};
use dtof_light::looks::exposure::Exposures;
use dtof_light::rates::Rates;
use rand_pcg::Pcg64;
use std::fmt::Write as _;

/// Mean background counts a bin at the first look, after 40 laser cycles; 25 times
/// as many after 1000.
const BACKGROUNDS: [f64; 9] = [0.4, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0];
/// Required false alarms per exposure, and the names of the figures.
const TARGETS: [(f64, &str); 2] = [(0.01, "false-rate"), (0.001, "false-rate-low")];
/// Exposures of a trial at each background: to calibrate the threshold, and to count its false
/// alarms.
const CALIBRATED: u64 = 20;
const TESTED: u64 = 50;

/// Every rule with one threshold for all backgrounds.
pub const STUDY: Study = Study {
    name: "false-rate",
    about: "false alarms with one threshold from 0.4 to 200 background counts a bin",
    revision: 4,
    few_seeds: 40,
    all_seeds: 4000,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    grid([("first_mean", &BACKGROUNDS), ("tested", &[0.0, 1.0])])
}

/// Neighbours differ by a third in their false alarms.
fn ladders() -> Vec<Ladder> {
    let ladder = |rule| match rule {
        Rule::Paper => Ladder::new(rule, 16, 64, 8),
        Rule::Average => Ladder::new(rule, 28, 88, 8),
        _ => Ladder::new(rule, 56, 88, 16),
    };
    Rule::RULES.map(ladder).to_vec()
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let rates = Rates::without_target(point["first_mean"] / f64::from(LOOKS.first * LOOKS.x));
    let ladders = ladders();
    let exposures = Exposures::new(&rates, u16::try_from(BINS)?, LOOKS)?;
    let mut passage = Passage::new(&ladders, exposures, None)?;
    let count = if point["tested"] > 0.0 {
        TESTED
    } else {
        CALIBRATED
    };
    Ok(count_false(&mut passage, count, rng))
}

/// A rule with one threshold.
struct RuleOutcome {
    rule: Rule,
    threshold: f64,
    /// False alarms per exposure at each background.
    shares: Vec<(f64, Measured)>,
}

impl RuleOutcome {
    /// The threshold with `requested` false alarms per exposure on average over the backgrounds, and
    /// its false alarms in separate exposures.
    fn new(ladder: &Ladder, part: &Part, requested: f64) -> Self {
        let calibrated: Vec<&PointTally> = part.at([("tested", 0.0)]).collect();
        let index = ladder.nearest(ladder.calibrated(&calibrated, requested));
        let key = ladder.key(index, "false");
        let share = |point: &PointTally| {
            let share = point.share(&key, "exposures");
            (point.parameter("first_mean"), share)
        };
        Self {
            rule: ladder.rule,
            threshold: ladder.thresholds[index],
            shares: part.at([("tested", 1.0)]).map(share).collect(),
        }
    }

    /// The largest factor between a share and `requested`, up or down. If a background has no false
    /// alarm, the closest ends of the intervals count instead: the factor is at least that.
    fn worst_factor(&self, requested: f64) -> f64 {
        let factor = |value: f64| (value / requested).max(requested / value);
        let factors = self.shares.iter().map(|(_, share)| {
            if !self.has_none() {
                factor(share.value)
            } else if share.contains(requested) {
                1.0
            } else {
                factor(share.interval.0).min(factor(share.interval.1))
            }
        });
        factors.fold(1.0, f64::max)
    }

    /// Whether a background had no false alarm.
    fn has_none(&self) -> bool {
        self.shares.iter().any(|(_, share)| share.value == 0.0)
    }

    /// A panel with a line at `requested`.
    fn panel(&self, requested: f64) -> Panel {
        let symbol = if matches!(self.rule, Rule::Paper | Rule::Average) {
            "α"
        } else {
            "z"
        };
        let dots = self.shares.iter();
        let dots = dots.map(|(background, share)| share.at(*background));
        let title = format!("{}, {symbol} {:.2}", self.rule.short(), self.threshold);
        let curve = joined(self.rule.pen(), dots);
        panel(title, [level(&BACKGROUNDS, requested), curve])
    }
}

fn results(part: &Part) -> Result<Results> {
    let mut figures = Vec::new();
    let mut csv = "wanted,method,threshold,first_mean,share,low,high\n".to_owned();
    let exposures = |tested| grouped(part.one([("tested", tested)]).count("exposures"));
    for (requested, name) in TARGETS {
        let outcomes: Vec<RuleOutcome> = ladders()
            .iter()
            .map(|ladder| RuleOutcome::new(ladder, part, requested))
            .collect();
        for outcome in &outcomes {
            for (background, share) in &outcome.shares {
                let (rule, threshold) = (outcome.rule.name(), outcome.threshold);
                let share = share.cells(6);
                writeln!(
                    csv,
                    "{requested},{rule},{threshold:.3},{background},{share}"
                )?;
            }
        }
        let percent = requested * 100.0;
        // The paper's rule with the quadrants and with the average, then the windows.
        let (papers, windows) = outcomes.split_at(2);
        let worst = |outcomes: &[RuleOutcome]| {
            let outcomes = outcomes.iter();
            let factors = outcomes.map(|outcome| outcome.worst_factor(requested));
            factors.fold(1.0, f64::max)
        };
        let [quadrants, average] = [0, 1].map(|at| {
            let factor = worst(&papers[at..=at]);
            let least = if papers[at].has_none() {
                "at least "
            } else {
                ""
            };
            (factor, format!("{least}{factor:.0}"))
        });
        let windows = worst(windows);
        let chart = Chart {
            finding: format!(
                "One z holds {percent} % false alarms at any background; one α is off by a factor of {} with quadrants, {} with the average",
                quadrants.1, average.1
            ),
            holds: windows < 1.5 && quadrants.0 > 10.0 && average.0 > 5.0,
            note: "Bars hold 99 %; an open dot is an upper limit where there was none.".to_owned(),
            x: Axis::logarithmic("background counts a bin at the first look"),
            y: Axis::logarithmic("exposures with a false alarm, %")
                .percent()
                .within(requested / 1000.0, requested * 10.0),
            key: vec![level_key(format!("{percent} %, as wanted"))],
            columns: 3,
            panels: outcomes
                .iter()
                .map(|outcome| outcome.panel(requested))
                .collect(),
        };
        figures.push(Figure::new(name, &chart)?);
    }
    Ok(Results {
        figures,
        values: [("calibrated", exposures(0.0)), ("tested", exposures(1.0))].into(),
        tables: vec![("results/data/false_rate.csv", csv)],
        ..Results::default()
    })
}
