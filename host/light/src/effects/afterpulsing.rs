//! Afterpulsing: charge trapped in an avalanche starts another one later.

use anyhow::Result;
use rand_distr::{Bernoulli, Distribution, Exp};
use rand_pcg::Pcg64;
use serde::Deserialize;

use super::limits::{LONGEST_PS, SHARE_OF_AFTERPULSES, Timing};
use dtof_data::photons::range::within;

/// Every avalanche has an afterpulse with this probability p, and so does an afterpulse: p / (1 -
/// p) a photon in all. It comes after the SPAD has recharged.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Afterpulsing {
    /// The probability of an afterpulse of an avalanche.
    pub probability: f64,
    /// Picoseconds after the dead time in which it falls to 1/e.
    pub decay_ps: f64,
}

impl Afterpulsing {
    pub(crate) fn check(&self) -> Result<()> {
        within("probability", self.probability, SHARE_OF_AFTERPULSES)?;
        within("decay_ps", self.decay_ps, 1.0..=LONGEST_PS)
    }
}

/// Charge that has not been released yet. Times are in bins from the start of
/// the laser cycle.
#[derive(Clone, Debug)]
pub(crate) struct Trap {
    is_filled: Bernoulli,
    delay: Exp<f64>,
    /// Latest first.
    releases: Vec<f64>,
    rng: Pcg64,
}

impl Trap {
    pub(crate) fn new(afterpulsing: &Afterpulsing, timing: &Timing, rng: Pcg64) -> Result<Self> {
        Ok(Self {
            is_filled: Bernoulli::new(afterpulsing.probability)?,
            delay: Exp::new(timing.bin_width_ps / afterpulsing.decay_ps)?,
            releases: Vec::new(),
            rng,
        })
    }

    /// Records an avalanche after which the SPAD recharges at `recharged`.
    pub(crate) fn fill(&mut self, recharged: f64) {
        if self.is_filled.sample(&mut self.rng) {
            let release = recharged + self.delay.sample(&mut self.rng);
            let later = self.releases.partition_point(|&other| other > release);
            self.releases.insert(later, release);
        }
    }

    /// The next release before `time`, if there is one.
    pub(crate) fn release_before(&mut self, time: f64) -> Option<f64> {
        self.releases.pop_if(|release| *release < time)
    }

    /// The next laser cycle starts `period` after this one.
    pub(crate) fn end_laser_cycle(&mut self, period: f64) {
        for release in &mut self.releases {
            *release -= period;
        }
    }
}
