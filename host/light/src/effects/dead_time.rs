//! Dead time: after an avalanche the SPAD is blind until it has recharged.
//!
//! A photon in the dead time is lost and does not prolong it (non-paralysable),
//! so a steady rate r is counted as r / (1 + r τ). Near photons hide far ones:
//! pile-up.

use anyhow::Result;
use serde::Deserialize;

use super::limits::{LONGEST_PS, Timing};
use dtof_data::photons::range::within;

/// The dead time.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeadTime {
    /// Picoseconds after each avalanche (τ). It may last into later laser cycles.
    pub duration_ps: f64,
}

impl DeadTime {
    pub(crate) fn check(&self) -> Result<()> {
        within("duration_ps", self.duration_ps, 0.0..=LONGEST_PS)
    }
}

/// A SPAD that recharges. Times are in bins from the start of the laser cycle.
#[derive(Clone, Debug)]
pub(crate) struct Recharge {
    duration: f64,
    blind_until: f64,
}

impl Recharge {
    pub(crate) fn new(dead_time: Option<&DeadTime>, timing: &Timing) -> Self {
        Self {
            duration: dead_time.map_or(0.0, |dead| dead.duration_ps / timing.bin_width_ps),
            blind_until: 0.0,
        }
    }

    /// Returns when the SPAD has recharged, if a photon at `time` starts an avalanche.
    pub(crate) fn avalanche(&mut self, time: f64) -> Option<f64> {
        (time >= self.blind_until).then(|| {
            self.blind_until = time + self.duration;
            self.blind_until
        })
    }

    /// The next laser cycle starts `period` after this one.
    pub(crate) fn end_laser_cycle(&mut self, period: f64) {
        self.blind_until -= period;
    }
}
