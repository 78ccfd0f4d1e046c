//! The pulse's tail: a laser and a SPAD that decay slowly. Tails of recorded sensors last tens of
//! bins.

use anyhow::Result;
use rand_distr::{Bernoulli, Distribution, Exp};
use rand_pcg::Pcg64;
use serde::Deserialize;

use super::limits::SHARE;
use dtof_data::photons::range::within;

/// A share of the laser's photons is late by an exponentially distributed time. The mean position
/// moves by `share * decay_bins`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tail {
    /// The share of the pulse's energy in the tail.
    pub share: f64,
    /// The bins in which it falls to 1/e.
    pub decay_bins: f64,
}

impl Tail {
    pub(crate) fn check(&self) -> Result<()> {
        within("share", self.share, SHARE)?;
        within("decay_bins", self.decay_bins, 0.001..=1000.0)
    }
}

#[derive(Clone, Debug)]
pub(crate) struct TailDelay {
    is_late: Bernoulli,
    delay: Exp<f64>,
    rng: Pcg64,
}

impl TailDelay {
    pub(crate) fn new(tail: &Tail, rng: Pcg64) -> Result<Self> {
        Ok(Self {
            is_late: Bernoulli::new(tail.share)?,
            delay: Exp::new(tail.decay_bins.recip())?,
            rng,
        })
    }

    /// How much later a photon comes, in bins.
    pub(crate) fn delay(&mut self) -> f64 {
        if self.is_late.sample(&mut self.rng) {
            self.delay.sample(&mut self.rng)
        } else {
            0.0
        }
    }
}
