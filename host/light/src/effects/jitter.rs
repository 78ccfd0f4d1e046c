//! Timing jitter of SPAD and TDC.

use anyhow::Result;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;
use serde::Deserialize;

use super::limits::{LONGEST_PS, Timing};
use dtof_data::photons::range::within;

/// Every time is measured with a normally distributed error; its variance adds
/// to that of the pulse.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Jitter {
    /// The standard deviation in picoseconds.
    pub sigma_ps: f64,
}

impl Jitter {
    pub(crate) fn check(&self) -> Result<()> {
        within("sigma_ps", self.sigma_ps, 0.0..=LONGEST_PS)
    }
}

#[derive(Clone, Debug)]
pub(crate) struct TimingError {
    error: Normal<f64>,
    rng: Pcg64,
}

impl TimingError {
    pub(crate) fn new(jitter: &Jitter, timing: &Timing, rng: Pcg64) -> Result<Self> {
        Ok(Self {
            error: Normal::new(0.0, jitter.sigma_ps / timing.bin_width_ps)?,
            rng,
        })
    }

    /// The measured time of `time`. An error past a laser pulse moves the photon to the next laser
    /// cycle, which is simulated as the other end of this one.
    pub(crate) fn measured(&mut self, time: f64, period: f64) -> f64 {
        (time + self.error.sample(&mut self.rng)).rem_euclid(period)
    }
}
