//! False alarms of repeated looks, simulated once and interpolated.
//!
//! If the looks of an exposure were independent, false alarms would have the intensity
//! `H = Σ −ln(1 − p_k)` over the exact single-look probabilities, and the probability
//! `1 − exp(−H)`. Because looks share photons, the simulated intensity is lower. The table has
//! the ratio of the two, called the share. The share varies slowly, while the probability
//! spans orders of magnitude and has steps (α times an integer root). The share is interpolated
//! over the logarithms of three numbers: the mean background at the first look, the first
//! look, and the ratio of last to first look. Between two α the larger share counts.
//!
//! `cargo lab figures` writes `host/light/data/repeated_looks.csv` from the study `false-events`.

use std::fmt::Write;

use anyhow::{Context, Result, ensure};
use dtof_core::Count;
use dtof_core::fixed::types::U8F8;
use dtof_core::paper::Threshold;
use rayon::prelude::*;

use crate::counts::binomial;
use crate::looks::repeated_looks::{
    ALPHA_STEPS, BINS, FalseAlarms, MINIMUM_COUNT, Point, RepeatedLooks, alpha_bits, single_looks,
};
use dtof_data::random::trial_rng;

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
/// The highest mean background at the last look: four times 400, because interpolation needs
/// twice the mean and twice the span. Counters saturate there, both in the simulation and in
/// the exact law.
const HIGHEST_MEAN: f64 = 1700.0;
/// Fewer events give no usable estimate.
const MIN_EVENTS: u64 = 20;
/// Between its points, an upper limit of the table may be too low by up to this factor
/// (checked in `host-tests/tests/simulations/theory_exposures.rs`).
pub const MARGIN: f64 = 1.4;
/// The probability that a simulated probability exceeds its upper limit.
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
    /// `H`: `independent` of [`Bounds`](crate::looks::repeated_looks::Bounds).
    pub intensity: f64,
}

/// All simulated points.
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

/// The grid as text: the header of the table.
fn grid() -> String {
    let alphas: Vec<u16> = (0..ALPHA_STEPS).map(alpha_bits).collect();
    format!(
        "# grid first_mean {FIRST_MEANS:?} first_look {FIRSTS:?} span {SPANS:?} \
         last_look up to {LAST} last_mean up to {HIGHEST_MEAN} alpha_256 {alphas:?} \
         events from {MIN_EVENTS}"
    )
}

/// Simulates one point, in trials numbered from `first_trial`.
///
/// # Errors
/// Fails if the mean of the point is negative or not a number, or if the trial numbers exceed
/// `u16::MAX`.
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

