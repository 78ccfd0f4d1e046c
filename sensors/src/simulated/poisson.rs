//! Poisson counts in integers, by inverse transform.
//!
//! One 32-bit random number is compared with the cumulative probabilities
//! `P(0)`, `P(0) + P(1)`, ..., where `P(0) = e^-mean` is worked out once and
//! `P(n) = P(n-1) · mean / n` as far as it is needed; all have 32 fractional
//! bits. For the small means of single photons that is mostly one comparison.
//!
//! Every cumulative probability is within 2⁻²⁶ of the true one for means up to
//! [`Poisson::MAX_MEAN`]; what lies beyond the last count that has a probability
//! of 2⁻³³ or more is never drawn.

use dtof_core::fixed::types::U8F24;
use rand_core::Rng;

/// Counts with a mean of at most [`Self::MAX_MEAN`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Poisson {
    mean: U8F24,
    /// e^-mean with 32 fractional bits; 1 is 2³².
    none: u64,
}

impl Poisson {
    /// The largest mean.
    pub const MAX_MEAN: U8F24 = U8F24::lit("4");

    /// Counts with this mean, or `None` above [`Self::MAX_MEAN`].
    #[must_use]
    pub const fn new(mean: U8F24) -> Option<Self> {
        if mean.to_bits() > Self::MAX_MEAN.to_bits() {
            return None;
        }
        Some(Self {
            mean,
            none: exp_of_minus(mean.to_bits()),
        })
    }

    /// The mean.
    #[must_use]
    pub const fn mean(&self) -> U8F24 {
        self.mean
    }

    /// Draws a count.
    pub fn draw(&self, random: &mut impl Rng) -> u32 {
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
    pub fn cumulative(&self) -> impl Iterator<Item = u64> {
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
            probability = (probability * mean + divisor / 2) / divisor;
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
