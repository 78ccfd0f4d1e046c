//! Which method for which scene: what the studies of time and error found, against
//! the instructions it takes.

mod recorded;

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::{Context, Result};

pub use self::recorded::RECORDED;
use self::recorded::recorded;

use crate::chart::{Axis, Chart, Point as Dot, Series, Style, line_chart};
use crate::sweep::Part;
use crate::sweep::studies::depth_error::{self, Method as Estimator};
use crate::sweep::studies::passage::Method as Rule;
use crate::sweep::studies::time_to_detect::{self, Outcome};

/// The instruction counts, below the documentation.
pub const INSTRUCTIONS: &str = "bench/instructions.csv";
/// The cheapest method no more than this share above the best is chosen.
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

    /// A decision without an event.
    fn rule(&self, rule: Rule) -> Result<f64> {
        match rule {
            Rule::Window(width) => self.of("decision", &format!("window of {width}; no event")),
            _ => self.of("decision", "kept peak; no event"),
        }
    }

    /// A depth, for a pulse of `sigma` bins.
    fn estimator(&self, estimator: Estimator, sigma: f64) -> Result<f64> {
        let centred = |sigma: f64| {
            // The next wider pulse that was counted.
            let counted = [0.4, 0.5, 1.0]
                .into_iter()
                .find(|&counted| sigma <= counted);
            self.of(
                "depth",
                &format!("centred window, σ {}", counted.unwrap_or(1.5)),
            )
        };
        match estimator {
            Estimator::HighestBin => Ok(0.0),
            Estimator::Paper | Estimator::CentreOfMass3 => self.of("depth", "centre_of_mass"),
            Estimator::CentredWindow(sigma) => centred(sigma),
            Estimator::OwnWindow => centred(sigma),
        }
    }
}

/// A method: what it costs, and how it does over several scenes.
struct Entry {
    label: String,
    cost: f64,
    /// Time or error over the reference's: mean, least, largest.
    mean: f64,
    range: (f64, f64),
}

impl Entry {
    #[allow(clippy::cast_precision_loss, reason = "a few scenes")]
    fn new(label: String, cost: f64, ratios: &[f64]) -> Self {
        let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = ratios.iter().copied().fold(0.0, f64::max);
        Self {
            label,
            cost,
            mean: ratios.iter().sum::<f64>() / ratios.len().max(1) as f64,
            range: (least, largest),
        }
    }
}

/// The chosen: the cheapest within [`MARGIN`] of the best.
fn chosen(entries: &[Entry]) -> Result<&Entry> {
    let best = entries
        .iter()
        .map(|entry| entry.mean)
        .fold(f64::INFINITY, f64::min);
    let good = entries
        .iter()
        .filter(|entry| entry.mean <= best * (1.0 + MARGIN));
    good.min_by(|a, b| a.cost.total_cmp(&b.cost))
        .context("no methods")
}

/// Those that no other is both cheaper and better than, by cost.
fn frontier(entries: &[Entry]) -> Vec<Dot> {
    let mut by_cost: Vec<&Entry> = entries.iter().collect();
    by_cost.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(a.mean.total_cmp(&b.mean)));
    let mut dots: Vec<Dot> = Vec::new();
    for entry in by_cost {
        let before = dots.last().map_or(f64::INFINITY, |dot| dot.y);
        if entry.mean < before {
            // A step: what costs less than this does no better than the one before.
            if let Some(last) = dots.last().copied() {
                dots.push(Dot::exact(entry.cost, last.y));
            }
            dots.push(Dot::exact(entry.cost, entry.mean));
        }
    }
    dots
}

fn chart(title: &str, y: Axis, entries: &[Entry]) -> Result<String> {
    let mut series = vec![Series {
        name: Some("frontier".to_owned()),
        colour: 6,
        style: Style::Thin,
        points: frontier(entries),
    }];
    for (colour, entry) in entries.iter().enumerate() {
        series.push(Series {
            name: Some(entry.label.clone()),
            colour,
            style: Style::Dots,
            points: vec![Dot {
                x: entry.cost,
                y: entry.mean,
                interval: Some(entry.range),
            }],
        });
    }
    let dearest = entries.iter().map(|entry| entry.cost).fold(0.0, f64::max);
    line_chart(&Chart {
        title,
        x: Axis {
            range: Some((0.0, dearest * 2.2)),
            ..Axis::linear("instructions on a Cortex-M4F")
        },
        y,
        series,
    })
}

