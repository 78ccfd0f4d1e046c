//! The tabulated Poisson distribution, and the distribution of the highest of several bins.

use libm::lgamma;

/// A Poisson distribution: all counts with a probability above 1e-280.
///
/// Tails are sums of positive terms from the small end, so both keep their relative
/// precision (1e-11 at a mean of 1000).
#[derive(Clone, Debug)]
pub struct Poisson {
    mass: Vec<f64>,
    at_most: Vec<f64>,
    at_least: Vec<f64>,
}

impl Poisson {
    /// The distribution of mean `mean`, which must not be negative.
    #[must_use]
    pub fn new(mean: f64) -> Self {
        // 37 standard deviations of a Gaussian are 1e-300; the Poisson tail is
        // longer where the mean is small.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let last = (mean + 40.0 * mean.sqrt() + 150.0) as u32;
        let mass = (0..=last).map(|count| mass(count, mean)).collect();
        Self::from_mass(mass)
    }

    /// The distribution of a counter that saturates at `full`.
    #[must_use]
    pub fn saturating(mean: f64, full: u32) -> Self {
        let Self {
            mut mass, at_least, ..
        } = Self::new(mean);
        let full = full as usize;
        if let Some(&more) = at_least.get(full) {
            mass.truncate(full + 1);
            mass[full] = more;
        } else {
            mass.resize(full + 1, 0.0);
        }
        Self::from_mass(mass)
    }

    fn from_mass(mass: Vec<f64>) -> Self {
        let sum = |sum: &mut f64, &mass: &f64| {
            *sum += mass;
            Some(*sum)
        };
        let at_most = mass.iter().scan(0.0, sum).collect();
        let mut at_least: Vec<f64> = mass.iter().rev().scan(0.0, sum).collect();
        at_least.reverse();
        Self {
            mass,
            at_most,
            at_least,
        }
    }

    /// The largest tabulated count.
    #[must_use]
    pub fn last(&self) -> u32 {
        u32::try_from(self.mass.len() - 1).unwrap_or(u32::MAX)
    }

    /// The probability of `count`.
    #[must_use]
    pub fn mass(&self, count: u32) -> f64 {
        self.mass.get(count as usize).copied().unwrap_or(0.0)
    }

    /// The probability of `count` or more.
    #[must_use]
    pub fn at_least(&self, count: u32) -> f64 {
        self.at_least.get(count as usize).copied().unwrap_or(0.0)
    }

    /// ln of the probability of fewer than `count`, precise even where the probability
    /// rounds to 1; −∞ for 0.
    #[must_use]
    pub fn ln_below(&self, count: u32) -> f64 {
        let more = self.at_least(count);
        if more < 0.5 {
            return (-more).ln_1p();
        }
        let below = count.checked_sub(1);
        below.map_or(f64::NEG_INFINITY, |count| self.at_most[count as usize].ln())
    }

    /// The probability that the highest of `bins` bins holds `count` or more.
    #[must_use]
    pub fn highest_at_least(&self, count: u32, bins: u32) -> f64 {
        -(f64::from(bins) * self.ln_below(count)).exp_m1()
    }

    /// The probability that the highest of `bins` bins (at least one) holds exactly `count`.
    #[must_use]
    pub fn highest_mass(&self, count: u32, bins: u32) -> f64 {
        let mass = self.mass(count);
        let (below, at_most) = (self.ln_below(count), self.ln_below(count.saturating_add(1)));
        // Also if all fewer have none.
        if mass == 0.0 {
            return 0.0;
        }
        let bins = f64::from(bins);
        // F(k)ⁿ − F(k−1)ⁿ, with F(k−1)/F(k) = 1 − mass/F(k).
        let ratio = if below == f64::NEG_INFINITY {
            f64::NEG_INFINITY
        } else {
            (-mass / at_most.exp()).ln_1p()
        };
        (bins * at_most).exp() * -(bins * ratio).exp_m1()
    }
}

fn mass(count: u32, mean: f64) -> f64 {
    if mean == 0.0 {
        return f64::from(u8::from(count == 0));
    }
    (f64::from(count) * mean.ln() - mean - lgamma(f64::from(count) + 1.0)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        let law = Poisson::new(2.0);
        assert!((law.mass(3) / (4.0 / 3.0 * (-2f64).exp()) - 1.0).abs() < 1e-14);
        // 1 − e⁻²(1 + 2 + 2) and, in the tail, the first terms of the series.
        assert!((law.at_least(3) - (1.0 - 5.0 * (-2f64).exp())).abs() < 1e-15);
        let term = law.mass(60);
        let tail = term * (1.0 + 2.0 / 61.0 * (1.0 + 2.0 / 62.0 * (1.0 + 2.0 / 63.0)));
        assert!((law.at_least(60) / tail - 1.0).abs() < 1e-4);
        assert_eq!(Poisson::new(0.0).at_least(1), 0.0);
        assert_eq!(Poisson::new(0.0).mass(0), 1.0);
    }

    #[test]
    fn probabilities_sum_to_one() {
        for mean in [1e-3, 0.1, 1.0, 30.0, 300.0, 1000.0] {
            let law = Poisson::new(mean);
            assert!((law.at_least(0) - 1.0).abs() < 1e-10, "{mean}");
            let full = Poisson::saturating(mean, 1023);
            assert!((full.at_least(0) - 1.0).abs() < 1e-10, "{mean}");
            assert_eq!(full.last(), 1023);
            assert_eq!(full.at_least(1024), 0.0);
            for bins in [1, 32, 64] {
                let highest = |count| law.highest_mass(count, bins);
                let sum: f64 = (0..=law.last()).map(highest).sum();
                assert!((sum - 1.0).abs() < 1e-9, "{mean} {bins}: {sum}");
            }
        }
    }

    #[test]
    fn the_highest_of_one_bin_is_the_bin() {
        let law = Poisson::new(7.0);
        for count in 0..150 {
            assert!(
                (law.highest_mass(count, 1) - law.mass(count)).abs() <= 1e-12 * law.mass(count)
            );
            let found = law.highest_at_least(count, 1);
            assert!((found - law.at_least(count)).abs() <= 1e-12 * found);
        }
    }

    #[test]
    fn far_out_the_highest_is_any_of_the_bins() {
        let law = Poisson::new(7.0);
        // At P ≤ 1e-15: the number of bins times the probability of one bin.
        for count in 45..100 {
            let ratio = law.highest_at_least(count, 64) / (64.0 * law.at_least(count));
            assert!((ratio - 1.0).abs() < 1e-9, "{count}");
        }
    }
}
