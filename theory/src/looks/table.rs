//! False alarms of repeated looks, simulated once and interpolated.
//!
//! Were the looks of an exposure independent, a false alarm would have the
//! intensity `H = Σ −ln(1 − p_k)` over the exact single-look probabilities, and
//! the probability `1 − exp(−H)`. As they share photons, the simulated intensity is
//! lower. Its ratio to `H`, here the share, varies slowly, where the probability itself goes
//! over orders of magnitude and in steps (α meets an integer root): so the
//! share is what is interpolated, over the logarithms of the mean background at
//! the first look, of the first look, and of last over first look. Between two
//! α the larger share is taken.
//!
//! `theory/data/repeated_looks.csv` is made by `cargo lab figures`, from the study
//! `false-events`.

use std::fmt::Write;

use anyhow::{Context, Result, ensure};
use dtof_core::fixed::types::U8F8;
use dtof_core::{Count, Threshold};
use rayon::prelude::*;

use crate::counts::binomial;
use crate::looks::repeated_looks::{
    ALPHA_STEPS, BINS, FalseAlarms, MINIMUM_COUNT, Point, RepeatedLooks, alpha_bits, single_looks,
};
use crate::random::trial_rng;

/// Mean background photons a bin at the first look.
const FIRST_MEANS: [f64; 18] = [
    0.1, 0.2, 0.3, 0.4, 0.55, 0.8, 1.1, 1.6, 2.2, 3.0, 4.2, 6.0, 12.0, 25.0, 50.0, 100.0, 200.0,
    300.0,
];
/// The first look, in steps of X laser cycles.
const FIRSTS: [u32; 5] = [2, 5, 11, 33, 101];
/// Last look over first look.
const SPANS: [u32; 10] = [1, 2, 4, 8, 16, 32, 64, 128, 256, 512];
/// The highest last look.
const LAST: u32 = 1700;
/// The highest mean background at the last look: four times 400, as twice the mean
/// and twice the span must be in the table to interpolate. Counters fill up there, in the
/// simulation as in the exact law.
const HIGHEST_MEAN: f64 = 1700.0;
/// Fewer events say too little of their probability.
const FEWEST_EVENTS: u64 = 20;
/// Between its points an upper limit of the table may be too low by this factor,
/// no more (`host-tests/tests/simulations/theory_exposures.rs`).
pub const MARGIN: f64 = 1.4;
/// Above the upper limit of a simulated probability lie as many of its samples.
const UPPER_TAIL: f64 = 0.01;
/// Exposures of one trial.
const TRIAL: u32 = 500;

/// One simulated probability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Mean background photons a bin at the first look.
    pub first_mean: f64,
    /// The first look, in steps of X laser cycles.
    pub first: u32,
    /// The last look.
    pub last: u32,
    /// α in 1/256.
    pub alpha: u16,
    /// Exposures with a false alarm.
    pub events: u64,
    /// `H`, `independent` of [`Bounds`](crate::looks::repeated_looks::Bounds).
    pub intensity: f64,
}

/// All points that are simulated.
#[must_use]
pub fn points() -> Vec<Point> {
    let mut points = Vec::new();
    for first_mean in FIRST_MEANS {
        for first in FIRSTS {
            let spans = SPANS.into_iter().filter(|&span| {
                first * span <= LAST && first_mean * f64::from(span) <= HIGHEST_MEAN
            });
            points.push(Point {
                first_mean,
                first,
                lasts: spans.map(|span| first * span).collect(),
            });
        }
    }
    points
}

/// The grid in words: what a table says it was made for.
fn grid() -> String {
    let alphas: Vec<u16> = (0..ALPHA_STEPS).map(alpha_bits).collect();
    format!(
        "# grid first_mean {FIRST_MEANS:?} first_look {FIRSTS:?} span {SPANS:?} \
         last_look up to {LAST} last_mean up to {HIGHEST_MEAN} alpha_256 {alphas:?} \
         events from {FEWEST_EVENTS}"
    )
}

/// Simulates one point, in trials numbered from `first_trial`.
///
/// # Errors
/// If the point is not one, or there are too many trials.
pub fn simulate(seed: u64, first_trial: u16, point: &Point, trials: u16) -> Result<FalseAlarms> {
    let numbers = first_trial..first_trial.checked_add(trials).context("too many trials")?;
    let tallies: Vec<FalseAlarms> = numbers
        .into_par_iter()
        .map(|trial| FalseAlarms::trial(point, TRIAL, &mut trial_rng(seed, trial)))
        .collect::<Result<_>>()?;
    let mut sum = FalseAlarms::new(point.lasts.len());
    for tally in &tallies {
        sum += tally;
    }
    Ok(sum)
}

