//! The quantities of [`gaussian`](crate::gaussian) with Poisson counts, exact
//! as long as the background is known and no counter is full.
//!
//! The peak is the highest bin, as in the core; the lowest index wins a tie.

use crate::counts::poisson::Poisson;
use crate::gaussian::threshold;

/// Eq. 7 with Poisson counts of the means `means`: the probability that bin
/// `target` is the peak. `None` if there is no such bin.
#[must_use]
pub fn hit_probability(means: &[f64], target: usize) -> Option<f64> {
    peak_at_least(means, target, 0)
}

/// `P_true` with Poisson counts: the probability that bin `target` is the peak
/// *and* exceeds the threshold of Eq. 5 at a background of `background` a bin.
/// The paper multiplies the two probabilities as if they were independent.
/// `None` if there is no such bin.
#[must_use]
pub fn true_positive_rate(
    means: &[f64],
    target: usize,
    background: f64,
    alpha: f64,
) -> Option<f64> {
    peak_at_least(means, target, lowest_above(threshold(background, alpha)))
}

/// Eq. 8 with Poisson counts: the probability that a bin of mean `signal +
/// background` exceeds the threshold of Eq. 5.
#[must_use]
pub fn pass_probability(background: f64, signal: f64, alpha: f64) -> f64 {
    Poisson::new(signal + background).at_least(lowest_above(threshold(background, alpha)))
}

/// Eq. 10 with Poisson counts: the probability that one of `background_bins`
/// of mean `background` exceeds the threshold of Eq. 5.
#[must_use]
pub fn false_positive_rate(background: f64, alpha: f64, background_bins: u32) -> f64 {
    let lowest = lowest_above(threshold(background, alpha));
    Poisson::new(background).highest_at_least(lowest, background_bins)
}

/// The lowest count strictly above `level`.
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
pub fn lowest_above(level: f64) -> u32 {
    (level as u32).saturating_add(1) // rounded down; no level is negative
}

/// The probability that bin `target` is the peak and holds `lowest` or more.
fn peak_at_least(means: &[f64], target: usize, lowest: u32) -> Option<f64> {
    let target_law = Poisson::new(*means.get(target)?);
    // Bins of equal mean share a law: (mean, law, bins before the target, bins after).
    let mut others: Vec<(f64, Poisson, u32, u32)> = Vec::new();
    for (bin, &mean) in means.iter().enumerate() {
        if bin == target {
            continue;
        }
        let (before, after) = if bin < target { (1, 0) } else { (0, 1) };
        if let Some(same) = others.iter_mut().find(|other| other.0 == mean) {
            same.2 += before;
            same.3 += after;
        } else {
            others.push((mean, Poisson::new(mean), before, after));
        }
    }
    let ln_lower = |count: u32| -> f64 {
        let one = |(_, law, before, after): &(f64, Poisson, u32, u32)| {
            // A bin before the target wins a tie. 0 · ln 0 counts as 0.
            let times = |bins: u32, ln: f64| if bins == 0 { 0.0 } else { f64::from(bins) * ln };
            times(*before, law.ln_below(count)) + times(*after, law.ln_below(count + 1))
        };
        others.iter().map(one).sum()
    };
    let probability = |count| target_law.mass(count) * ln_lower(count).exp();
    Some((lowest..=target_law.last()).map(probability).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_histogram_has_one_peak() {
        let means = [0.3, 2.0, 2.0, 5.0, 2.0, 0.3, 2.0, 2.0];
        let hit = |target| hit_probability(&means, target).unwrap();
        let sum: f64 = (0..means.len()).map(hit).sum();
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
        // The lower bin wins a tie.
        assert!(hit(1) > hit(2) && hit(2) > hit(4));
        assert_eq!(hit_probability(&means, 8), None);
    }

    #[test]
    fn two_bins_of_few_photons_by_hand() {
        // Means ln 2: an empty bin has probability 1/2. Bin 1 is the peak only
        // if it holds more than bin 0.
        let mean = 2f64.ln();
        let law = Poisson::new(mean);
        let tie: f64 = (0..40).map(|count| law.mass(count).powi(2)).sum();
        let found = hit_probability(&[mean, mean], 1).unwrap();
        assert!((found - (1.0 - tie) / 2.0).abs() < 1e-14);
    }

    #[test]
    fn hit_and_pass_are_not_independent() {
        // The true positive rate lies between the product and the smaller one.
        let mut means = [10.0; 8];
        means[3] = 22.0;
        for alpha in [0.5, 1.0, 2.0, 4.0] {
            let hit = hit_probability(&means, 3).unwrap();
            let pass = pass_probability(10.0, 12.0, alpha);
            let both = true_positive_rate(&means, 3, 10.0, alpha).unwrap();
            assert!(hit * pass < both && both < hit.min(pass), "{alpha}");
        }
    }

    #[test]
    fn a_count_at_the_threshold_does_not_pass() {
        // 16 + 2·4 = 24: from 25 on.
        let law = Poisson::new(16.0);
        assert_eq!(pass_probability(16.0, 0.0, 2.0), law.at_least(25));
        let false_positive = false_positive_rate(16.0, 2.0, 1);
        assert!((false_positive / law.at_least(25) - 1.0).abs() < 1e-12);
    }
}
