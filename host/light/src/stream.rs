//! Random numbers for each effect.

use dtof_core::PixelAddress;
use rand_pcg::Pcg64;

use dtof_data::random::pixel_rng;

/// The effect that draws the numbers.
#[derive(Clone, Copy, Debug)]
pub(super) enum Stream {
    /// The place of a background photon within its bin.
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
    /// The photons of another LiDAR, and the time of its first pulse.
    OtherLidar,
    OtherLidarStart,
}

impl Stream {
    /// The random numbers of an effect in one pixel, independent of the plain model and the other
    /// effects.
    pub(super) fn rng(self, seed: u64, pixel: PixelAddress) -> Pcg64 {
        // Seeds are hashed, so any difference will do.
        let offset = (self as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        pixel_rng(seed.wrapping_add(offset), pixel)
    }
}