/// The rows of one point; probabilities near 0 or 1 are left out.
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
            if events < MIN_EVENTS || certain {
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

/// Points and their tallies as CSV. All tallies must have the same number of exposures.
///
/// # Errors
/// Fails if `tallies` is empty.
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

/// The table of this crate.
const CSV: &str = include_str!("../../data/repeated_looks.csv");

/// ln H and ln of its share, ascending in H.
type Shares = Vec<(f64, f64)>;

/// Shares by mean, first look and span; empty where nothing is simulated.
type Grid = Vec<[[Shares; SPANS.len()]; FIRSTS.len()]>;

/// The table, ready for look-ups.
#[derive(Clone, Debug)]
pub struct Table {
    /// Exposures simulated at each point.
    pub exposures: u64,
    /// The rows of the file.
    pub rows: Vec<Row>,
    /// Simulated shares.
    shares: Grid,
    /// Upper 99 % limits of the shares.
    upper: Grid,
}

impl Table {
    /// The table in `repeated_looks.csv`, which is compiled in.
    ///
    /// # Errors
    /// Fails if the file is damaged or has another grid.
    pub fn load() -> Result<Self> {
        Self::read(CSV)
    }

    fn read(text: &str) -> Result<Self> {
        ensure!(
            text.lines().any(|line| line == grid()),
            "repeated_looks.csv has another grid than this program: write it again with \
             `cargo lab figures --all`"
        );
        let header = |name: &str| {
            let mut lines = text.lines();
            let value = lines.find_map(|line| line.strip_prefix("# ")?.strip_prefix(name));
            value
                .with_context(|| format!("the table has no header `{name}`"))?
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
        let (_, upper_limit) = binomial::interval(row.events, self.exposures, UPPER_TAIL);
        let independent = row.intensity.ln();
        for (grid, probability) in [(&mut self.shares, share), (&mut self.upper, upper_limit)] {
            let shares = &mut grid[mean][first][span];
            // Rows come with ascending α and so descending intensity. Two α with the same
            // thresholds have equal intensities.
            if shares.first().is_none_or(|first| independent < first.0) {
                let found = -(-probability).ln_1p();
                shares.insert(0, (independent, (found / row.intensity).ln()));
            }
        }
        self.rows.push(row);
        Ok(())
    }

    /// The probability of a false alarm in the looks `first` to `last`, with `first_mean`
    /// photons a bin at the first look. `independent` is the intensity of independent looks
    /// ([`Bounds`](crate::looks::repeated_looks::Bounds)). `None` outside the table.
    #[must_use]
    pub fn look_up(
        &self,
        first_mean: f64,
        first: u32,
        last: u32,
        independent: f64,
    ) -> Option<Estimate> {
        let span = f64::from(last) / f64::from(first);
        let (mean, mean_part) = place(&FIRST_MEANS, first_mean)?;
        let (first, first_part) = place(&FIRSTS.map(f64::from), first.into())?;
        let (span, span_part) = place(&SPANS.map(f64::from), span)?;
        let independent = independent.ln();
        let [mut sum, mut upper] = [0.0; 2];
        let mut is_observed = true;
        for corner in 0..8 {
            let [a, b, c] = [corner & 1, corner >> 1 & 1, corner >> 2];
            let part = |upper: usize, part: f64| if upper == 1 { part } else { 1.0 - part };
            let weight = part(a, mean_part) * part(b, first_part) * part(c, span_part);
            if weight > 0.0 {
                let of = |grid: &Grid| at(&grid[mean + a][first + b][span + c], independent);
                let (found, within) = of(&self.shares)?;
                let (upper_limit, _) = of(&self.upper)?;
                sum += weight * found;
                upper += weight * upper_limit;
                is_observed &= within;
            }
        }
        let probability = |intensity: f64| -(-intensity.exp()).exp_m1();
        Some(Estimate {
            probability: probability(sum),
            upper_limit: probability(upper),
            is_observed,
        })
    }
}

/// A probability from the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The probability of a false alarm in an exposure.
    pub probability: f64,
    /// The same from the upper 99 % limits of the points around it.
    pub upper_limit: f64,
    /// Whether the simulation had such events. If not, the probability is at most
    /// `probability`, the smallest value in the table.
    pub is_observed: bool,
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

/// The index of the last of `values` below `value`, and how far `value` lies from there to the
/// next on a logarithmic scale, 0 to 1; `None` outside.
fn place(values: &[f64], value: f64) -> Option<(usize, f64)> {
    let upper = values.iter().position(|&upper| value <= upper)?;
    if upper == 0 {
        return (value == values[0]).then_some((0, 0.0));
    }
    let [low, high] = [values[upper - 1], values[upper]];
    Some((upper - 1, (value / low).ln() / (high / low).ln()))
}

/// ln of the intensity at ln H `independent`, and whether the simulation had such events.
///
/// Between two α of the table the share rises, then falls at an integer threshold. So the
/// larger of the two shares counts, and the intensity never exceeds that of the lower α, nor
/// falls below the smallest in the table. Above the table the share is that of the lowest α.
/// `None` if there are no shares.
fn at(shares: &Shares, independent: f64) -> Option<(f64, bool)> {
    let found = |(independent, share): (f64, f64)| independent + share.min(0.0);
    let upper = shares.iter().position(|upper| independent <= upper.0);
    match upper {
        None => shares
            .last()
            .map(|last| (found((independent, last.1)), true)),
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
