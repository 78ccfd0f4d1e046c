//! Which method for which scene: time and error from the studies, against the cost in instructions.

mod events;
mod other_lidar;
mod recorded;
mod tables;

use self::recorded::recorded;
use crate::studies::methods::depth_error::Estimator;
use crate::studies::methods::passage::Rule;
use crate::studies::methods::time_to_detect::DetectionOutcome;
use crate::studies::methods::{depth_error, time_to_detect};
use crate::sweep::mean::Measured;
use crate::sweep::results::ends;
use crate::sweep::values::Values;
use crate::sweep::{Part, PointTally};
use anyhow::{Context, Result, ensure};
use dtof_draw::chart::{Axis, Chart, Panel, Point as Dot, Series, Style, chart};
use dtof_draw::palette::{self, Pen};
use std::path::PathBuf;

pub use self::recorded::RECORDED;

/// The instruction counts, relative to the documentation.
pub const INSTRUCTIONS: &str = "results/bench/instructions.csv";
/// The cheapest method within this share of the best is chosen.
const MARGIN: f64 = 0.1;

/// Instructions of the operations of the core on a Cortex-M4F, optimised for speed.
struct Instructions<'a>(&'a str);

impl Instructions<'_> {
    fn of(&self, operation: &str, variant: &str) -> Result<f64> {
        let line = format!("{operation},{variant},3,");
        let found = self.0.lines().find_map(|row| row.strip_prefix(&line));
        let found = found.with_context(|| format!("{INSTRUCTIONS}: no `{line}`"))?;
        found
            .parse()
            .with_context(|| format!("{INSTRUCTIONS}: {line}{found}"))
    }

    /// The cost of a decision without an event.
    fn rule(&self, rule: Rule) -> Result<f64> {
        match rule {
            Rule::Window(width) => self.of("decision", &format!("window of {width}; no event")),
            Rule::Average => self.of("decision", "average; no event"),
            _ => self.of("decision", "kept peak; no event"),
        }
    }

    /// The cost of a depth, for a pulse of `sigma` bins.
    fn estimator(&self, estimator: Estimator, sigma: f64) -> Result<f64> {
        let centred = |sigma: f64| {
            // The next wider pulse with a count.
            let counted = [0.4, 0.5, 1.0].into_iter().find(|&of| sigma <= of);
            let variant = format!("centred window, σ {}", counted.unwrap_or(1.5));
            self.of("depth", &variant)
        };
        match estimator {
            Estimator::HighestBin => Ok(0.0),
            Estimator::Paper | Estimator::CentreOfMass3 => self.of("depth", "centroid"),
            Estimator::CentredWindow(sigma) => centred(sigma),
            Estimator::OwnWindow => centred(sigma),
        }
    }
}

/// A method: its cost, and its results over several scenes.
struct Entry {
    label: String,
    pen: Pen,
    cost: f64,
    /// The mean ratio of time or error to the reference over the scenes. The interval is the mean
    /// of the intervals, because their errors may be correlated.
    mean: Measured,
    /// From the best scene to the worst.
    range: (f64, f64),
}

impl Entry {
    fn new(label: String, pen: Pen, cost: f64, scenes: &[Measured]) -> Self {
        let mean = |of: fn(&Measured) -> f64| {
            scenes.iter().map(of).sum::<f64>() / scenes.len().max(1) as f64
        };
        Self {
            label,
            pen,
            cost,
            mean: Measured {
                value: mean(|scene| scene.value),
                interval: (
                    mean(|scene| scene.interval.0),
                    mean(|scene| scene.interval.1),
                ),
            },
            range: ends(scenes.iter().map(|scene| scene.value)),
        }
    }
}

/// The entry with the smallest mean.
fn best(entries: &[Entry]) -> Result<&Entry> {
    let by_mean = |a: &&Entry, b: &&Entry| a.mean.value.total_cmp(&b.mean.value);
    entries.iter().min_by(by_mean).context("no methods")
}

/// The cheapest entry whose interval ends within [`MARGIN`] of the best mean; otherwise the best.
fn chosen(entries: &[Entry]) -> Result<&Entry> {
    let best = best(entries)?;
    let limit = best.mean.value * (1.0 + MARGIN);
    let good = entries
        .iter()
        .filter(|entry| entry.mean.interval.1 <= limit);
    let cheapest = good.min_by(|a, b| a.cost.total_cmp(&b.cost));
    Ok(cheapest.unwrap_or(best))
}

/// The Pareto frontier, by cost: entries without another that is both cheaper and better.
fn frontier(entries: &[Entry]) -> Vec<Dot> {
    let mut by_cost: Vec<&Entry> = entries.iter().collect();
    by_cost.sort_by(|a, b| {
        a.cost
            .total_cmp(&b.cost)
            .then(a.mean.value.total_cmp(&b.mean.value))
    });
    let mut dots: Vec<Dot> = Vec::new();
    for entry in by_cost {
        let before = dots.last().map_or(f64::INFINITY, |dot| dot.y);
        if entry.mean.value < before {
            // A step: between two costs, the previous entry is the best.
            if let Some(last) = dots.last().copied() {
                dots.push(Dot::exact(entry.cost, last.y));
            }
            dots.push(Dot::exact(entry.cost, entry.mean.value));
        }
    }
    dots
}

