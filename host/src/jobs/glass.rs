//! Whether the cover glass has become brighter than the settings say.

use crate::calibrate::{Change, RunPhotons, glass_change};
use crate::events::summary::Summary;
use crate::settings::{Sensor, SettingsFile};

/// Notes it in the summary of a run that was set by `said`, if `bins` has all its photons bin by
/// bin.
pub fn watch_glass(said: &SettingsFile, bins: Option<&[u64]>, summary: &mut Summary) {
    let Sensor {
        glass_bins, gate, ..
    } = &said.sensor;
    if let (Some(bins), Some(glass), Some((first, _))) = (bins, glass_bins, gate) {
        let run = RunPhotons {
            bins,
            cycles: summary.cycles,
            pixels: (summary.pixels - summary.settings.masked.len()) as u64,
        };
        if let Change::Brighter(times, least) = glass_change(&run, glass, *first) {
            summary.cover_glass = Some([times, least]);
        }
    }
}
