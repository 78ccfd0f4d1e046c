//! Whether the cover glass has become brighter than the settings say.

use crate::summary::Summary;
use dtof_calibrate::{Change, RunPhotons, glass_change};
use dtof_engine::settings::{Sensor, SettingsFile};

/// Notes it in the summary of a run that was set by `said`, if `bins` has all its photons bin by
/// bin.
pub(crate) fn watch_glass(said: &SettingsFile, bins: Option<&[u64]>, summary: &mut Summary) {
    if let Some(bins) = bins {
        let run = RunPhotons {
            bins,
            cycles: summary.cycles,
            pixels: summary.pixels.saturating_sub(summary.settings.masked.len()) as u64,
        };
        summary.cover_glass = brighter(said, &run);
    }
}

/// How many times as bright it is, and at least, if that is surely more than `said`.
#[must_use]
pub fn brighter(said: &SettingsFile, run: &RunPhotons) -> Option<[f64; 2]> {
    let Sensor {
        glass_bins, gate, ..
    } = &said.sensor;
    let (glass, (first, _)) = (glass_bins.as_ref()?, (*gate)?);
    match glass_change(run, glass, first) {
        Change::Brighter(times, least) => Some([times, least]),
        _ => None,
    }
}
