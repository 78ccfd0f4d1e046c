//! Random number generators that depend only on a seed and a position in its sequence.

use dtof_core::PixelAddress;
use rand_core::SeedableRng;
use rand_pcg::Pcg64;

/// The random number generator of one pixel. It depends only on the seed and the
/// address, so the order in which threads process pixels changes nothing.
#[must_use]
pub fn pixel_rng(seed: u64, pixel: PixelAddress) -> Pcg64 {
    // Each pixel has its own position in the seed's sequence. The step is odd and about
    // 0.6 of the period, so positions lie far apart.
    const STEP: u128 = 0x9e37_79b9_7f4a_7c15_f39c_c060_5ced_c835;
    let mut rng = Pcg64::seed_from_u64(seed);
    rng.advance(STEP.wrapping_mul(pixel.raw().into()));
    rng
}

/// The random number generator of one trial.
#[must_use]
pub fn trial_rng(seed: u64, trial: u16) -> Pcg64 {
    pixel_rng(seed, PixelAddress::new(trial))
}