/// The chart of results against cost.
fn against_cost(
    finding: String,
    holds: bool,
    y: Axis,
    note: &str,
    entries: &[Entry],
) -> Result<String> {
    ensure!(holds, "the data no longer show: {finding}");
    let frontier = frontier(entries);
    let mut series = vec![Series::unnamed(palette::REFERENCE, Style::Dashed, frontier)];
    series.extend(entries.iter().map(|entry| {
        let dot = Dot {
            x: entry.cost,
            y: entry.mean.value,
            interval: Some(entry.range),
        };
        // The note of the chart names the parts left out here.
        let mut name = entry.label.clone();
        for (long, short) in [
            ("centred window for ", ""),
            ("window of ", ""),
            ("the paper's rule", "paper's"),
            ("average of all bins", "average"),
            ("centred window", "centred"),
        ] {
            name = name.replace(long, short);
        }
        Series::named(name, entry.pen, Style::Dots, vec![dot])
    }));
    chart(&Chart {
        finding,
        holds,
        note: format!("{note} Dashed: nothing is both cheaper and better."),
        x: Axis::linear("instructions on a Cortex-M4F"),
        y,
        key: Vec::new(),
        columns: 1,
        panels: vec![Panel::only(series)],
    })
}

/// The mean of the entry `label`.
fn value(entries: &[Entry], label: &str) -> Result<f64> {
    let found = entries.iter().find(|entry| entry.label == label);
    let found = found.with_context(|| format!("no method {label}"))?;
    Ok(found.mean.value)
}

/// Every rule over the outcomes that `of` selects.
fn rules(
    counts: &Instructions,
    outcomes: &[DetectionOutcome],
    of: impl Fn(&DetectionOutcome) -> bool,
) -> Result<Vec<Entry>> {
    let entry = |rule: Rule| {
        let those = outcomes
            .iter()
            .filter(|outcome| outcome.rule == rule && of(outcome));
        // The uncertainty of the likelihood ratio is left out: it is the same for all rules.
        let ratios = those.map(|outcome| {
            let one = outcome.ratio.value / outcome.cycles.value;
            outcome.cycles.times(one)
        });
        let ratios: Vec<Measured> = ratios.collect();
        let cost = counts.rule(rule)?;
        Ok(Entry::new(rule.label(), rule.pen(), cost, &ratios))
    };
    Rule::RULES.into_iter().map(entry).collect()
}

/// The best rule for each pulse.
const SUITED: &str = "best for the pulse";

/// The fastest rule for each pulse, over its scenes.
fn suited(counts: &Instructions, outcomes: &[DetectionOutcome]) -> Result<Entry> {
    let (mut ratios, mut cost) = (Vec::new(), 0.0f64);
    for sigma in time_to_detect::SIGMAS {
        let entries = rules(counts, outcomes, |outcome| outcome.sigma == sigma)?;
        let fastest = best(&entries)?;
        cost = cost.max(fastest.cost);
        let those = outcomes
            .iter()
            .filter(|outcome| outcome.sigma == sigma && outcome.rule.label() == fastest.label);
        ratios.extend(those.map(|outcome| outcome.ratio));
    }
    let (label, pen) = (SUITED.to_owned(), palette::NEUTRAL);
    Ok(Entry::new(label, pen, cost, &ratios))
}

/// Every estimator over the points that `of` selects.
fn estimators(
    counts: &Instructions,
    part: &Part,
    of: impl Fn(&PointTally) -> bool,
) -> Result<Vec<Entry>> {
    let entry = |(estimator, name): (Estimator, &str)| {
        let (mut ratios, mut cost) = (Vec::new(), 0.0f64);
        for point in part.points().iter().filter(|&point| of(point)) {
            cost = cost.max(counts.estimator(estimator, point.parameter("sigma"))?);
            ratios.push(depth_error::over_bound(point, name));
        }
        let (label, pen) = (estimator.label(), estimator.pen());
        Ok(Entry::new(label, pen, cost, &ratios))
    };
    Estimator::ALL.into_iter().map(entry).collect()
}

