//! The background of a histogram: the mean count of the bins without a peak.
//!
//! Bins that hold significantly more than the mean, alone or with both neighbours, are left out, with one
//! bin on either side. The mean of the rest is the next estimate. This is repeated until nothing changes.
//! The first estimate is the median, or the mean of a sparse histogram.

use super::significance::{are_surely_more, median};

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
    /// The number of bins that hold only background; one in which the TDC was live in half of the laser cycles is half a
    /// bin.
    pub clear_bins: f64,
}

impl Level {
    /// Estimates the background of a histogram, whose TDC was `live` in so much of the laser cycles in each bin.
    #[must_use]
    pub fn of(counts: &[f64], live: &[f64]) -> Self {
        let mut clear = vec![true; counts.len()];
        let all = mean_of(counts, live, &clear);
        let mostly_live = counts.iter().zip(live).filter(|(_, live)| **live >= 0.5);
        let middle = median(mostly_live.map(|(count, _)| *count));
        let mut mean = if middle >= 5.0 { middle } else { all };
        for _ in 0..ROUNDS {
            let next = clear_bins(counts, live, mean);
            // All bins are peaks: the last estimate has to do.
            if !next.contains(&true) {
                break;
            }
            let settled = next == clear;
            clear = next;
            mean = mean_of(counts, live, &clear);
            if settled {
                break;
            }
        }
        let live = clear.iter().zip(live).filter(|(clear, _)| **clear);
        let clear_bins = live.map(|(_, live)| live).sum();
        Self {
            mean,
            clear,
            clear_bins,
        }
    }

    /// Photons a bin if there were one more: the background of a few bins without a photon is not 0.
    #[must_use]
    pub fn with_one_more(&self) -> f64 {
        self.mean + 1.0 / self.clear_bins.max(1.0)
    }

    /// Photons in these bins.
    #[must_use]
    pub fn photons(&self) -> f64 {
        self.mean * self.clear_bins
    }
}

fn clear_bins(counts: &[f64], live: &[f64], mean: f64) -> Vec<bool> {
    let bins = counts.len();
    let one_in = ONE_IN * bins as f64;
    let mut clear = vec![true; bins];
    let mut leave_out = |first: usize, last: usize| {
        let (first, last) = (first.saturating_sub(1), (last + 1).min(bins - 1));
        clear[first..=last].fill(false);
    };
    for width in [1, 3] {
        let windows = counts.windows(width).zip(live.windows(width));
        for (first, (window, live)) in windows.enumerate() {
            if are_surely_more(window, live, mean, one_in) {
                leave_out(first, first + width - 1);
            }
        }
    }
    clear
}

/// What was recorded in the clear bins over what was live of them.
fn mean_of(counts: &[f64], live: &[f64], clear: &[bool]) -> f64 {
    let kept = counts.iter().zip(live).zip(clear);
    let kept = kept.filter(|(_, clear)| **clear);
    let (sum, bins) = kept.fold((0.0, 0.0), |(sum, bins), ((count, live), _)| {
        (sum + count * live, bins + live)
    });
    sum / f64::max(bins, 1e-9)
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
        let level = Level::of(&counts, &[1.0; 128]);
        // The tail no longer shows where it is below the noise of three bins.
        assert!((level.mean - 20.0).abs() < 0.4, "{}", level.mean);
        assert!(!level.clear[39] && !level.clear[60] && level.clear[90]);
    }

    #[test]
    fn few_photons_are_all_background_and_none_is_none() {
        let mut counts = vec![0.0; 64];
        counts[3] = 1.0;
        counts[50] = 2.0;
        assert!((Level::of(&counts, &[1.0; 64]).mean - 3.0 / 64.0).abs() < 1e-12);
        assert_eq!(Level::of(&[0.0; 64], &[1.0; 64]).mean, 0.0);
    }
}
