//! A TDC with a limited number of photons a laser cycle.

use anyhow::{Result, ensure};
use serde::Deserialize;

/// With one hit a laser cycle only the first photon counts: bin i is hit with
/// probability exp(-sum of the rates before it) (1 - exp(-rate)).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tdc {
    /// How many photons it takes. They are the first of the laser cycle.
    pub hits_per_cycle: usize,
}

impl Tdc {
    pub(crate) fn check(&self) -> Result<()> {
        ensure!(
            self.hits_per_cycle >= 1,
            "hits_per_cycle 0: must be at least 1"
        );
        Ok(())
    }
}