/// The documents below `docs`: the table and its figures.
///
/// # Errors
/// Fails if an instruction count is missing, the file of recorded photons has another format, or the
/// data no longer support a title.
pub fn documents(
    instructions: &str,
    recorded_rules: &str,
    time: &Part,
    depth: &Part,
    events: &Part,
    dither: &Part,
) -> Result<Vec<(PathBuf, String)>> {
    let counts = Instructions(instructions);
    let outcomes = time_to_detect::outcomes(time);
    let photon = counts.of("photon", "AsyncPixel::count_batch")?;
    let mut all_rules = rules(&counts, &outcomes, |_| true)?;
    all_rules.push(suited(&counts, &outcomes)?);
    let all_estimators = estimators(&counts, depth, |_| true)?;
    let recorded = recorded(&counts, recorded_rules)?;
    let suits = value(&all_rules, SUITED)?;
    let papers = value(&all_rules, &Rule::Paper.label())?;
    let decision_svg = against_cost(
        format!(
            "A window that suits the pulse reports {:.1} times sooner than the paper's rule",
            papers / suits
        ),
        papers > 1.5 * suits,
        Axis::logarithmic("laser cycles to an event over the likelihood ratio's"),
        "Dots are means over all scenes, bars go from the best scene to the worst. Windows have their width as a name.",
        &all_rules,
    )?;
    let own = value(&all_estimators, &Estimator::OwnWindow.label())?;
    let papers = value(&all_estimators, &Estimator::Paper.label())?;
    let depth_svg = against_cost(
        format!(
            "A centred window for the pulse takes the depth error from {papers:.1} times the bound to {own:.2}"
        ),
        own < papers / 1.5,
        Axis::logarithmic("root mean square depth error over the Cramér-Rao bound"),
        "Dots are means over all scenes, bars go from the best scene to the worst. σ: centred windows for such a pulse.",
        &all_estimators,
    )?;
    let of = |estimator| value(&recorded, &format!("{}, {estimator}", Rule::Paper.label()));
    let mass = of("centroid")?;
    let gain = 1.0 - of("centred window")? / mass;
    let skew = 1.0 - of("skew")? / mass;
    let recorded_svg = against_cost(
        format!(
            "On recorded photons a centred window lowers the error by {:.0} %, a skew one by {:.0} %",
            gain * 100.0,
            skew * 100.0
        ),
        gain > 0.1 && skew > gain,
        Axis::linear("depth error of recorded photons, mm"),
        "Dots are medians, bars end where 95 % of the errors are smaller. Windows have their width as a name.",
        &recorded,
    )?;
    let (worst, elsewhere) = depth_error::elsewhere(depth)?;
    let mut values = Values::from([
        ("margin", format!("{:.0}", MARGIN * 100.0)),
        ("photon", format!("{photon:.1}")),
        ("elsewhere", format!("{:.1}", elsewhere * 100.0)),
        ("rules", tables::rules(&counts, &outcomes)?),
        ("estimators", tables::estimators(&all_estimators)),
        ("depths", tables::depths(&counts, depth)?),
    ]);
    for name in ["sigma", "signal", "background"] {
        values.set(name, worst.parameter(name));
    }
    events::section(&mut values, events)?;
    other_lidar::section(&mut values, dither)?;
    let text = values.fill(include_str!("methods.md"))?;
    Ok(vec![
        ("figures/cost-time-to-detect.svg".into(), decision_svg),
        ("figures/cost-depth-error.svg".into(), depth_svg),
        ("figures/cost-recorded.svg".into(), recorded_svg),
        ("results/methods.md".into(), text),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With an interval of 0.02 to either side.
    fn entry(cost: f64, value: f64) -> Entry {
        let interval = (value - 0.02, value + 0.02);
        let scene = Measured { value, interval };
        Entry::new(format!("{cost}"), palette::NEUTRAL, cost, &[scene])
    }

    #[test]
    fn the_frontier_is_what_nothing_beats() {
        let entries = [
            (300.0, 1.0),
            (100.0, 2.0),
            (200.0, 2.1),
            (250.0, 1.5),
            (250.0, 1.7),
        ]
        .map(|(cost, mean)| entry(cost, mean));
        let found = frontier(&entries).into_iter().map(|dot| (dot.x, dot.y));
        let expected = [
            (100.0, 2.0),
            (250.0, 2.0),
            (250.0, 1.5),
            (300.0, 1.5),
            (300.0, 1.0),
        ];
        assert!(found.eq(expected));
    }

    /// Intervals end at 1.02 times the mean: the interval of 1.078 ends a tenth above the best.
    #[test]
    fn the_cheapest_that_is_surely_within_the_margin_is_chosen() {
        let chosen = |second: f64| {
            let entries = [(300.0, 1.0), (100.0, 1.2), (200.0, second)];
            let entries = entries.map(|(cost, mean)| entry(cost, mean));
            chosen(&entries).unwrap().label.clone()
        };
        assert_eq!([1.077, 1.081].map(chosen), ["200", "300"]);
    }

    #[test]
    fn a_count_is_found_by_its_name() {
        let counts =
            Instructions("operation,variant,opt,instructions\na,b; c,3,12.5\na,b; c,s,9\n");
        assert_eq!(counts.of("a", "b; c").unwrap(), 12.5);
        let error = counts.of("a", "b").unwrap_err().to_string();
        assert_eq!(error, "results/bench/instructions.csv: no `a,b,3,`");
    }
}
