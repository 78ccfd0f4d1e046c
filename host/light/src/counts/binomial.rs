//! Exact tails of the binomial distribution: confidence intervals, and tests of a count.

use libm::lgamma;

use crate::counts::bisect;

/// The probability of at most `count` successes in `times` trials.
#[must_use]
pub fn at_most(count: u64, times: u64, probability: f64) -> f64 {
    if count >= times || probability <= 0.0 {
        1.0
    } else if probability >= 1.0 {
        0.0
    } else if real(count) > real(times) * probability {
        1.0 - outward(times - count - 1, times, 1.0 - probability)
    } else {
        outward(count, times, probability)
    }
}

/// The probability of at least `count` successes in `times` trials.
#[must_use]
pub fn at_least(count: u64, times: u64, probability: f64) -> f64 {
    times
        .checked_sub(count)
        .map_or(0.0, |misses| at_most(misses, times, 1.0 - probability))
}

/// The probability of at most `count` successes, a count below the mean or hardly above.
/// Summed from the largest term down, so that small probabilities keep their relative precision.
fn outward(count: u64, times: u64, probability: f64) -> f64 {
    let [n, k] = [times, count].map(real);
    let ways = lgamma(n + 1.0) - lgamma(k + 1.0) - lgamma(n - k + 1.0);
    let mut term = (ways + k * probability.ln() + (n - k) * (-probability).ln_1p()).exp();
    let odds = (1.0 - probability) / probability;
    let mut sum = term;
    for count in (1..=count).rev() {
        term *= real(count) / real(times - count + 1) * odds;
        sum += term;
        if term < sum * 1e-17 {
            break;
        }
    }
    sum.min(1.0)
}

fn real(count: u64) -> f64 {
    count as f64
}

/// The Clopper-Pearson interval of a probability, from `seen` successes in `times` trials, with
/// a probability of at most `tail` on either side. 0 to 1 without a trial.
#[must_use]
pub fn interval(seen: u64, times: u64, tail: f64) -> (f64, f64) {
    if times == 0 {
        return (0.0, 1.0);
    }
    let share = real(seen) / real(times);
    (
        bisect(share, 0.0, |low| at_least(seen, times, low) > tail),
        bisect(share, 1.0, |high| at_most(seen, times, high) > tail),
    )
}

/// Whether `seen` successes in `times` trials agree with `probability` in a two-sided test at
/// significance `level`.
#[must_use]
pub fn plausible(seen: u32, times: u32, probability: f64, level: f64) -> bool {
    tail(seen, times, probability) >= level / 2.0
}

/// The probability of a count at least as far from the mean as `seen`, on the same side.
fn tail(seen: u32, times: u32, probability: f64) -> f64 {
    let is_high = f64::from(seen) > f64::from(times) * probability;
    let of = if is_high { at_least } else { at_most };
    of(seen.into(), times.into(), probability)
}

/// Whether `first` of `first_times` and `second` of `second_times` agree with a common
/// probability at significance `level`. Given their sum, the second count has a distribution
/// no wider than a binomial one.
#[must_use]
pub fn alike(first: u32, first_times: u32, second: u32, second_times: u32, level: f64) -> bool {
    let share = f64::from(second_times) / f64::from(first_times + second_times);
    plausible(second, first + second, share, level)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_by_hand() {
        // Ten tosses: 0 heads have 1/1024, 1 or fewer 11/1024.
        assert!((at_most(1, 10, 0.5) - 11.0 / 1024.0).abs() < 1e-12);
        assert!((at_least(9, 10, 0.5) - 11.0 / 1024.0).abs() < 1e-12);
        assert!((at_most(8, 10, 0.5) - 1013.0 / 1024.0).abs() < 1e-12);
        assert!(plausible(1, 10, 0.5, 0.02) && !plausible(1, 10, 0.5, 0.03));
        assert!(plausible(0, 10, 0.0, 0.01) && !plausible(1, 10, 0.0, 0.01));
        assert!(plausible(10, 10, 1.0, 0.01) && !plausible(9, 10, 1.0, 0.01));
    }

    /// Every count, against the sum of all terms.
    #[test]
    fn both_tails_are_all_terms_added_up() {
        for times in [1u64, 2, 7, 40] {
            for probability in [1e-6f64, 0.03, 0.3, 0.5, 0.9, 0.9999] {
                let mut sum = 0.0;
                let mut mass = (1.0 - probability).powf(real(times));
                for count in 0..=times {
                    let above = at_least(count, times, probability);
                    assert!((above - (1.0 - sum)).abs() < 1e-12, "{count} of {times}");
                    sum += mass;
                    let below = at_most(count, times, probability);
                    assert!((below - sum).abs() < 1e-12, "{count} of {times}");
                    mass *=
                        real(times - count) / real(count + 1) * probability / (1.0 - probability);
                }
            }
        }
    }

    /// The probability of that count alone is below the least float.
    #[test]
    fn a_count_far_above_the_mean_is_certain() {
        assert_eq!(at_most(9_000, 10_000, 0.01), 1.0);
    }

    /// None of n: the upper end solves (1 − p)ⁿ = tail. The others are from tables of
    /// the F distribution: 10 of 100 at 95 % lie within 0.0490 and 0.1762.
    #[test]
    fn intervals_are_clopper_and_pearsons() {
        for times in [1u64, 20, 1000, 10_000_000] {
            let expected = 1.0 - 0.005f64.powf(1.0 / real(times));
            let (low, high) = interval(0, times, 0.005);
            assert!(low == 0.0 && (high / expected - 1.0).abs() < 1e-6, "{high}");
            let (low, high) = interval(times, times, 0.005);
            assert!(high == 1.0 && ((1.0 - low) / expected - 1.0).abs() < 1e-6);
        }
        let (low, high) = interval(10, 100, 0.025);
        assert!((low - 0.0490).abs() < 5e-5 && (high - 0.1762).abs() < 5e-5);
        // One rare event is Poisson's: 1 − e^−low = 0.005, and (1 + high)·e^−high = 0.005.
        let (low, high) = interval(1, 1_000_000, 0.005);
        assert!((low * 1e6 / 0.005_012_5 - 1.0).abs() < 1e-3, "{low}");
        assert!((high * 1e6 / 7.430_1 - 1.0).abs() < 1e-3, "{high}");
        assert_eq!(interval(0, 0, 0.005), (0.0, 1.0));
    }

    #[test]
    fn two_counts_of_one_probability_are_alike() {
        assert!(alike(100, 1000, 210, 2000, 0.01));
        assert!(!alike(100, 1000, 300, 2000, 0.01));
        assert!(alike(0, 1000, 0, 2000, 0.01));
    }
}
