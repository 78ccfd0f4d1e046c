//! The generalised likelihood ratio test for a pulse of known shape and strength at an unknown
//! position: the reference for detection rules.
//!
//! With background `B` a bin and laser cycle, signal `A` a laser cycle and the
//! share `h_i(µ)` of the pulse in bin i, counts `n_i` after N laser cycles have the
//! log likelihood ratio
//!
//! ```text
//! L(µ) = Σ n_i·ln(1 + A·h_i(µ)/B) − N·A·Σ h_i(µ)
//! ```
//!
//! of a pulse at µ against background alone. The test compares the largest `L(µ)`, over
//! positions half a bin apart, with a threshold. A rule that has to estimate `A`, `B` or
//! the shape has less information.

use crate::counts::bisect;
use crate::rates::bin_share;

/// Positions per bin: its start and its middle.
const POSITIONS: usize = 2;

/// The test for a known scene.
#[derive(Clone, Debug)]
pub struct LikelihoodRatio {
    bins: usize,
    /// Bins that a pulse reaches on either side of its own.
    reach: usize,
    /// `ln(1 + A·h/B)` of a photon for each position from `reach` bins before the
    /// photon's bin to `reach` bins after it.
    gains: Vec<f64>,
    /// `A·Σ h_i` for each position.
    losses: Vec<f64>,
}

/// The likelihood ratio of one exposure so far.
#[derive(Clone, Debug)]
pub struct Evidence<'a> {
    scene: &'a LikelihoodRatio,
    /// The sum of gains for each position, with `reach` extra bins at both ends.
    gains: Vec<f64>,
}

impl LikelihoodRatio {
    /// For histograms of `bins` bins, `background` photons a bin and laser cycle, and
    /// `signal` photons a laser cycle in a pulse of standard deviation `sigma` bins. All
    /// must be above 0.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub fn new(bins: u32, background: f64, signal: f64, sigma: f64) -> Self {
        // One photon in ten million lies farther out.
        let reach = (5.5 * sigma).ceil() as usize + 1;
        let position = |index: usize| index as f64 / POSITIONS as f64;
        let gain = |index: usize| {
            // The photon's bin is `reach`.
            let share = bin_share(reach as u32, position(index), sigma);
            (signal * share / background).ln_1p()
        };
        let loss = |index: usize| {
            let share = |bin| bin_share(bin, position(index), sigma);
            signal * (0..bins).map(share).sum::<f64>()
        };
        Self {
            bins: bins as usize,
            reach,
            gains: (0..(2 * reach + 1) * POSITIONS).map(gain).collect(),
            losses: (0..bins as usize * POSITIONS).map(loss).collect(),
        }
    }

    /// The evidence at the start of an exposure.
    #[must_use]
    pub fn evidence(&self) -> Evidence<'_> {
        Evidence {
            scene: self,
            gains: vec![0.0; (self.bins + 2 * self.reach) * POSITIONS],
        }
    }
}

impl Evidence<'_> {
    /// Adds `photons` in `bin`, which must be a bin of the histogram.
    pub fn add(&mut self, bin: u16, photons: u16) {
        let photons = f64::from(photons);
        let from = usize::from(bin) * POSITIONS;
        for (sum, gain) in self.gains[from..].iter_mut().zip(&self.scene.gains) {
            *sum += photons * gain;
        }
    }

    /// The log likelihood ratio of the best position after `cycles` laser cycles.
    #[must_use]
    pub fn highest(&self, cycles: u32) -> f64 {
        let cycles = f64::from(cycles);
        let losses = &self.scene.losses;
        let gains = &self.gains[self.scene.reach * POSITIONS..][..losses.len()];
        let larger = |highest: f64, (gain, loss): (&f64, &f64)| {
            let ratio = gain - cycles * loss;
            if ratio > highest { ratio } else { highest }
        };
        // Each of eight lanes has a maximum of its own, and none waits for another.
        let mut lanes = [f64::NEG_INFINITY; 8];
        let ((gains, last_gains), (losses, last_losses)) =
            (gains.as_chunks::<8>(), losses.as_chunks::<8>());
        for (gains, losses) in gains.iter().zip(losses) {
            lanes = std::array::from_fn(|lane| larger(lanes[lane], (&gains[lane], &losses[lane])));
        }
        let last = last_gains.iter().zip(last_losses);
        let last = last.fold(f64::NEG_INFINITY, larger);
        lanes.into_iter().fold(last, f64::max)
    }
}

