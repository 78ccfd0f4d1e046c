//! A TDC that misses photons: one with a limited number of photons a laser cycle, or one with a dead
//! time.

use anyhow::{Result, ensure};
use serde::Deserialize;

/// With one hit a laser cycle only the first photon counts: bin i is hit with
/// probability exp(-sum of the rates before it) (1 - exp(-rate)).
///
/// With a dead time of D bins, bin i is live unless one of the D bins before it was hit. A live bin
/// is hit with probability 1 - exp(-rate).
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Tdc {
    /// How many photons it takes. They are the first of the laser cycle.
    pub hits_per_cycle: Option<usize>,
    /// Bins for which it is blind after a photon, besides the photon's own. It is live again with the
    /// next laser pulse.
    pub dead_time_bins: Option<u16>,
}

impl Tdc {
    pub(crate) fn check(&self) -> Result<()> {
        ensure!(
            self.hits_per_cycle.is_some() != self.dead_time_bins.is_some(),
            "needs hits_per_cycle or dead_time_bins, and not both"
        );
        ensure!(
            self.hits_per_cycle != Some(0),
            "hits_per_cycle 0: must be at least 1"
        );
        ensure!(
            self.dead_time_bins != Some(0),
            "dead_time_bins 0: must be at least 1"
        );
        Ok(())
    }

    /// Its dead time in bins: [`u16::MAX`] if only the first photon of a laser cycle counts, 0 if it
    /// has none.
    #[must_use]
    pub fn dead_time(&self) -> u16 {
        match self.hits_per_cycle {
            Some(1) => u16::MAX,
            _ => self.dead_time_bins.unwrap_or(0),
        }
    }

    /// The codes that it gives of photons with `codes`, ascending, in a laser cycle.
    pub(crate) fn hits(&self, codes: impl Iterator<Item = u16>) -> impl Iterator<Item = u16> {
        let mut live = 0;
        let dead_time = self.dead_time_bins;
        let hits = codes.filter(move |&code| {
            let is_live = code >= live;
            if let (true, Some(bins)) = (is_live, dead_time) {
                live = code.saturating_add(1).saturating_add(bins);
            }
            is_live
        });
        hits.take(self.hits_per_cycle.unwrap_or(usize::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hits(tdc: &Tdc) -> Vec<u16> {
        tdc.hits([3, 3, 4, 9, 10, 12, 20].into_iter()).collect()
    }

    #[test]
    fn a_photon_blinds_its_bin_and_so_many_after_it() {
        let dead_time = |bins| Tdc {
            dead_time_bins: Some(bins),
            ..Tdc::default()
        };
        assert_eq!(hits(&dead_time(1)), [3, 9, 12, 20]);
        assert_eq!(hits(&dead_time(6)), [3, 10, 20]);
        assert_eq!(hits(&dead_time(16)), [3, 20]);
        assert_eq!(hits(&dead_time(u16::MAX)), [3]);
        let two = Tdc {
            hits_per_cycle: Some(2),
            ..Tdc::default()
        };
        assert_eq!(hits(&two), [3, 3]);
        assert_eq!(hits(&Tdc::default()), [3, 3, 4, 9, 10, 12, 20]);
    }
}
