//! Random numbers for each effect.

use dtof_core::PixelAddress;
use rand_pcg::Pcg64;

use dtof_theory::random::pixel_rng;

/// The effect that draws.
#[derive(Clone, Copy, Debug)]
pub(super) enum Stream {
    /// Where in its bin a background photon lies.
    WithinBin = 1,
    /// Background between the histogram and the next laser pulse.
    Gap,
    SecondEcho,
    CoverGlass,
    Tail,
    HotPixels,
    Afterpulsing,
    Jitter,
    /// Photons from behind a surface that lets light through.
    Behind,
}

impl Stream {
    /// Its numbers in one pixel: neither those of the plain model nor those of
    /// another effect.
    pub(super) fn rng(self, seed: u64, pixel: PixelAddress) -> Pcg64 {
        // Seeds are expanded by a hash, so that far apart is good enough.
        let offset = (self as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        pixel_rng(seed.wrapping_add(offset), pixel)
    }
}