/// The mean growth of the log likelihood ratio at the true position (the Kullback-Leibler
/// divergence), in nats a laser cycle, for a pulse of `signal` photons a laser cycle at
/// `position`.
#[must_use]
pub fn information(background: f64, signal: f64, position: f64, sigma: f64) -> f64 {
    // Far from both ends; only the position within a bin matters.
    let far = (8.0 * sigma).ceil();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let bins = 2 * far as u32 + 1;
    let position = far + (position - position.floor());
    let one_bin = |bin| {
        let mean = signal * bin_share(bin, position, sigma);
        (background + mean) * (mean / background).ln_1p() - mean
    };
    (0..bins).map(one_bin).sum()
}

/// The signal photons a laser cycle at which [`information`] equals `target`.
#[must_use]
pub fn signal_for_information(background: f64, position: f64, sigma: f64, target: f64) -> f64 {
    let is_less = |signal| information(background, signal, position, sigma) < target;
    let mut high = 1.0;
    while is_less(high) {
        high *= 2.0;
    }
    bisect(0.0, high, is_less)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counts::poisson::Poisson;

    /// ln of the probability of `counts`, whose means are `means`.
    fn ln_likelihood(counts: &[u16], means: &[f64]) -> f64 {
        let pairs = counts.iter().zip(means);
        pairs
            .map(|(&count, &mean)| Poisson::new(mean).mass(count.into()).ln())
            .sum()
    }

    #[test]
    fn it_is_the_ratio_of_two_likelihoods() {
        // 34 positions: two more than fit into lanes.
        const BINS: u32 = 17;
        let (background, signal, cycles) = (0.3, 0.7, 20);
        let inside: [u16; BINS as usize] = [6, 4, 9, 6, 3, 8, 14, 19, 8, 6, 5, 7, 2, 6, 11, 5, 4];
        // The highest bin is the last one.
        let mut at_the_end = inside;
        at_the_end.rotate_right(9);
        for counts in [inside, at_the_end] {
            for sigma in [0.4, 1.0, 2.5] {
                let scene = LikelihoodRatio::new(BINS, background, signal, sigma);
                let mut evidence = scene.evidence();
                for (bin, &count) in (0..).zip(&counts) {
                    evidence.add(bin, count / 2);
                    evidence.add(bin, count - count / 2);
                }
                let of = |position: Option<f64>| {
                    let mean = |bin| {
                        let pulse =
                            position.map_or(0.0, |position| bin_share(bin, position, sigma));
                        f64::from(cycles) * (background + signal * pulse)
                    };
                    ln_likelihood(&counts, &(0..BINS).map(mean).collect::<Vec<_>>())
                };
                let ratios = (0..2 * BINS).map(|half| of(Some(f64::from(half) / 2.0)) - of(None));
                let highest = ratios.fold(f64::NEG_INFINITY, f64::max);
                let found = evidence.highest(cycles);
                assert!((found - highest).abs() < 1e-5, "{sigma}: {found} {highest}");
            }
        }
    }

    #[test]
    fn information_has_all_bins_of_the_pulse() {
        for sigma in [0.05, 0.3, 5.0] {
            for within in [0.1, 0.3, 0.9] {
                let (background, signal) = (0.02, 3.0);
                let divergence = |bin| {
                    let mean = background + signal * bin_share(bin, 200.0 + within, sigma);
                    mean * (mean / background).ln() - (mean - background)
                };
                let expected: f64 = (0..400).map(divergence).sum();
                let found = information(background, signal, 7.0 + within, sigma);
                assert!((found / expected - 1.0).abs() < 1e-9, "{sigma} {within}");
                let inverse = signal_for_information(background, within, sigma, expected);
                assert!((inverse / signal - 1.0).abs() < 1e-9, "{sigma} {within}");
            }
        }
    }

    #[test]
    fn information_is_the_mean_growth() {
        let (background, signal, position, sigma) = (0.05, 0.4, 64.5, 1.0);
        let scene = LikelihoodRatio::new(128, background, signal, sigma);
        // 10,000 laser cycles of the mean counts, rounded.
        let cycles = 10_000;
        let mut evidence = scene.evidence();
        for bin in 0..128 {
            let mean = background + signal * bin_share(bin.into(), position, sigma);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            evidence.add(bin, (mean * f64::from(cycles)).round() as u16);
        }
        let expected = information(background, signal, position, sigma);
        let found = evidence.highest(cycles) / f64::from(cycles);
        assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
        let inverse = signal_for_information(background, position, sigma, expected);
        assert!((inverse / signal - 1.0).abs() < 1e-9);
    }
}
