//! Significance of a photon count, and quantiles.
//!
//! The Chernoff bound for a Poisson number of mean `m`: the probability of `k` or more, if `k > m`, and
//! of `k` or fewer, if `k < m`, is at most `exp(-(k·ln(k/m) - (k - m)))`. The bound always holds, so a
//! count is at least as significant as it says.

/// The exponent of the Chernoff bound: the probability of `count`, or of a count farther from `mean`,
/// is at most `exp(-exponent)`.
#[must_use]
pub fn chernoff_exponent(count: f64, mean: f64) -> f64 {
    if mean <= 0.0 {
        return if count > 0.0 { f64::INFINITY } else { 0.0 };
    }
    let entropy = if count > 0.0 {
        count * (count / mean).ln()
    } else {
        0.0
    };
    (entropy - (count - mean)).max(0.0)
}

/// Whether `count` is above `mean`, and so far that chance explains it less than once in `one_in`.
#[must_use]
pub fn is_surely_more(count: f64, mean: f64, one_in: f64) -> bool {
    count > mean && chernoff_exponent(count, mean) > one_in.ln()
}

/// Whether the bins `counts`, corrected for pile-up, hold more than `background` a bin, and so much that chance
/// explains it less than once in `one_in`. The TDC was `live` in so much of the laser cycles: that share of both was
/// recorded.
#[must_use]
pub fn are_surely_more(counts: &[f64], live: &[f64], background: f64, one_in: f64) -> bool {
    let recorded = counts.iter().zip(live).map(|(count, live)| count * live);
    is_surely_more(
        recorded.sum(),
        background * live.iter().sum::<f64>(),
        one_in,
    )
}

/// The same for a count below `mean`.
#[must_use]
pub fn is_surely_less(count: f64, mean: f64, one_in: f64) -> bool {
    count < mean && chernoff_exponent(count, mean) > one_in.ln()
}

/// The median, the lower of two middle values; 0 if there are none.
#[must_use]
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    quantile(values, 0.5)
}

/// The value that a `share` of `values` lies below; 0 if there are none.
#[must_use]
pub fn quantile(values: impl IntoIterator<Item = f64>, share: f64) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    let Some(last) = values.len().checked_sub(1) else {
        return 0.0;
    };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let index = (last as f64 * share) as usize;
    *values.select_nth_unstable_by(index, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_light::counts::poisson::Poisson;

    #[test]
    fn the_bound_is_never_below_the_probability() {
        for mean in [0.03, 0.5, 4.0, 77.0, 900.0] {
            let law = Poisson::new(mean);
            let mut below = 0.0;
            for count in 0..law.last().min(1500) {
                let bound = (-chernoff_exponent(count.into(), mean)).exp() * (1.0 + 1e-9);
                below += law.mass(count);
                let probability = if f64::from(count) > mean {
                    law.at_least(count)
                } else {
                    below
                };
                assert!(
                    probability <= bound,
                    "{mean} {count}: {probability} {bound}"
                );
            }
        }
    }

    #[test]
    fn nothing_is_more_than_nothing() {
        assert!(!is_surely_more(0.0, 0.0, 1e6) && !is_surely_less(0.0, 0.0, 1e6));
        assert!(is_surely_more(1.0, 0.0, 1e6) && is_surely_less(0.0, 20.0, 1e6));
        assert_eq!(median([3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median([]), 0.0);
    }
}