/// Every rule over the outcomes that `of` takes.
fn rules(
    counts: &Instructions,
    outcomes: &[Outcome],
    of: impl Fn(&Outcome) -> bool,
) -> Result<Vec<Entry>> {
    let entry = |rule: Rule| {
        let those = outcomes
            .iter()
            .filter(|outcome| outcome.method == rule && of(outcome));
        let ratios: Vec<f64> = those.map(|outcome| outcome.ratio).collect();
        Ok(Entry::new(rule.label(), counts.rule(rule)?, &ratios))
    };
    Rule::RULES.into_iter().map(entry).collect()
}

/// For each pulse the rule that is fastest over its scenes.
#[allow(clippy::float_cmp, reason = "parameters are as they were written")]
fn suited(counts: &Instructions, outcomes: &[Outcome]) -> Result<Entry> {
    let (mut ratios, mut cost) = (Vec::new(), 0.0f64);
    for sigma in time_to_detect::SIGMAS {
        let entries = rules(counts, outcomes, |outcome| outcome.sigma == sigma)?;
        let fastest = entries.iter().min_by(|a, b| a.mean.total_cmp(&b.mean));
        let fastest = fastest.context("no rules")?;
        cost = cost.max(fastest.cost);
        let those = outcomes
            .iter()
            .filter(|outcome| outcome.sigma == sigma && outcome.method.label() == fastest.label);
        ratios.extend(those.map(|outcome| outcome.ratio));
    }
    Ok(Entry::new(
        "the window that suits the pulse".to_owned(),
        cost,
        &ratios,
    ))
}

/// Every estimator over the points of these pulses and signals.
fn estimators(
    counts: &Instructions,
    part: &Part,
    sigmas: &[f64],
    signals: &[f64],
) -> Result<Vec<Entry>> {
    let entry = |(estimator, name): (Estimator, &str)| {
        let (mut ratios, mut cost) = (Vec::new(), 0.0f64);
        for &sigma in sigmas {
            cost = cost.max(counts.estimator(estimator, sigma)?);
            for &signal in signals {
                let points = part.at([("sigma", sigma), ("signal", signal)]);
                ratios.extend(points.map(|point| depth_error::over_bound(point, name)));
            }
        }
        Ok(Entry::new(estimator.label(), cost, &ratios))
    };
    Estimator::ALL.into_iter().map(entry).collect()
}

/// The documents, below `docs`: the table and its figures.
///
/// # Errors
/// If an operation was not counted, a part is not the study's, or the file of recorded
/// photons has another form.
pub fn documents(
    instructions: &str,
    recorded_rules: &str,
    time: &Part,
    depth: &Part,
) -> Result<Vec<(PathBuf, String)>> {
    let counts = Instructions(instructions);
    let outcomes = time_to_detect::outcomes(time)?;
    let photon = counts.of("photon", "AsyncPixel::count_batch")?;
    let mut all_rules = rules(&counts, &outcomes, |_| true)?;
    all_rules.push(suited(&counts, &outcomes)?);
    let all_estimators = estimators(&counts, depth, &depth_error::SIGMAS, &depth_error::SIGNALS)?;
    let decision_svg = chart(
        "A decision: its cost against the time to an event",
        Axis::logarithmic("laser cycles over the likelihood ratio's"),
        &all_rules,
    )?;
    let depth_svg = chart(
        "A depth: its cost against its error",
        Axis::logarithmic("root mean square error over the Cramér-Rao bound"),
        &all_estimators,
    )?;
    let recorded_svg = chart(
        "Recorded photons: cost of a decision and a depth against its error",
        Axis::linear("millimetres: median error, line to 95 %"),
        &recorded(&counts, recorded_rules)?,
    )?;
    let mut text = format!(
        "# Which method for which scene\n\n\
         Made by `cargo xtask figures` from the studies `time-to-detect` and `depth-error` and from the\n\
         [instruction counts](bench/README.md); do not edit. The tables name the cheapest method that is no more than\n\
         {:.0} % above the best one.\n\n\
         ## What it costs\n\n\
         A photon takes {photon:.1} instructions whatever the method. A dot is the mean over all scenes of the studies,\n\
         its bar from the best scene to the worst; the line is the frontier, methods that no other is both cheaper and\n\
         better than.\n\n\
         ![Cost of a decision against time to an event](figures/cost-time-to-detect.svg)\n\n\
         ![Cost of a depth against its error](figures/cost-depth-error.svg)\n\n\
         On recorded photons, all rules set to one false event in 100 exposures, and the minimum count of window rules\n\
         so that they take no more photons an event than the paper's ([all rows](figures/data/recorded_rules.csv), made by the\n\
         test `recorded_rules`):\n\n\
         ![Recorded photons: cost against error](figures/cost-recorded.svg)\n\n",
        MARGIN * 100.0
    );
    decision_table(&mut text, &counts, &outcomes)?;
    depth_table(&mut text, &counts, depth)?;
    Ok(vec![
        ("figures/cost-time-to-detect.svg".into(), decision_svg),
        ("figures/cost-depth-error.svg".into(), depth_svg),
        ("figures/cost-recorded.svg".into(), recorded_svg),
        ("methods.md".into(), text),
    ])
}