/// What is worth keeping of one point.
#[must_use]
pub fn rows(point: &Point, tally: &FalseAlarms) -> Vec<Row> {
    let Some(&last) = point.lasts.last() else {
        return Vec::new();
    };
    let bins = u32::try_from(BINS).unwrap_or(u32::MAX);
    let steps = single_looks(bins, point.first_mean / f64::from(point.first), last);
    let mut rows = Vec::new();
    for (&last, events) in point.lasts.iter().zip(&tally.events) {
        let looks = RepeatedLooks::new(&steps, point.first, last);
        for (step, &events) in (0..ALPHA_STEPS).zip(events) {
            let certain = events * 20 > tally.exposures * 19;
            if events < FEWEST_EVENTS || certain {
                continue;
            }
            let alpha = alpha_bits(step);
            let minimum_count = Count::saturating(MINIMUM_COUNT.into());
            let threshold = Threshold::new(U8F8::from_bits(alpha), minimum_count);
            rows.push(Row {
                first_mean: point.first_mean,
                first: point.first,
                last,
                alpha,
                events,
                intensity: looks.bounds(&threshold).independent,
            });
        }
    }
    rows
}

/// The table of points and their tallies, all of as many exposures, as CSV.
///
/// # Errors
/// If there is no point.
pub fn csv(tallies: &[(Point, FalseAlarms)]) -> Result<String> {
    let (_, first) = tallies.first().context("no points")?;
    let mut text = format!(
        "# False events of repeated looks: {BINS} bins, minimum count {MINIMUM_COUNT}, \
         made by: dtof figures\n{}\n# exposures {}\n\
         first_mean,first_look,last_look,alpha_256,events,independent_intensity\n",
        grid(),
        first.exposures
    );
    let of_points: Vec<Vec<Row>> = tallies
        .par_iter()
        .map(|(point, tally)| rows(point, tally))
        .collect();
    for row in of_points.into_iter().flatten() {
        writeln!(
            text,
            "{},{},{},{},{},{:.4e}",
            row.first_mean, row.first, row.last, row.alpha, row.events, row.intensity
        )?;
    }
    Ok(text)
}

/// The table that is kept.
const KEPT: &str = include_str!("../../data/repeated_looks.csv");

/// ln H and ln of its share, ascending in H.
type Shares = Vec<(f64, f64)>;

/// Shares by mean, first look and span; empty where nothing was simulated.
type Grid = Vec<[[Shares; SPANS.len()]; FIRSTS.len()]>;

/// The table, ready to be asked.
#[derive(Clone, Debug)]
pub struct Table {
    /// Exposures simulated at each point.
    pub exposures: u64,
    /// Its rows.
    pub rows: Vec<Row>,
    /// The shares that were seen.
    shares: Grid,
    /// Upper 99 % limits of those.
    upper: Grid,
}

impl Table {
    /// The table in `repeated_looks.csv`.
    ///
    /// # Errors
    /// If the file is damaged, or was made for another grid.
    pub fn kept() -> Result<Self> {
        Self::read(KEPT)
    }

    fn read(text: &str) -> Result<Self> {
        ensure!(
            text.lines().any(|line| line == grid()),
            "repeated_looks.csv is of another grid than this program's: make it anew with \
             `cargo xtask figures --all`"
        );
        let header = |name: &str| {
            let mut lines = text.lines();
            let value = lines.find_map(|line| line.strip_prefix("# ")?.strip_prefix(name));
            value
                .context("the table says not how it was made")?
                .trim()
                .parse::<u64>()
                .context("the table's header")
        };
        let mut table = Self {
            exposures: header("exposures")?,
            rows: Vec::new(),
            shares: vec![Default::default(); FIRST_MEANS.len()],
            upper: vec![Default::default(); FIRST_MEANS.len()],
        };
        for line in text.lines().filter(|line| !line.starts_with('#')).skip(1) {
            let added = read_row(line).and_then(|row| table.add(row));
            added.with_context(|| format!("row {line:?}"))?;
        }
        Ok(table)
    }

