//! The results of a study: figures, and verdicts on the paper's claims.

use super::mean::Measured;
use super::values::Values;
use super::{Part, PointTally};
use anyhow::Result;
use dtof_draw::chart::{self, Chart};
use dtof_light::counts::poisson::Poisson;
use std::fmt;

/// The results from all trials of a study.
#[derive(Clone, Debug, Default)]
pub struct Results {
    /// Figures in the order of the page.
    pub figures: Vec<Figure>,
    /// Claims in the order of the paper.
    pub claims: Vec<Claim>,
    /// Further values for the pages.
    pub values: Values,
    /// Tables for programs: paths relative to `docs`, and their content.
    pub tables: Vec<(&'static str, String)>,
}

/// A picture.
#[derive(Clone, Debug)]
pub struct Figure {
    /// The file name without its extension.
    pub name: &'static str,
    /// Whether the data support the finding in its title.
    pub holds: bool,
    /// An SVG document.
    pub svg: String,
}

impl Figure {
    /// Draws `chart`.
    ///
    /// # Errors
    /// Fails if there is nothing to draw.
    pub fn new(name: &'static str, chart: &Chart) -> Result<Self> {
        Ok(Self {
            name,
            holds: chart.holds,
            svg: chart::chart(chart)?,
        })
    }
}

/// A claim of the paper with its verdict. The page of claims has its text.
#[derive(Clone, Debug)]
pub struct Claim {
    /// Its name in the page.
    pub name: &'static str,
    /// The result of this study: at most 40 words.
    pub here: String,
    /// All numbers, if `here` does not have them.
    pub details: String,
    /// Whether the result agrees with the paper's claim.
    pub verdict: Verdict,
}

impl Claim {
    /// The claim of this name.
    #[must_use]
    pub fn new(name: &'static str, here: impl Into<String>, verdict: Verdict) -> Self {
        Self {
            name,
            here: here.into(),
            details: String::new(),
            verdict,
        }
    }

    /// The claim with all its numbers.
    #[must_use]
    pub fn with_details(mut self, details: impl Into<String>) -> Self {
        self.details = details.into();
        self
    }
}

/// The verdict on a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The claim holds here as well.
    Agrees,
    /// The claim holds in part, or with another number.
    Differs,
    /// The claim does not hold.
    Refuted,
    /// The sample is too small to tell.
    NotDecided,
}

impl Verdict {
    /// [`Self::Agrees`] or [`Self::Refuted`].
    #[must_use]
    pub const fn of(holds: bool) -> Self {
        Self::graded(holds, false)
    }

    /// [`Self::Agrees`] or else [`Self::Differs`] if its condition holds, otherwise
    /// [`Self::Refuted`].
    #[must_use]
    pub const fn graded(agrees: bool, differs: bool) -> Self {
        match (agrees, differs) {
            (true, _) => Self::Agrees,
            (_, true) => Self::Differs,
            _ => Self::Refuted,
        }
    }

    /// The verdict as an answer to a question.
    #[must_use]
    pub const fn answer(self) -> &'static str {
        match self {
            Self::Agrees => "yes",
            Self::Differs => "in part",
            Self::Refuted => "no",
            Self::NotDecided => "not decided",
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Agrees => "agrees",
            Self::Differs => "differs",
            Self::Refuted => "refuted",
            Self::NotDecided => "not decided",
        })
    }
}

/// The smallest and the largest of values that are not negative.
#[must_use]
pub fn ends(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    let ends = (f64::INFINITY, 0.0f64);
    let values = values.into_iter();
    values.fold(ends, |(low, high), value| (value.min(low), value.max(high)))
}

/// The smallest and the largest of the numbers as text, "none" without a number.
#[must_use]
pub fn span(values: impl IntoIterator<Item = f64>, digits: usize) -> String {
    let mut values: Vec<f64> = values.into_iter().filter(|at| at.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let ends = [values.first(), values.last()].map(|end| end.map(|end| format!("{end:.digits$}")));
    match ends {
        [Some(low), Some(high)] if low != high => format!("{low} to {high}"),
        [Some(low), _] => low,
        _ => "none".to_owned(),
    }
}

/// Shares compared with predictions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Comparison {
    /// Number of comparisons.
    pub points: u32,
    /// Predictions outside the 99 % interval of the share.
    pub outside: u32,
    /// The largest difference.
    pub largest: f64,
}

