//! The paper's analysis with Gaussian counts (Eq. 4, 5, 7 to 11).
//!
//! A larger α lowers the true and the false positive rate, as Eq. 8 and 10 say;
//! the paper's sentence on its ROC figure says the opposite.
//!
//! The counts of a bin are modelled as normal with variance = mean (Eq. 4), which
//! is inaccurate below some 30 photons; [`known_background`](crate::known_background)
//! has the same quantities with Poisson counts.

use crate::counts::normal;
use crate::counts::quadrature::integral;
use crate::rates::pulse_density;

/// Mean counts of a histogram after N laser cycles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanCounts {
    /// Background photons a bin (`λ_b = N·B`).
    pub background: f64,
    /// Signal photons in the peak bin (`λ_s,i*`, Eq. 6).
    pub signal: f64,
    /// Bins that hold background only (`M_B`).
    pub background_bins: u32,
}

/// Eq. 5: `λ_b + α·√λ_b`.
#[must_use]
pub fn threshold(background: f64, alpha: f64) -> f64 {
    background + alpha * background.sqrt()
}

impl MeanCounts {
    /// `λ_s,i* + λ_b`, mean and variance of the peak bin (Eq. 4).
    fn peak(&self) -> f64 {
        self.signal + self.background
    }

    /// Eq. 7: the probability that the peak bin exceeds all background bins.
    /// Integrated from 0 as printed, so the Gaussian's part below 0 is missing.
    /// The background must be above 0.
    #[must_use]
    pub fn hit_probability(&self) -> f64 {
        let (mean, deviation) = (self.peak(), self.peak().sqrt());
        // Less than 1e-22 lies beyond ten standard deviations.
        let from = (mean - 10.0 * deviation).max(0.0);
        integral(from, mean + 10.0 * deviation, 40, |x| {
            let z = (x - self.background) / self.background.sqrt();
            // Φ to the power of M_B, through its logarithm.
            let highest_below = (f64::from(self.background_bins) * normal::ln_below(z)).exp();
            highest_below * pulse_density(x, mean, deviation)
        })
    }

    /// Eq. 8: the probability that the peak bin exceeds the threshold. Falls
    /// with α.
    #[must_use]
    pub fn pass_probability(&self, alpha: f64) -> f64 {
        normal::above((alpha * self.background.sqrt() - self.signal) / self.peak().sqrt())
    }

    /// `P_true = P_hit · P(pass|hit)`, Eq. 7 times Eq. 8. Falls with α.
    #[must_use]
    pub fn true_positive_rate(&self, alpha: f64) -> f64 {
        self.hit_probability() * self.pass_probability(alpha)
    }

    /// Eq. 9: the largest α with which [`Self::true_positive_rate`] is at least
    /// `true_positive_rate`; `None` if that rate is not below the hit probability,
    /// which no α reaches.
    ///
    /// This is the first line of Eq. 9. The second line holds if its `h_i*` is the
    /// peak bin's share of the signal, not the count of Eq. 6.
    #[must_use]
    pub fn alpha_max(&self, true_positive_rate: f64) -> Option<f64> {
        let pass = true_positive_rate / self.hit_probability();
        (pass < 1.0).then(|| {
            let deviations = normal::quantile_above(pass);
            (self.signal + deviations * self.peak().sqrt()) / self.background.sqrt()
        })
    }

    /// The receiver operating characteristic: false and true positive rate at
    /// each of `alphas`. Both fall with α.
    #[must_use]
    pub fn roc(&self, alphas: &[f64]) -> Vec<(f64, f64)> {
        let hit = self.hit_probability();
        let point = |&alpha: &f64| {
            let false_positive_rate = false_positive_rate(alpha, self.background_bins);
            (false_positive_rate, hit * self.pass_probability(alpha))
        };
        alphas.iter().map(point).collect()
    }
}

