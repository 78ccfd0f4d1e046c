//! Random numbers that depend on a seed and a place alone.

use dtof_core::PixelAddress;
use rand_core::SeedableRng;
use rand_pcg::Pcg64;

/// The random numbers of one pixel. They depend on the seed and the address
/// alone, so that the order in which threads serve pixels changes nothing.
#[must_use]
pub fn pixel_rng(seed: u64, pixel: PixelAddress) -> Pcg64 {
    // A place of its own in the seed's sequence; the step is odd and about 0.6 of
    // the period, so that places lie far apart.
    const STEP: u128 = 0x9e37_79b9_7f4a_7c15_f39c_c060_5ced_c835;
    let mut rng = Pcg64::seed_from_u64(seed);
    rng.advance(STEP.wrapping_mul(pixel.0.into()));
    rng
}

/// The random numbers of one trial.
#[must_use]
pub fn trial_rng(seed: u64, trial: u16) -> Pcg64 {
    pixel_rng(seed, PixelAddress(trial))
}