impl Comparison {
    /// Compares shares with predicted probabilities.
    #[must_use]
    pub fn of(pairs: impl IntoIterator<Item = (Measured, f64)>) -> Self {
        let mut comparison = Self::default();
        for (share, predicted) in pairs {
            comparison.points += 1;
            comparison.outside += u32::from(!share.contains(predicted));
            comparison.largest = comparison.largest.max((share.value - predicted).abs());
        }
        comparison
    }

    /// Whether chance explains the predictions outside: correct predictions have as many in more
    /// than one of a thousand studies, because one interval in a hundred misses.
    #[must_use]
    pub fn is_chance(&self) -> bool {
        Poisson::new(f64::from(self.points) / 100.0).at_least(self.outside) > 1e-3
    }
}

impl PointTally {
    /// The share of `successes` in `trials`, both names of counts.
    #[must_use]
    pub fn share(&self, successes: &str, trials: &str) -> Measured {
        Measured::share(self.count(successes), self.count(trials))
    }

    /// These parameters as cells of a CSV table.
    #[must_use]
    pub fn parameter_cells<const N: usize>(&self, names: [&str; N]) -> String {
        let cells = names.map(|name| self.parameter(name).to_string());
        cells.join(",")
    }

    /// These counts as cells of a CSV table.
    #[must_use]
    pub fn count_cells<const N: usize>(&self, names: [&str; N]) -> String {
        let cells = names.map(|name| self.count(name).to_string());
        cells.join(",")
    }

    /// Whether the point has these parameters.
    #[must_use]
    pub fn is_at<const N: usize>(&self, parameters: [(&str, f64); N]) -> bool {
        let mut parameters = parameters.into_iter();
        parameters.all(|(name, value)| self.parameters.get(name) == Some(&value))
    }
}

impl Part {
    /// The points with these parameters, in the study's order.
    pub fn at<'a, const N: usize>(
        &'a self,
        parameters: [(&'a str, f64); N],
    ) -> impl Iterator<Item = &'a PointTally> + Clone {
        let points = self.points().iter();
        points.filter(move |point| point.is_at(parameters))
    }

    /// The point with these parameters, the first if there are several.
    ///
    /// # Panics
    /// If the study has no such point.
    #[must_use]
    pub fn one<const N: usize>(&self, parameters: [(&str, f64); N]) -> &PointTally {
        let found = self.points().iter().find(|point| point.is_at(parameters));
        found.unwrap_or_else(|| panic!("{}: no point {parameters:?}", self.study()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From sums of binomial terms, for 10 of 100.
    #[test]
    fn the_interval_is_exact() {
        let share = Measured::share(10, 100);
        assert!((share.value - 0.1).abs() < 1e-15);
        assert!((share.interval.0 - 0.03820).abs() < 1e-5);
        assert!((share.interval.1 - 0.20195).abs() < 1e-5);
        assert!(share.contains(0.1) && !share.contains(0.03) && !share.contains(0.21));
        // Zero successes do not prove a probability of zero.
        assert!(Measured::share(0, 100).contains(0.05) && Measured::share(100, 100).contains(0.95));
        assert!(!Measured::share(0, 100).contains(0.053));
    }

    /// The interval misses the probability in at most 1 % of studies, even for rare events.
    #[test]
    fn the_interval_holds_99_percent_of_rare_events() {
        let trials = 2000u32;
        for mean in [0.01, 0.05, 0.1, 0.5, 2.0, 7.0] {
            let probability = mean / f64::from(trials);
            let law = Poisson::new(mean);
            let missed = (0..60)
                .filter(|&count| {
                    !Measured::share(count.into(), trials.into()).contains(probability)
                })
                .map(|count| law.mass(count));
            // Poisson instead of binomial: a thousandth of 1 % off.
            assert!(missed.sum::<f64>() < 0.010_01, "{mean}");
        }
    }

    /// With 100 points one lies outside on average: P(≥ 6) = 6e-4, P(≥ 5) = 4e-3.
    #[test]
    fn a_few_points_lie_outside_by_chance() {
        let of = |outside: usize| {
            let predicted = |index| if index < outside { 0.9 } else { 0.5 };
            Comparison::of((0..100).map(|index| (Measured::share(50, 100), predicted(index))))
        };
        assert_eq!((of(5).points, of(5).outside, of(5).largest), (100, 5, 0.4));
        assert!(of(0).is_chance() && of(5).is_chance() && !of(6).is_chance());
    }
}