    fn add(&mut self, row: Row) -> Result<()> {
        let mean = FIRST_MEANS.iter().position(|&mean| mean == row.first_mean);
        let first = FIRSTS.iter().position(|&first| first == row.first);
        let span = SPANS.iter().position(|span| span * row.first == row.last);
        let [Some(mean), Some(first), Some(span)] = [mean, first, span] else {
            anyhow::bail!("not a point of the grid");
        };
        let is_alpha = (0..ALPHA_STEPS).any(|step| alpha_bits(step) == row.alpha);
        ensure!(
            is_alpha && row.last <= LAST && row.first_mean * f64::from(SPANS[span]) <= HIGHEST_MEAN,
            "not a point of the grid"
        );
        ensure!(
            row.events < self.exposures && row.intensity > 0.0,
            "not a probability"
        );
        let share = row.events as f64 / self.exposures as f64;
        let (_, most) = binomial::interval(row.events, self.exposures, UPPER_TAIL);
        let independent = row.intensity.ln();
        for (grid, probability) in [(&mut self.shares, share), (&mut self.upper, most)] {
            let shares = &mut grid[mean][first][span];
            // Higher α, lower intensity: from the back. Two α with the same
            // thresholds have the same.
            if shares.first().is_none_or(|known| independent < known.0) {
                let found = -(-probability).ln_1p();
                shares.insert(0, (independent, (found / row.intensity).ln()));
            }
        }
        self.rows.push(row);
        Ok(())
    }

    /// What looks `first` to `last` with `first_mean` photons a bin at the
    /// first come to, if they would have the intensity `independent` were they
    /// independent. `None` outside the table.
    #[must_use]
    pub fn look_up(
        &self,
        first_mean: f64,
        first: u32,
        last: u32,
        independent: f64,
    ) -> Option<Found> {
        let span = f64::from(last) / f64::from(first);
        let (mean, mean_part) = place(&FIRST_MEANS, first_mean)?;
        let (first, first_part) = place(&FIRSTS.map(f64::from), first.into())?;
        let (span, span_part) = place(&SPANS.map(f64::from), span)?;
        let independent = independent.ln();
        let [mut sum, mut upper] = [0.0; 2];
        let mut seen = true;
        for corner in 0..8 {
            let [a, b, c] = [corner & 1, corner >> 1 & 1, corner >> 2];
            let part = |upper: usize, part: f64| if upper == 1 { part } else { 1.0 - part };
            let weight = part(a, mean_part) * part(b, first_part) * part(c, span_part);
            if weight > 0.0 {
                let of = |grid: &Grid| at(&grid[mean + a][first + b][span + c], independent);
                let (found, within) = of(&self.shares)?;
                let (most, _) = of(&self.upper)?;
                sum += weight * found;
                upper += weight * most;
                seen &= within;
            }
        }
        let probability = |intensity: f64| -(-intensity.exp()).exp_m1();
        Some(Found {
            probability: probability(sum),
            at_most: probability(upper),
            seen,
        })
    }
}

/// A probability from the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// That of a false alarm in an exposure.
    pub probability: f64,
    /// The same from the upper 99 % limits of what was seen at the points around it.
    pub at_most: f64,
    /// Whether events of that kind were seen. If not, it is at most
    /// `probability`, the least the table saw.
    pub seen: bool,
}

fn read_row(line: &str) -> Result<Row> {
    let fields: Vec<&str> = line.split(',').collect();
    let [first_mean, first, last, alpha, events, intensity] = fields[..] else {
        anyhow::bail!("{} fields, not 6", fields.len());
    };
    Ok(Row {
        first_mean: first_mean.parse()?,
        first: first.parse()?,
        last: last.parse()?,
        alpha: alpha.parse()?,
        events: events.parse()?,
        intensity: intensity.parse()?,
    })
}

/// Between which two of `values` `value` lies, and how far from the lower one
/// on a logarithmic scale; `None` outside.
fn place(values: &[f64], value: f64) -> Option<(usize, f64)> {
    let upper = values.iter().position(|&known| value <= known)?;
    if upper == 0 {
        return (value == values[0]).then_some((0, 0.0));
    }
    let [low, high] = [values[upper - 1], values[upper]];
    Some((upper - 1, (value / low).ln() / (high / low).ln()))
}

/// ln of the intensity found at ln H `independent`, and whether it was seen.
///
/// Between two α of the table the share rises, then falls where an integer
/// threshold is passed: so the larger of the two shares is taken, and the
/// intensity is never above that of the lower α, nor below what was seen. Above
/// all the share is that of the lowest α. `None` where nothing was seen.
fn at(shares: &Shares, independent: f64) -> Option<(f64, bool)> {
    let found = |(independent, share): (f64, f64)| independent + share.min(0.0);
    let upper = shares.iter().position(|known| independent <= known.0);
    match upper {
        None => shares
            .last()
            .map(|known| (found((independent, known.1)), true)),
        Some(0) => Some((found(shares[0]), false)),
        Some(upper) => {
            let [low, high] = [shares[upper - 1], shares[upper]];
            let share = low.1.max(high.1);
            Some((found((independent, share)).min(found(high)), true))
        }
    }
}

#[cfg(test)]
mod tests;