/// Eq. 10: the probability that one of `background_bins` exceeds the threshold,
/// `1 − Φ(α)^M_B`, to full relative precision. Falls with α.
#[must_use]
pub fn false_positive_rate(alpha: f64, background_bins: u32) -> f64 {
    -(f64::from(background_bins) * normal::ln_below(alpha)).exp_m1()
}

/// Eq. 11: the smallest α with which [`false_positive_rate`] is at most
/// `false_positive_rate`, above 0 and below 1.
#[must_use]
pub fn alpha_min(false_positive_rate: f64, background_bins: u32) -> f64 {
    // 1 − (1 − P)^(1/M_B), without the cancellation.
    let one_bin = -((-false_positive_rate).ln_1p() / f64::from(background_bins)).exp_m1();
    normal::quantile_above(one_bin)
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNTS: MeanCounts = MeanCounts {
        background: 50.0,
        signal: 40.0,
        background_bins: 7,
    };

    #[test]
    fn equation_5() {
        assert_eq!(threshold(16.0, 2.0), 24.0);
    }

    #[test]
    fn with_one_background_bin_the_hit_probability_has_a_closed_form() {
        // The difference of two Gaussians is a Gaussian.
        for (background, signal) in [(100.0, 1.0), (100.0, 30.0), (400.0, 90.0)] {
            let counts = MeanCounts {
                background,
                signal,
                background_bins: 1,
            };
            let closed = normal::below(signal / (2.0 * background + signal).sqrt());
            assert!((counts.hit_probability() - closed).abs() < 1e-12);
        }
    }

    #[test]
    fn without_a_signal_each_bin_is_the_highest_equally_often() {
        let counts = MeanCounts {
            background: 400.0,
            signal: 0.0,
            background_bins: 127,
        };
        assert!((counts.hit_probability() * 128.0 - 1.0).abs() < 1e-10);
    }

    #[test]
    fn alpha_max_is_the_inverse_of_equation_8() {
        for expected in [1e-9, 1e-3, 0.1, 0.5, 0.9] {
            let alpha = COUNTS.alpha_max(expected).unwrap();
            let found = COUNTS.true_positive_rate(alpha);
            assert!((found / expected - 1.0).abs() < 1e-9, "{expected}: {found}");
        }
        assert_eq!(COUNTS.alpha_max(COUNTS.hit_probability()), None);
    }

    #[test]
    fn the_second_line_of_equation_9_holds_with_the_share_of_the_signal() {
        // SNR = N·A/√λ_b; a quarter of the signal in the peak bin.
        let share = 0.25;
        let snr = COUNTS.signal / share / COUNTS.background.sqrt();
        let deviations = normal::quantile_above(0.5 / COUNTS.hit_probability());
        let root = (1.0 + share * snr / COUNTS.background.sqrt()).sqrt();
        let second = share * snr + deviations * root;
        assert!((COUNTS.alpha_max(0.5).unwrap() - second).abs() < 1e-12);
    }

    #[test]
    fn alpha_min_is_the_inverse_of_equation_10() {
        for bins in [1, 7, 127, 1023] {
            for exponent in 1..200 {
                let expected = 10f64.powi(-exponent);
                let found = false_positive_rate(alpha_min(expected, bins), bins);
                assert!((found / expected - 1.0).abs() < 1e-9, "{bins} {expected}");
            }
        }
    }

    #[test]
    fn both_rates_fall_with_alpha() {
        let alphas: Vec<f64> = (0..100).map(|step| f64::from(step) / 10.0).collect();
        let rates = COUNTS.roc(&alphas);
        assert_eq!(rates.len(), alphas.len());
        for pair in rates.windows(2) {
            assert!(pair[1].0 < pair[0].0 && pair[1].1 < pair[0].1, "{pair:?}");
        }
        // The true positive rate stays below the hit probability.
        assert!(COUNTS.roc(&[0.0])[0].1 < COUNTS.hit_probability());
    }
}
