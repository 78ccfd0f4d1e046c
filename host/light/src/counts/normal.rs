//! The standard normal distribution, accurate in both tails.

use std::f64::consts::{PI, SQRT_2};

use libm::erfc;

/// Φ(x), the probability below `x`.
#[must_use]
pub fn below(x: f64) -> f64 {
    erfc(-x / SQRT_2) / 2.0
}

/// 1 − Φ(x), the probability above `x`, to full relative precision.
#[must_use]
pub fn above(x: f64) -> f64 {
    erfc(x / SQRT_2) / 2.0
}

/// ln Φ(x), where Φ(x) itself would round to 1 or to 0.
#[must_use]
pub fn ln_below(x: f64) -> f64 {
    if x > 0.0 {
        (-above(x)).ln_1p()
    } else if x > -35.0 {
        below(x).ln()
    } else {
        // The first terms of the asymptotic series; the next is 3/x⁴ < 2e-6 of
        // a logarithm of -600.
        -x * x / 2.0 - (-x * (2.0 * PI).sqrt()).ln() - 1.0 / (x * x)
    }
}

/// The `x` with a probability of `p` above it: Φ⁻¹(1 − p), exact even where
/// 1 − p rounds to 1. `p` must lie between 0 and 1.
#[must_use]
pub fn quantile_above(p: f64) -> f64 {
    if p > 0.5 {
        return -quantile_above(1.0 - p);
    }
    // Newton's method on the logarithm of the tail, which is concave. The start lies above
    // the root, because 1 − Φ(x) ≤ exp(−x²/2)/2, so the iteration descends to the root
    // without passing it (up to rounding).
    let mut x = (-2.0 * (2.0 * p).ln()).sqrt();
    for _ in 0..100 {
        let density = (-x * x / 2.0).exp() / (2.0 * PI).sqrt();
        let step = (p / above(x)).ln() * above(x) / density;
        x -= step;
        if step <= 1e-15 * x {
            break;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Abramowitz and Stegun, table 26.1 and 26.2.
    #[test]
    fn tabulated_values() {
        for (x, tail) in [
            (0.0, 0.5),
            (1.0, 0.158_655_253_931_457_05),
            (3.0, 1.349_898_031_630_094_6e-3),
            (5.0, 2.866_515_718_791_939_4e-7),
            (8.0, 6.220_960_574_271_784e-16),
        ] {
            assert!((above(x) / tail - 1.0).abs() < 1e-12, "{x} {}", above(x));
            assert!((below(-x) / tail - 1.0).abs() < 1e-12, "{x}");
            assert!((ln_below(-x) - tail.ln()).abs() < 1e-12 * x.max(1.0), "{x}");
        }
    }

    #[test]
    fn the_logarithm_is_smooth_where_its_form_changes() {
        for x in [0.0, -35.0_f64] {
            let (left, right) = (ln_below(x - 1e-9), ln_below(x + 1e-9));
            let slope = right - left;
            assert!((0.0..2e-5).contains(&slope), "{x}: {left} {right}");
        }
        assert!((ln_below(9.0) + above(9.0)).abs() < 1e-33);
    }

    #[test]
    fn the_quantile_is_the_inverse() {
        for exponent in 1..300 {
            let p = 10f64.powi(-exponent);
            assert!((above(quantile_above(p)) / p - 1.0).abs() < 1e-9, "{p}");
        }
        for p in [0.3, 0.5, 0.9, 0.999_999] {
            assert!(
                (above(quantile_above(p)) / p - 1.0).abs() < 1e-12,
                "{p} {}",
                above(quantile_above(p))
            );
        }
    }
}
