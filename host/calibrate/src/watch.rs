//! Whether crosstalk of the cover glass has become stronger since it was calibrated.
//!
//! The photons of a run before the gate are a background and a multiple of the calibrated crosstalk. The
//! background is measured behind the gate, so ambient light may have changed. A near target in a few
//! pixels has another shape and lifts some of the bins. So the factor is the weighted median over the
//! bins, and their spread is part of the interval.

use super::find::background::Level;

/// Bins with less than this share of the highest crosstalk are not used.
const MIN_SHARE: f64 = 0.02;
/// A factor within this distance of 1 is no change.
const TOLERANCE: f64 = 0.1;

/// All photons of a run.
#[derive(Clone, Copy, Debug)]
pub struct RunPhotons<'a> {
    /// Photons of all pixels in each bin.
    pub bins: &'a [u64],
    /// Laser cycles it lasted.
    pub cycles: u64,
    /// Pixels that are not masked.
    pub pixels: u64,
}

/// How crosstalk has changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// It is about `.0` times as bright, and at least `.1` times.
    Brighter(f64, f64),
    /// It is about `.0` times as bright, and at most `.1` times.
    Dimmer(f64, f64),
    /// It is about this many times as bright: no significant change.
    Same(f64),
    /// There is too little light, or something else lies before the gate.
    NotSure,
}

/// Compares a run with the crosstalk of the settings. `shape` has its photons a laser cycle and pixel for
/// each bin from 0 on, `gate_first` is the first bin of the gate.
#[must_use]
pub fn glass_change(run: &RunPhotons, shape: &[f64], gate_first: u16) -> Change {
    let gate = usize::from(gate_first).min(run.bins.len());
    let exposures = run.cycles as f64 * run.pixels as f64;
    let behind: Vec<f64> = run.bins[gate..].iter().map(|&count| count as f64).collect();
    if behind.len() < 8 || exposures <= 0.0 {
        return Change::NotSure;
    }
    let level = Level::of(&behind, &vec![1.0; behind.len()]);
    // If surfaces lie everywhere, the background may be as low as the lowest bins.
    let lowest = behind
        .chunks(4)
        .filter(|chunk| chunk.len() == 4)
        .map(|chunk| chunk.iter().sum::<f64>() / 4.0)
        .fold(f64::INFINITY, f64::min);
    let level_error =
        (level.mean / level.clear_bins.max(1.0)).sqrt() + 0.3 * (level.mean - lowest).abs();
    let highest = shape.iter().copied().fold(0.0, f64::max);
    // Factor, weight and error of each bin.
    let mut factors: Vec<(f64, f64, f64)> = Vec::new();
    for (&count, &share) in run.bins.iter().zip(shape).take(gate) {
        if share > MIN_SHARE * highest {
            let glass = share * exposures;
            let error = (count as f64).max(1.0).sqrt().hypot(level_error) / glass;
            factors.push(((count as f64 - level.mean) / glass, share, error));
        }
    }
    let Some(factor) = weighted_median(&mut factors) else {
        return Change::NotSure;
    };
    let all: f64 = factors.iter().map(|bin| bin.1).sum();
    let variance: f64 = factors.iter().map(|bin| (bin.1 * bin.2).powi(2)).sum();
    let spread: f64 = factors
        .iter()
        .map(|bin| bin.1 * (bin.0 - factor).abs())
        .sum();
    // A median has 1.25 times the error of the mean.
    let error = 3.3 * 1.25 * variance.sqrt() / all + spread / all;
    let (low, high) = (factor - error, factor + error);
    if low > 1.0 + TOLERANCE {
        Change::Brighter(factor, low)
    } else if high < 1.0 - TOLERANCE {
        Change::Dimmer(factor, high)
    } else if error < 2.0 * TOLERANCE {
        Change::Same(factor)
    } else {
        Change::NotSure
    }
}

/// The median of values (`.0`) with weights (`.1`).
fn weighted_median(values: &mut [(f64, f64, f64)]) -> Option<f64> {
    values.sort_by(|one, other| one.0.total_cmp(&other.0));
    let half = values.iter().map(|value| value.1).sum::<f64>() / 2.0;
    let mut sum = 0.0;
    values
        .iter()
        .find(|value| {
            sum += value.1;
            sum >= half
        })
        .map(|value| value.0)
}
