//! False alarms of one look, exactly: background only, the quadrant estimate,
//! the core's tie-break, counters and threshold.
//!
//! Halves and quadrants are independent. Let the peak lie in one half, with that half's
//! maximum `h` as its count. The other half has the quadrant maxima `a` and `b`: the smaller
//! is the background `q`, the larger must not exceed `h`. The rule fires from a peak count
//! of `f(q)` on, so
//!
//! ```text
//! P = Σ over q, m ≥ q of P(min(a, b) = q, max(a, b) = m) · P(h ≥ max(m, f(q)))
//! ```
//!
//! for the lower half, which wins ties, and with `m + 1` instead of `m` for the upper half.
//! With F the distribution of one bin, `a` and `b` have the distribution F^(n/4), `h` has
//! F^(n/2).

use dtof_core::paper::Threshold;
use dtof_core::{Count, Count10, CounterWidth};

use crate::counts::poisson::Poisson;
use crate::gaussian;
use crate::known_background::lowest_above;

/// The maxima of quadrants and halves of one histogram without a target.
///
/// Every sum is of positive terms, so that a probability of 1e-15 is as precise
/// as one of 1/2.
#[derive(Clone, Debug)]
pub struct SingleLook {
    /// P(a quadrant's maximum = k).
    quadrant: Vec<f64>,
    /// P(a quadrant's maximum > k).
    quadrant_above: Vec<f64>,
    /// P(a half's maximum ≥ k).
    half: Vec<f64>,
    /// Over all maxima m ≥ k of the other quadrant: P(m) · (P(h ≥ m) + P(h > m)).
    exceeded: Vec<f64>,
}

impl SingleLook {
    /// For `bins` bins (a power of two from 8), `mean` background photons a bin and 10-bit
    /// counters.
    #[must_use]
    pub fn new(bins: u32, mean: f64) -> Self {
        let mut law = Poisson::new(mean);
        if law.last() > Count10::MAX {
            law = Poisson::saturating(mean, Count10::MAX);
        }
        let counts = 0..=law.last();
        let over = |value: &dyn Fn(u32) -> f64| counts.clone().map(value).collect::<Vec<f64>>();
        let half = over(&|k| law.highest_at_least(k, bins / 2));
        let quadrant = over(&|k| law.highest_mass(k, bins / 4));
        let mut sum = 0.0;
        let mut half_above = 0.0;
        let mut exceeded: Vec<f64> = quadrant
            .iter()
            .zip(&half)
            .rev()
            .map(|(mass, half)| {
                sum += mass * (half + half_above);
                half_above = *half;
                sum
            })
            .collect();
        exceeded.reverse();
        Self {
            quadrant_above: over(&|k| law.highest_at_least(k + 1, bins / 4)),
            quadrant,
            half,
            exceeded,
        }
    }

    /// The probability of an event if, at a background of `q`, the rule fires from a peak
    /// count of `fires_from(q)` on. That count must be above `q`.
    #[must_use]
    pub fn probability(&self, fires_from: impl Fn(u32) -> u32) -> f64 {
        let mut sum = 0.0;
        for (q, &mass) in (0..).zip(&self.quadrant) {
            let lowest = fires_from(q) as usize;
            // Counts beyond the table have no probability.
            let Some(&half) = self.half.get(lowest) else {
                continue;
            };
            if mass == 0.0 {
                continue;
            }
            // Cases for the maximum of the other quadrant: equal to q, between q and the
            // lowest count that fires, or at least that count. Either quadrant may be the
            // smaller one.
            let between = self.quadrant_above[q as usize] - self.quadrant_above[lowest - 1];
            sum += mass * (mass * 2.0 * half);
            sum += 2.0 * mass * (between.max(0.0) * 2.0 * half + self.exceeded[lowest]);
        }
        sum
    }

    /// With the core's threshold: integer root, α in 1/256, minimum count.
    #[must_use]
    pub fn false_alarm_probability(&self, threshold: &Threshold) -> f64 {
        self.probability(|background| fires_from(threshold, background))
    }

    /// With the threshold of Eq. 5 in real numbers.
    #[must_use]
    pub fn real_valued_probability(&self, alpha: f64, minimum_count: u32) -> f64 {
        self.probability(|background| {
            let level = gaussian::threshold(background.into(), alpha);
            lowest_above(level).max(minimum_count)
        })
    }
}

