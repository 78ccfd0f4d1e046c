//! The z of the window rule for a share of false alarms, by simulation.
//!
//! Exposures without a target are simulated. The core finds at every look the highest z that would still
//! give an event; the highest of an exposure counts. If fewer than 200 exposures exceed the wanted z, it is
//! extrapolated from five times as many: the share of exposures above z falls nearly as `exp(-z²/m)`.

use anyhow::{Context, Result, ensure};
use dtof_core::fixed::types::U4F12;
use dtof_core::rule::detect;
use dtof_core::{Count, DepthEstimator, Histogram, RangeGate, WindowRule};
use dtof_data::random::trial_rng;
use dtof_light::looks::exposure::{Exposures, Looks};
use dtof_light::progress::{Part, Progress};
use dtof_light::rates::Rates;
use rayon::prelude::*;

use dtof_data::options::Refused;
use dtof_engine::with_bins;

/// About so many photons are drawn, in at least and at most so many exposures.
const PHOTONS: f64 = 1.5e9;
const EXPOSURES: (f64, f64) = (6_000.0, 20_000.0);
/// With so many false alarms, z is counted and not extrapolated.
const ENOUGH: usize = 200;
/// Parts that run in parallel.
const TRIALS: u16 = 64;

/// The exposures, and the wanted share of false alarms.
#[derive(Clone, Copy, Debug)]
pub struct ExposureSettings {
    /// Background photons a bin and laser cycle.
    pub background: f64,
    /// Bins of a histogram.
    pub bins: usize,
    /// First and last bin of the gate.
    pub gate: (u16, u16),
    /// Bins in the window.
    pub window: u8,
    /// The fewest photons in the window.
    pub min_count: u16,
    /// L1, L2 and X.
    pub looks: (u16, u16, u16),
    /// The share of exposures without a target that may end with an event.
    pub share: f64,
    /// Seed of the exposures.
    pub seed: u64,
}

/// The z that gives the share, and the number of simulated exposures.
///
/// # Errors
/// Fails if the gate or the window is invalid, if the share is too small to simulate, or if `progress` ends the
/// calculation.
pub fn z(settings: &ExposureSettings, progress: Progress) -> Result<(U4F12, u64)> {
    let highest = with_bins!(settings.bins, BINS => highest::<BINS>(settings, progress))??;
    let all = highest.len() as f64;
    let above_z = settings.share * all;
    ensure!(
        above_z >= 10.0,
        Refused::value(
            "false_alarm",
            settings.share,
            format!(
                "{all} simulated exposures do not show so few; ask for {} or more",
                10.0 / all
            )
        )
    );
    // The square of the z of this rank; the highest z has rank 0.
    let square = |rank: usize| highest[rank].to_num::<f64>().powi(2);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let rank = above_z as usize;
    let square = if rank >= ENOUGH {
        square(rank)
    } else {
        let first = (5 * rank).min(highest.len() / 4);
        let from = square(first);
        let above: f64 = (0..first).map(|rank| square(rank) - from).sum();
        from + above / first as f64 * (first as f64 / above_z).ln()
    };
    let z = U4F12::saturating_from_num(square.max(0.0).sqrt());
    Ok((z.saturating_add(U4F12::DELTA), highest.len() as u64))
}

/// The highest z of each exposure, in descending order.
fn highest<const BINS: usize>(
    settings: &ExposureSettings,
    progress: Progress,
) -> Result<Vec<U4F12>> {
    let (l1, l2, x) = settings.looks;
    let gate = RangeGate::<BINS>::new(settings.gate.0, settings.gate.1).context("the gate")?;
    let bins = u16::try_from(BINS)?;
    let rates = Rates::without_target(settings.background);
    let exposures = Exposures::new(&rates, bins, Looks::new(x, l1, l2))?;
    let each = settings.background * f64::from(bins) * f64::from(l2);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let count = (PHOTONS / each.max(1.0)).clamp(EXPOSURES.0, EXPOSURES.1) as usize;
    let each = count.div_ceil(usize::from(TRIALS));
    let part = Part::new(progress, (each * usize::from(TRIALS)) as u64)?;
    let rule = |z| {
        WindowRule::new(
            settings.window,
            z,
            Count::saturating(settings.min_count.into()),
        )
    };
    rule(U4F12::ZERO).context("the window")?;
    let exceeds = |histogram: &Histogram<BINS>, z: U4F12| {
        let estimator = DepthEstimator::Centroid3;
        rule(z).is_ok_and(|rule| detect(histogram, &gate, &rule, &estimator).is_some())
    };
    // One type for all numbers of bins: the parallel code is compiled once.
    let trial: &(dyn Fn(u16) -> Result<Vec<U4F12>> + Sync) = &|trial| {
        let mut rng = trial_rng(settings.seed, trial);
        let mut found = Vec::with_capacity(each);
        for _ in 0..each {
            let mut highest = U4F12::ZERO;
            exposures.run::<BINS>(&gate, &mut rng, |_, histogram| {
                if exceeds(histogram, highest) {
                    highest = search(highest, |z| exceeds(histogram, z));
                }
                false
            });
            found.push(highest);
            part.next()?;
        }
        Ok(found)
    };
    let trials = (0..TRIALS).into_par_iter().map(trial);
    let mut all = trials.collect::<Result<Vec<_>>>()?.concat();
    all.sort_unstable();
    all.reverse();
    Ok(all)
}

/// The lowest z above `low` that is not exceeded; `low` is.
fn search(low: U4F12, exceeded: impl Fn(U4F12) -> bool) -> U4F12 {
    let (mut low, mut high) = (low.to_bits(), u16::MAX);
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        if exceeded(U4F12::from_bits(middle)) {
            low = middle;
        } else {
            high = middle;
        }
    }
    U4F12::from_bits(high)
}
