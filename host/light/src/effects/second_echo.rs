//! A second echo: a pane of glass, a fence, an edge in the middle of a pixel.

use anyhow::Result;
use rand_distr::{Bernoulli, Distribution};
use rand_pcg::Pcg64;
use serde::Deserialize;

use super::limits::{SHARE, Timing};
use dtof_data::photons::MM_PER_PS;
use dtof_data::photons::range::within;

/// A share of the signal photons comes from a surface behind the one a pixel
/// sees.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SecondEcho {
    /// The share of the signal from there.
    pub share: f64,
    /// How much farther away that is, in millimetres.
    pub behind_mm: f64,
}

impl SecondEcho {
    pub(crate) fn check(&self) -> Result<()> {
        within("share", self.share, SHARE)?;
        within("behind_mm", self.behind_mm, 0.0..=1e6)
    }
}

#[derive(Clone, Debug)]
pub(crate) struct EchoDelay {
    is_second: Bernoulli,
    behind: f64,
    rng: Pcg64,
}

impl EchoDelay {
    pub(crate) fn new(echo: &SecondEcho, timing: &Timing, rng: Pcg64) -> Result<Self> {
        Ok(Self {
            is_second: Bernoulli::new(echo.share)?,
            behind: echo.behind_mm / (timing.bin_width_ps * MM_PER_PS),
            rng,
        })
    }

    /// How much later a signal photon comes, in bins.
    pub(crate) fn delay(&mut self) -> f64 {
        if self.is_second.sample(&mut self.rng) {
            self.behind
        } else {
            0.0
        }
    }
}
