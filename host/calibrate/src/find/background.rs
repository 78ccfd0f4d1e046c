//! The background of a histogram: the mean count of the bins without a peak.
//!
//! Bins that hold significantly more than the mean, alone or with both neighbours, are left out, with one
//! bin on either side. The mean of the rest is the next estimate. This is repeated until nothing changes.
//! The first estimate is the median, or the mean of a sparse histogram.

use super::significance::{is_surely_more, median};

/// By chance a bin is left out in one of so many histograms.
const ONE_IN: f64 = 100.0;
/// The most repetitions; it converges long before.
const ROUNDS: usize = 40;

/// The background of one histogram.
#[derive(Clone, Debug)]
pub struct Level {
    /// Photons a bin.
    pub mean: f64,
    /// For each bin whether it holds only background.
    pub clear: Vec<bool>,
}

impl Level {
    /// Estimates the background of a histogram.
    #[must_use]
    pub fn of(counts: &[f64]) -> Self {
        let all = counts.iter().sum::<f64>() / counts.len() as f64;
        let middle = median(counts.iter().copied());
        let mut mean = if middle >= 5.0 { middle } else { all };
        let mut clear = vec![true; counts.len()];
        for _ in 0..ROUNDS {
            let next = clear_bins(counts, mean);
            // All bins are peaks: the last estimate has to do.
            if !next.contains(&true) {
                break;
            }
            let settled = next == clear;
            clear = next;
            mean = mean_of(counts, &clear);
            if settled {
                break;
            }
        }
        Self { mean, clear }
    }

    /// The number of bins that hold only background.
    #[must_use]
    pub fn clear_bins(&self) -> usize {
        self.clear.iter().filter(|&&clear| clear).count()
    }

    /// Photons in these bins.
    #[must_use]
    pub fn photons(&self) -> f64 {
        self.mean * self.clear_bins() as f64
    }
}

fn clear_bins(counts: &[f64], mean: f64) -> Vec<bool> {
    let bins = counts.len();
    let one_in = ONE_IN * bins as f64;
    let mut clear = vec![true; bins];
    let mut leave_out = |first: usize, last: usize| {
        let (first, last) = (first.saturating_sub(1), (last + 1).min(bins - 1));
        clear[first..=last].fill(false);
    };
    for width in [1, 3] {
        for (first, window) in counts.windows(width).enumerate() {
            let sum = window.iter().sum();
            if is_surely_more(sum, mean * width as f64, one_in) {
                leave_out(first, first + width - 1);
            }
        }
    }
    clear
}

fn mean_of(counts: &[f64], clear: &[bool]) -> f64 {
    let kept = counts.iter().zip(clear).filter(|(_, clear)| **clear);
    let (sum, bins) = kept.fold((0.0, 0.0), |(sum, bins), (count, _)| {
        (sum + count, bins + 1.0)
    });
    sum / f64::max(bins, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peaks_and_their_tails_are_no_background() {
        let mut counts = vec![20.0; 128];
        for (bin, count) in counts.iter_mut().enumerate().take(80).skip(40) {
            *count += 9000.0 * (-(bin as f64 - 40.0) / 4.0).exp();
        }
        let level = Level::of(&counts);
        // The tail no longer shows where it is below the noise of three bins.
        assert!((level.mean - 20.0).abs() < 0.4, "{}", level.mean);
        assert!(!level.clear[39] && !level.clear[60] && level.clear[90]);
    }

    #[test]
    fn few_photons_are_all_background_and_none_is_none() {
        let mut counts = vec![0.0; 64];
        counts[3] = 1.0;
        counts[50] = 2.0;
        assert!((Level::of(&counts).mean - 3.0 / 64.0).abs() < 1e-12);
        assert_eq!(Level::of(&[0.0; 64]).mean, 0.0);
    }
}