/// For each pulse and background.
#[allow(clippy::float_cmp, reason = "parameters are as they were written")]
fn decision_table(text: &mut String, counts: &Instructions, outcomes: &[Outcome]) -> Result<()> {
    text.push_str(
        "## Which rule\n\n\
         By the standard deviation of the pulse and the background. Times are means over a pulse in the middle of its\n\
         bin and on an edge, with 1 % false events in 1000 laser cycles, over those of the likelihood ratio that knows\n\
         the scene.\n\n\
         | pulse σ, bins | background a bin and cycle | rule | α or z | time | instructions | the paper's rule: time |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for sigma in time_to_detect::SIGMAS {
        for background in time_to_detect::BACKGROUNDS {
            let is_here =
                |outcome: &Outcome| outcome.sigma == sigma && outcome.background == background;
            let entries = rules(counts, outcomes, is_here)?;
            let chosen = chosen(&entries)?;
            let paper = entries.first().context("no rules")?;
            let of_chosen =
                |outcome: &&Outcome| is_here(outcome) && outcome.method.label() == chosen.label;
            let threshold = outcomes
                .iter()
                .find(of_chosen)
                .map_or(0.0, |outcome| outcome.threshold);
            writeln!(
                text,
                "| {sigma} | {background} | {} | {threshold:.2} | {:.2} | {:.0} | {:.2} |",
                chosen.label, chosen.mean, chosen.cost, paper.mean
            )?;
        }
    }
    Ok(())
}

/// For each pulse and number of signal photons.
fn depth_table(text: &mut String, counts: &Instructions, part: &Part) -> Result<()> {
    text.push_str(
        "\n## Which depth estimator\n\n\
         By the standard deviation of the pulse and the signal photons of an event. Errors are means over backgrounds of\n\
         0.5 to 5 counts a bin, over the Cramér-Rao bound. The background is the mean that a window rule gives; the paper's is\n\
         from its quadrants.\n\n\
         | pulse σ, bins | signal photons | estimator | error | instructions | the paper's: error |\n\
         |---|---|---|---|---|---|\n",
    );
    for sigma in depth_error::SIGMAS {
        for signal in depth_error::SIGNALS {
            let all = estimators(counts, part, &[sigma], &[signal])?;
            let (papers, others): (Vec<_>, _) = all
                .into_iter()
                .partition(|entry| entry.label == Estimator::Paper.label());
            let paper = papers.first().context("no estimators")?;
            let chosen = chosen(&others)?;
            writeln!(
                text,
                "| {sigma} | {signal} | {} | {:.2} | {:.0} | {:.2} |",
                chosen.label, chosen.mean, chosen.cost, paper.mean
            )?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(cost: f64, mean: f64) -> Entry {
        Entry::new(format!("{cost}"), cost, &[mean])
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
        let found: Vec<(f64, f64)> = frontier(&entries)
            .iter()
            .map(|dot| (dot.x, dot.y))
            .collect();
        let expected = [
            (100.0, 2.0),
            (250.0, 2.0),
            (250.0, 1.5),
            (300.0, 1.5),
            (300.0, 1.0),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn the_cheapest_within_the_margin_is_chosen() {
        let entries =
            [(300.0, 1.0), (100.0, 1.2), (200.0, 1.09)].map(|(cost, mean)| entry(cost, mean));
        assert_eq!(chosen(&entries).unwrap().label, "200");
    }

    #[test]
    fn a_count_is_found_by_its_name() {
        let counts =
            Instructions("operation,variant,opt,instructions\na,b; c,3,12.5\na,b; c,s,9\n");
        assert_eq!(counts.of("a", "b; c").unwrap(), 12.5);
        let error = counts.of("a", "b").unwrap_err().to_string();
        assert_eq!(error, "bench/instructions.csv: no `a,b,3,`");
    }
}
