//! The cost of methods against their error on recorded photons.

use anyhow::{Context, Result, bail};

use super::{Entry, Estimator, Instructions, Rule};
use crate::sweep::mean::Measured;

/// The results of the rules on recorded photons, relative to the documentation.
/// `lab/tests/recorded_rules.rs` makes the file from the public capture log.
pub const RECORDED: &str = "results/data/recorded_rules.csv";

/// The variant of the window with two half widths.
const SKEW: &str = "centred window, 1.75 before and 4 after";

/// The methods on recorded photons at equal rates of false alarms, without added background: the
/// paper's rule, and window rules with as many photons per event.
pub(super) fn recorded(counts: &Instructions, csv: &str) -> Result<Vec<Entry>> {
    let mut entries = Vec::new();
    for line in csv.lines().filter(|line| line.starts_with("0,")) {
        let cells: Vec<&str> = line.split(',').collect();
        let [
            _,
            rule,
            _,
            minimum,
            _,
            estimator,
            _,
            _,
            median,
            within_95,
            ..,
        ] = cells[..]
        else {
            bail!("{RECORDED}: {line}");
        };
        let found = Rule::RULES.into_iter().find(|found| found.label() == rule);
        let rule = found.with_context(|| format!("{RECORDED}: {line}"))?;
        // Window rules with the default minimum need fewer photons, and have larger errors.
        if matches!(rule, Rule::Window(_)) && minimum == "5" {
            continue;
        }
        // Two rules with a skew window are enough for the chart.
        if estimator == "skew window" && !matches!(rule, Rule::Paper | Rule::Window(3)) {
            continue;
        }
        let (depth, estimator) = match estimator {
            "centred window" => (
                counts.estimator(Estimator::CentredWindow(1.0), 1.0)?,
                estimator,
            ),
            "skew window" => (counts.of("depth", SKEW)?, "skew"),
            _ => (counts.estimator(Estimator::Paper, 1.0)?, "centroid"),
        };
        let number = |text: &str| text.parse::<f64>().with_context(|| line.to_owned());
        let median = number(median)?;
        entries.push(Entry {
            label: format!("{}, {estimator}", rule.label()),
            pen: rule.pen(),
            cost: counts.rule(rule)? + depth,
            // There is no confidence interval.
            mean: Measured {
                value: median,
                interval: (median, median),
            },
            range: (median, number(within_95)?),
        });
    }
    Ok(entries)
}
