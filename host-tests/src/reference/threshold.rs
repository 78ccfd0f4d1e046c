//! The threshold of a significant peak (sec. II-A, Eq. 5).

/// The threshold `I_th = λ_b + α √λ_b` (Eq. 5): `alpha` standard deviations of
/// the shot noise above the background.
#[must_use]
pub fn threshold(background: f64, alpha: f64) -> f64 {
    background + alpha * background.sqrt()
}

/// Whether a peak is significant: its count lies strictly above the threshold
/// (sec. II-A, Eq. 5; `h > I_th` in Eq. 8) and is at least `minimum_count`.
///
/// The minimum count is not in the paper; zero turns it off. Eq. 5 rests on
/// the background being large enough for the normal approximation
/// (sec. II-C: `λ_b ≥ 30`); with no background at all the threshold is zero
/// and a single photon would exceed it.
#[must_use]
pub fn stands_clear(peak_count: f64, background: f64, alpha: f64, minimum_count: f64) -> bool {
    peak_count > threshold(background, alpha) && peak_count >= minimum_count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equation_5() {
        // 16 + 2 * 4
        assert_eq!(threshold(16.0, 2.0), 24.0);
        // 100 + 3.5 * 10
        assert_eq!(threshold(100.0, 3.5), 135.0);
        assert_eq!(threshold(0.0, 8.0), 0.0);
        // The root is not rounded: 2 + 1.41421356...
        assert!((threshold(2.0, 1.0) - 3.414_213_562_373_095).abs() < 1e-12);
    }

    #[test]
    fn a_peak_at_the_threshold_does_not_stand_clear() {
        // The threshold is 24.
        assert!(!stands_clear(24.0, 16.0, 2.0, 0.0));
        assert!(stands_clear(25.0, 16.0, 2.0, 0.0));
    }

    #[test]
    fn a_peak_at_the_minimum_count_does() {
        // The threshold is 24, so that the minimum count decides.
        assert!(stands_clear(30.0, 16.0, 2.0, 30.0));
        assert!(!stands_clear(29.0, 16.0, 2.0, 30.0));
    }

    #[test]
    fn nothing_does_not_stand_clear_of_nothing() {
        // 0 > 0 + 2 * 0 is false.
        assert!(!stands_clear(0.0, 0.0, 2.0, 0.0));
        assert!(stands_clear(1.0, 0.0, 2.0, 0.0));
    }
}
