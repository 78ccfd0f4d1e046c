//! Hot pixels: SPADs with many dark counts.

use anyhow::{Result, ensure};
use dtof_core::PixelAddress;
use rand_distr::{Bernoulli, Distribution};
use rand_pcg::Pcg64;
use serde::Deserialize;

use super::limits::SHARE;
use dtof_data::photons::range::within;

/// Some pixels have a multiple of the background of the others.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HotPixels {
    /// The background of a hot pixel, as a multiple of that of the others.
    pub multiple: f64,
    /// Each pixel is hot with this probability.
    #[serde(default)]
    pub share: f64,
    /// The addresses of pixels that are hot in any case.
    #[serde(default)]
    pub pixels: Vec<u16>,
}

impl HotPixels {
    pub(crate) fn check(&self) -> Result<()> {
        within("multiple", self.multiple, 1.0..=1000.0)?;
        within("share", self.share, SHARE)?;
        ensure!(
            self.share > 0.0 || !self.pixels.is_empty(),
            "share or pixels must say which are hot"
        );
        Ok(())
    }

    /// Whether a pixel is hot. Draws one random number.
    pub(crate) fn is_hot(&self, pixel: PixelAddress, rng: &mut Pcg64) -> Result<bool> {
        let by_chance = Bernoulli::new(self.share)?.sample(rng);
        Ok(by_chance || self.pixels.contains(&pixel.raw()))
    }
}
