//! Whether a count is what a probability gives, for Monte-Carlo tests.

/// Whether `seen` of `times` is what a probability of `probability` gives, in
/// the interval that holds all but `level` of the binomial distribution.
#[must_use]
pub fn plausible(seen: u32, times: u32, probability: f64, level: f64) -> bool {
    tail(seen, times, probability) >= level / 2.0
}

/// The probability of a count as far out as `seen`, on its side.
fn tail(seen: u32, times: u32, probability: f64) -> f64 {
    if probability <= 0.0 || probability >= 1.0 {
        let certain = if probability <= 0.0 { 0 } else { times };
        return f64::from(u8::from(seen == certain));
    }
    let ln_factorials: Vec<f64> = (0..=times)
        .scan(0.0, |sum, factor| {
            *sum += f64::from(factor.max(1)).ln();
            Some(*sum)
        })
        .collect();
    let ln_factorial = |count: u32| ln_factorials[count as usize];
    let mass = |count: u32| {
        let ways = ln_factorial(times) - ln_factorial(count) - ln_factorial(times - count);
        let misses = f64::from(times - count) * (-probability).ln_1p();
        (ways + f64::from(count) * probability.ln() + misses).exp()
    };
    if f64::from(seen) > f64::from(times) * probability {
        (seen..=times).map(mass).sum()
    } else {
        (0..=seen).map(mass).sum()
    }
}

/// Whether `first` of `first_times` and `second` of `second_times` may have the
/// same probability: given both together, how they are shared out is (at most
/// as wide as) binomial.
#[must_use]
pub fn alike(first: u32, first_times: u32, second: u32, second_times: u32, level: f64) -> bool {
    let share = f64::from(second_times) / f64::from(first_times + second_times);
    plausible(second, first + second, share, level)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_by_hand() {
        // Ten tosses: 0 heads have 1/1024, 1 or fewer 11/1024.
        assert!((tail(1, 10, 0.5) - 11.0 / 1024.0).abs() < 1e-12);
        assert!((tail(9, 10, 0.5) - 11.0 / 1024.0).abs() < 1e-12);
        assert!(plausible(1, 10, 0.5, 0.02) && !plausible(1, 10, 0.5, 0.03));
        assert!(plausible(0, 10, 0.0, 0.01) && !plausible(1, 10, 0.0, 0.01));
        assert!(plausible(10, 10, 1.0, 0.01) && !plausible(9, 10, 1.0, 0.01));
    }

    #[test]
    fn two_counts_of_one_probability_are_alike() {
        assert!(alike(100, 1000, 210, 2000, 0.01));
        assert!(!alike(100, 1000, 300, 2000, 0.01));
        assert!(alike(0, 1000, 0, 2000, 0.01));
    }
}
