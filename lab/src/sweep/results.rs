//! What a study comes to: figures, and verdicts on what the paper claims.

use super::mean::Measured;
use super::values::Values;
use super::{Part, PointTally};
use anyhow::{Context, Result};
use dtof_draw::chart::{self, Chart};
use dtof_theory::counts::poisson::Poisson;
use std::fmt;

/// What can be said from all trials of a study.
#[derive(Clone, Debug, Default)]
pub struct Results {
    /// In the order they are shown.
    pub figures: Vec<Figure>,
    /// In the order of the paper.
    pub claims: Vec<Claim>,
    /// What the pages say of it beside these.
    pub values: Values,
    /// Numbers for programs: files as seen from `docs`, and their content.
    pub tables: Vec<(&'static str, String)>,
}

/// A picture and what it shows.
#[derive(Clone, Debug)]
pub struct Figure {
    /// The file's name, without its extension.
    pub name: &'static str,
    /// Whether the data show what its title says.
    pub holds: bool,
    /// An SVG document.
    pub svg: String,
}

impl Figure {
    /// Draws `chart`.
    ///
    /// # Errors
    /// If there is nothing to draw.
    pub fn new(name: &'static str, chart: &Chart) -> Result<Self> {
        Ok(Self {
            name,
            holds: chart.holds,
            svg: chart::chart(chart)?,
        })
    }
}

/// Something the paper says, and whether it is so. The page of claims has the rest.
#[derive(Clone, Debug)]
pub struct Claim {
    /// Its name in the page.
    pub name: &'static str,
    /// Our figure or number, with its interval or sample size.
    pub here: String,
    /// Whether it goes together with the paper's.
    pub verdict: Verdict,
}

impl Claim {
    /// The claim of this name.
    #[must_use]
    pub fn new(name: &'static str, here: impl Into<String>, verdict: Verdict) -> Self {
        Self {
            name,
            here: here.into(),
            verdict,
        }
    }
}

/// How a claim fares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is so here as well.
    Agrees,
    /// In part, or by another number.
    Differs,
    /// It is not so.
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

    /// [`Self::Agrees`] or else [`Self::Differs`] if what they ask for holds.
    #[must_use]
    pub const fn graded(agrees: bool, differs: bool) -> Self {
        match (agrees, differs) {
            (true, _) => Self::Agrees,
            (_, true) => Self::Differs,
            _ => Self::Refuted,
        }
    }

    /// The same as an answer to a question.
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

/// The least and the greatest of values from 0 on.
#[must_use]
pub fn ends(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    let ends = (f64::INFINITY, 0.0f64);
    let values = values.into_iter();
    values.fold(ends, |(low, high), value| (value.min(low), value.max(high)))
}

/// Shares beside what was predicted for them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Comparison {
    /// How many were compared.
    pub points: u32,
    /// How many predictions lie outside the share's 99 % interval.
    pub outside: u32,
    /// The largest difference.
    pub largest: f64,
}

impl Comparison {
    /// Of shares with the probabilities predicted.
    #[must_use]
    pub fn of(pairs: impl IntoIterator<Item = (Measured, f64)>) -> Self {
        let mut comparison = Self::default();
        for (share, predicted) in pairs {
            comparison.points += 1;
            comparison.outside += u32::from(!share.holds(predicted));
            comparison.largest = comparison.largest.max((share.value - predicted).abs());
        }
        comparison
    }

    /// Whether right predictions lie outside as often, or more often, in more than
    /// one of a thousand studies: one interval in a hundred is wrong.
    #[must_use]
    pub fn is_chance(&self) -> bool {
        Poisson::new(f64::from(self.points) / 100.0).at_least(self.outside) > 1e-3
    }
}

impl PointTally {
    /// How many of `trials` were `successes`, both names of counts.
    #[must_use]
    pub fn share(&self, successes: &str, trials: &str) -> Measured {
        Measured::share(self.count(successes), self.count(trials))
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

    /// The point with these parameters.
    ///
    /// # Errors
    /// If there is none.
    pub fn one<const N: usize>(&self, parameters: [(&str, f64); N]) -> Result<&PointTally> {
        let found = self.points().iter().find(|point| point.is_at(parameters));
        found.with_context(|| format!("{}: no point {parameters:?}", self.study()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From the sums of binomial terms, for 10 of 100.
    #[test]
    fn the_interval_is_exact() {
        let share = Measured::share(10, 100);
        assert!((share.value - 0.1).abs() < 1e-15);
        assert!((share.interval.0 - 0.03820).abs() < 1e-5);
        assert!((share.interval.1 - 0.20195).abs() < 1e-5);
        assert!(share.holds(0.1) && !share.holds(0.03) && !share.holds(0.21));
        // No success is no proof that there is none.
        assert!(Measured::share(0, 100).holds(0.05) && Measured::share(100, 100).holds(0.95));
        assert!(!Measured::share(0, 100).holds(0.053));
    }

    /// However rare the event, the interval misses the probability in at most 1 % of
    /// studies.
    #[test]
    fn the_interval_holds_99_percent_of_rare_events() {
        let trials = 2000u32;
        for mean in [0.01, 0.05, 0.1, 0.5, 2.0, 7.0] {
            let probability = mean / f64::from(trials);
            let law = Poisson::new(mean);
            let missed = (0..60)
                .filter(|&count| !Measured::share(count.into(), trials.into()).holds(probability))
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
