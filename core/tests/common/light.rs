//! Photons of light that is even over all bins.

use rand_core::Rng;
use rand_distr::{Distribution, Poisson};

/// Appends the TDC codes of a Poisson number of photons, each in any of `BINS` bins, a power of two.
pub fn draw<const BINS: usize>(photons: &Poisson<f64>, rng: &mut impl Rng, codes: &mut Vec<u16>) {
    const { assert!(BINS.is_power_of_two() && BINS <= 1024) };
    let end = codes.len() + photons.sample(rng) as usize;
    while codes.len() < end {
        let random = rng.next_u64();
        codes.extend([0, 16, 32, 48].map(|shift| (random >> shift) as u16 & (BINS as u16 - 1)));
    }
    codes.truncate(end);
}
