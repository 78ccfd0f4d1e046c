//! Poisson counts in integers, by inverse transform.
//!
//! One 32-bit random number is compared with the cumulative probabilities
//! `P(0)`, `P(0) + P(1)`, ..., where `P(0) = e^-mean` is worked out once and
//! `P(n) = P(n-1) · mean / n` as far as needed; all have 32 fractional
//! bits. For the small means of single photons one comparison is usually enough.
//!
//! Every cumulative probability is within 2⁻²⁶ of the exact one for means up to
//! [`Poisson::MAX_MEAN`]. Counts with a probability below 2⁻³³ are never drawn.

use dtof_core::fixed::types::U8F24;
use rand_core::Rng;

/// Counts with a mean of at most [`Self::MAX_MEAN`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Poisson {
    mean: U8F24,
    /// e^-mean with 32 fractional bits; 1 is 2³².
    none: u64,
}

impl Poisson {
    /// The largest mean.
    pub(super) const MAX_MEAN: U8F24 = U8F24::lit("4");

    /// Counts with this mean, or `None` above [`Self::MAX_MEAN`].
    pub(super) const fn new(mean: U8F24) -> Option<Self> {
        if mean.to_bits() > Self::MAX_MEAN.to_bits() {
            return None;
        }
        Some(Self {
            mean,
            none: exp_of_minus(mean.to_bits()),
        })
    }

    /// Draws a count.
    pub(super) fn draw(&self, random: &mut impl Rng) -> u32 {
        let drawn = u64::from(random.next_u32());
        let mut count = 0;
        for cumulative in self.cumulative() {
            if drawn < cumulative {
                break;
            }
            count += 1;
        }
        count
    }

    /// The probabilities of at most 0, 1, 2, ... photons with 32 fractional
    /// bits, as far as there are any.
    fn cumulative(&self) -> impl Iterator<Item = u64> {
        let mean = u64::from(self.mean.to_bits());
        let (mut probability, mut sum, mut count) = (self.none, 0, 0);
        core::iter::from_fn(move || {
            if probability == 0 {
                return None;
            }
            sum += probability;
            count += 1;
            // 33 + 27 bits.
            let divisor = count << U8F24::FRAC_NBITS;
            probability = (probability * mean + divisor / 2).checked_div(divisor)?;
            Some(sum)
        })
    }
}

/// e^-x with 32 fractional bits, rounded to the nearest, of an x of 24
/// fractional bits that is at most 4.
///
/// The series is taken at x/8, which is at most 1/2, with 60 fractional bits:
/// the 21st term is below 2⁻⁶⁰, and squaring three times leaves an error below
/// 2⁻⁵².
const fn exp_of_minus(x: u32) -> u64 {
    const FRACTION: u32 = 60;
    let eighth = (x as i128) << (FRACTION - 24 - 3);
    let mut term = 1 << FRACTION;
    let mut sum = term;
    let mut n = 1;
    while n <= 20 {
        term = -((term * eighth) >> FRACTION) / n;
        sum += term;
        n += 1;
    }
    let mut squarings = 0;
    while squarings < 3 {
        sum = (sum * sum) >> FRACTION;
        squarings += 1;
    }
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 0 to 1, with 32 fractional bits"
    )]
    let rounded = ((sum + (1 << (FRACTION - 33))) >> (FRACTION - 32)) as u64;
    rounded
}

#[cfg(test)]
#[allow(
    clippy::cast_precision_loss,
    clippy::float_arithmetic,
    clippy::unwrap_used,
    reason = "compared with the formula"
)]
mod tests {
    use proptest::prelude::*;
    use rand_pcg::Pcg32;

    use super::*;

    proptest! {
        /// The bound that the module states, 2⁻²⁶, against the formula in floating
        /// point.
        #[test]
    fn cumulative_probabilities_are_exact(mean in 0u32..=4 << 24) {
            let mean = U8F24::from_bits(mean);
            let lambda: f64 = mean.to_num();
            let (mut probability, mut sum, mut count) = ((-lambda).exp(), 0.0, 0);
            for cumulative in Poisson::new(mean).unwrap().cumulative() {
                sum += probability;
                count += 1;
                probability *= lambda / f64::from(count);
                let error = cumulative as f64 / 2f64.powi(32) - sum;
                prop_assert!(error.abs() < 2f64.powi(-26), "{error:e} at {count}");
            }
            // What is never drawn has that much of a probability at most, too.
            prop_assert!(1.0 - sum < 2f64.powi(-26));
            prop_assert!(count <= 24);
        }
    }

    /// Beside halves, which floating point may round the other way.
    #[test]
    fn e_to_the_minus_x_is_rounded_to_the_nearest() {
        for x in (0..=4 << 24).step_by(9973).chain([1, 4 << 24]) {
            let exact = (f64::from(x) / -f64::from(1 << 24)).exp() * 2f64.powi(32);
            let error = (exp_of_minus(x) as f64 - exact).abs();
            assert!(error < 0.5 + 2f64.powi(-15), "{x}: {error}");
        }
    }

    /// Counts with a probability of 2⁻³³ or more are drawn.
    #[test]
    fn the_last_count_is_the_last_that_rounds_to_a_number() {
        for hundredths in 1..=400 {
            let mean = U8F24::from_num(f64::from(hundredths) / 100.0);
            let lambda: f64 = mean.to_num();
            let (mut probability, mut likely) = ((-lambda).exp(), 0_u32);
            // Each step rounds once more.
            while probability > 1.2 * 2f64.powi(-33) {
                likely += 1;
                probability *= lambda / f64::from(likely);
            }
            let drawn = Poisson::new(mean).unwrap().cumulative().count();
            assert!(
                drawn >= usize::try_from(likely).unwrap(),
                "{mean}: {drawn} of {likely}"
            );
        }
    }

    #[test]
    fn counts_have_the_mean_and_the_variance_of_their_rate() {
        const DRAWS: u32 = 1_000_000;
        for rate in ["0", "0.001", "0.1", "1", "2.5", "4"] {
            let poisson = Poisson::new(U8F24::from_str(rate).unwrap()).unwrap();
            let mut random = Pcg32::new(1, 2);
            let (mut sum, mut squares) = (0.0, 0.0);
            for _ in 0..DRAWS {
                let count = f64::from(poisson.draw(&mut random));
                sum += count;
                squares += count * count;
            }
            let draws = f64::from(DRAWS);
            let lambda: f64 = poisson.mean.to_num();
            let mean = sum / draws;
            let variance = squares / draws - mean * mean;
            // Five standard deviations of a mean and of a variance of Poisson counts.
            let mean_limit = 5.0 * (lambda / draws).sqrt();
            let variance_limit = 5.0 * ((lambda + 2.0 * lambda * lambda) / draws).sqrt();
            assert!((mean - lambda).abs() <= mean_limit, "{rate}: mean {mean}");
            let error = (variance - lambda).abs();
            assert!(error <= variance_limit, "{rate}: variance {variance}");
        }
    }
}
