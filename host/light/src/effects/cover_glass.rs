//! Crosstalk of the cover glass: laser light that never left the sensor, at the
//! same place in every pixel. Recorded sensors show up to a hundred times the
//! target's signal there.

use anyhow::Result;
use rand_distr::{Distribution, Normal, Poisson};
use rand_pcg::Pcg64;
use serde::Deserialize;

use dtof_data::photons::range::within;

/// A second pulse of the same shape.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoverGlass {
    /// Photons a laser cycle.
    pub signal: f64,
    /// Their position in bins from the start of bin 0.
    pub position_bins: f64,
}

impl CoverGlass {
    pub(crate) fn check(&self) -> Result<()> {
        within("signal", self.signal, 0.0..=1000.0)?;
        within("position_bins", self.position_bins, 0.0..=1024.0)
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Crosstalk {
    /// `None` without photons.
    photons: Option<Poisson<f64>>,
    pulse: Normal<f64>,
    rng: Pcg64,
}

impl Crosstalk {
    pub(crate) fn new(glass: &CoverGlass, sigma: f64, rng: Pcg64) -> Result<Self> {
        let photons = (glass.signal > 0.0).then(|| Poisson::new(glass.signal));
        Ok(Self {
            photons: photons.transpose()?,
            pulse: Normal::new(glass.position_bins, sigma)?,
            rng,
        })
    }

    /// Gives `photon` the position in bins of each photon of a laser cycle.
    pub(crate) fn draw(&mut self, mut photon: impl FnMut(f64)) {
        let Some(photons) = self.photons else { return };
        let mut left = photons.sample(&mut self.rng);
        while left > 0.0 {
            left -= 1.0;
            photon(self.pulse.sample(&mut self.rng));
        }
    }
}
