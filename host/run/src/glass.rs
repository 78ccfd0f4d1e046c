//! Whether crosstalk of the cover glass has become stronger than in the settings.

use crate::summary::Summary;
use dtof_calibrate::{Change, RunPhotons, glass_change};
use dtof_engine::settings::{SensorSettings, SettingsFile};

/// Notes in the summary of a run whether crosstalk has become stronger; `bins` are its photons bin by bin.
pub(crate) fn watch_glass(requested: &SettingsFile, bins: &[u64], summary: &mut Summary) {
    let run = RunPhotons {
        bins,
        cycles: summary.cycles,
        pixels: summary.pixels.saturating_sub(summary.settings.masked.len()) as u64,
    };
    summary.cover_glass = brighter(requested, &run);
}

/// How many times as bright crosstalk is as in the settings, and at least, if it is significantly
/// brighter.
fn brighter(requested: &SettingsFile, run: &RunPhotons) -> Option<[f64; 2]> {
    let SensorSettings {
        glass_bins, gate, ..
    } = &requested.sensor;
    let (glass, (first, _)) = (glass_bins.as_ref()?, (*gate)?);
    match glass_change(run, glass, first) {
        Change::Brighter(times, least) => Some([times, least]),
        _ => None,
    }
}