/// The lowest peak count with which the core's threshold is exceeded at a
/// background of `background`.
#[must_use]
pub fn fires_from(threshold: &Threshold, background: u32) -> u32 {
    let level = threshold.level::<Count10>(Count::saturating(background));
    let above: u32 = level.to_num::<u32>() + 1; // the level rounded down, and one
    above.max(threshold.minimum_count().raw())
}

#[cfg(test)]
mod tests {
    use dtof_core::fixed::types::U8F8;

    use super::*;

    fn threshold(alpha: f64, minimum_count: u32) -> Threshold {
        Threshold::new(U8F8::from_num(alpha), Count::saturating(minimum_count))
    }

    #[test]
    fn fires_from_is_where_the_core_fires() {
        for alpha in [0.0, 1.0, 2.5, 3.996, 8.0, 255.0] {
            for minimum_count in [1, 5] {
                let threshold = threshold(alpha, minimum_count);
                for background in 0..=1023 {
                    let lowest = fires_from(&threshold, background);
                    let fires = |peak| {
                        let [peak, background] = [peak, background].map(Count::saturating);
                        threshold.is_exceeded::<Count10>(peak, background)
                    };
                    assert!(fires(lowest) && !fires(lowest - 1), "{alpha} {background}");
                    assert!(lowest > background);
                }
            }
        }
    }

    /// All histograms of 8 bins with up to five photons a bin, one by one.
    #[test]
    fn agrees_with_all_histograms_of_few_photons() {
        use dtof_core::rule::detect;
        use dtof_core::{DepthEstimator, Histogram, PaperRule, RangeGate};
        let mean = 0.2;
        let law = Poisson::new(mean);
        let rule = PaperRule::new(U8F8::lit("0.5"), Count::saturating(1));
        let (gate, estimator) = (RangeGate::full(), DepthEstimator::default());
        let (mut expected, mut left_out) = (0.0, 1.0);
        for index in 0..6u32.pow(8) {
            let mut digits = index;
            let counts: [u32; 8] = std::array::from_fn(|_| {
                let digit = digits % 6;
                digits /= 6;
                digit
            });
            let probability: f64 = counts.iter().map(|&count| law.mass(count)).product();
            let mut histogram = Histogram::<8>::new();
            histogram.add_frame(&counts, &gate);
            left_out -= probability;
            if detect(&histogram, &gate, &rule, &estimator).is_some() {
                expected += probability;
            }
        }
        let found = SingleLook::new(8, mean).false_alarm_probability(rule.threshold());
        // Six photons in one of the bins have a probability of 6e-7.
        assert!(left_out < 1e-6);
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        assert!(0.1 < found && found < 0.9, "{found}");
    }

    #[test]
    fn without_alpha_only_a_peak_as_high_as_both_quadrants_does_not_fire() {
        for mean in [0.1, 3.0, 40.0, 600.0] {
            let law = Poisson::saturating(mean, 1023);
            let level = |k| law.highest_mass(k, 64) * law.highest_mass(k, 32).powi(2);
            let silent: f64 = (0..=1023).map(level).sum();
            let fired = SingleLook::new(128, mean).false_alarm_probability(&threshold(0.0, 1));
            assert!(
                (fired + silent - 1.0).abs() < 1e-9,
                "{mean}: {fired} {silent}"
            );
        }
    }

    #[test]
    fn small_probabilities_are_smooth_down_to_1e_15_and_beyond() {
        for mean in [2.0, 30.0, 300.0] {
            let look = SingleLook::new(128, mean);
            let mut before = f64::INFINITY;
            for step in 4..60 {
                let found = look.real_valued_probability(f64::from(step) / 4.0, 1);
                assert!(0.0 < found && found <= before, "{mean} {step}: {found}");
                before = found;
            }
            assert!(before < 1e-15, "{mean}: {before}");
        }
    }

    /// The figures of `docs/theory.md`.
    #[test]
    fn the_integer_root_fires_more_often() {
        for (mean, integer, real) in [
            (0.4, 0.00015, 0.00013),
            (2.0, 0.00193, 0.00010),
            (20.0, 0.00004, 0.00001),
        ] {
            let look = SingleLook::new(128, mean);
            let found = look.false_alarm_probability(&threshold(4.0, 5));
            assert!((found - integer).abs() < 5e-6, "{mean}: {found}");
            let found = look.real_valued_probability(4.0, 5);
            assert!((found - real).abs() < 5e-6, "{mean}: {found}");
        }
    }

    #[test]
    fn full_counters_do_not_fire() {
        let look = SingleLook::new(128, 1500.0);
        assert!(look.false_alarm_probability(&threshold(1.0, 5)) < 1e-12);
    }
}
