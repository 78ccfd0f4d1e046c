//! Photons through an engine, slice by slice.

use anyhow::Result;
use dtof_core::{DepthEvent, Flags, PixelAddress};

use crate::bright::Brightness;
use crate::glass::watch_glass;
use crate::summary::Summary;
use dtof_engine::Engine;
use dtof_engine::settings::{Settings, SettingsFile};
use dtof_engine::slices::each_slice;
use dtof_options::progress::Progress;
use dtof_photons::source::{PhotonSource, Slice};

/// Where the photons and the events of a run go.
pub trait Sink {
    /// The run begins.
    fn begin(&mut self, _source: &dyn PhotonSource, _engine: &mut dyn Engine) {}

    /// Takes a slice of photons, and the events of its laser cycles.
    ///
    /// # Errors
    /// Fails if they cannot be written.
    fn take(&mut self, slice: &Slice, events: &[DepthEvent]) -> Result<()>;

    /// The run has ended.
    fn end(&mut self, _engine: &dyn Engine) {}
}

/// The result of a run.
#[derive(Clone, Debug)]
pub struct RunResult {
    /// Its totals.
    pub summary: Summary,
    /// Its photons bin by bin, if the settings have the crosstalk of the cover glass.
    pub bins: Option<Vec<u64>>,
    /// Warnings about its photons, which are also in the summary.
    pub warnings: Vec<String>,
}

/// Runs all of `source` with `settings`, which resolve `requested`, into `sinks`.
///
/// # Errors
/// Fails if the recording, the engine or a sink fails, or if `progress` ends the run.
pub fn run(
    source: &mut dyn PhotonSource,
    engine: &mut dyn Engine,
    (settings, requested): (&Settings, &SettingsFile),
    sinks: &mut [&mut dyn Sink],
    progress: &mut dyn Progress,
) -> Result<RunResult> {
    let array = source.array();
    let mut has_reported = vec![false; array.pixels() as usize];
    let has_glass = requested.sensor.glass_bins.is_some();
    let mut bins = has_glass.then(|| vec![0; settings.bins]);
    let mut confirmed = 0;
    let addresses = source.addresses();
    let is_once_per_bin = settings.once_per_bin && settings.frame.is_none();
    let mut brightness = is_once_per_bin.then(|| Brightness::new(addresses.len(), settings.bins));
    // Laser cycles of each pixel that is left out. Its exposures all end without an event, as it has no photons.
    let is_masked = |pixel: &PixelAddress| settings.masked.contains(&pixel.raw());
    let masked = addresses
        .iter()
        .enumerate()
        .filter(|(_, pixel)| is_masked(pixel));
    let mut masked: Vec<(usize, u64)> = masked.map(|(place, _)| (place, 0)).collect();
    for sink in &mut *sinks {
        sink.begin(source, engine);
    }
    progress.begin(source.cycles(), "laser cycles");
    progress.at(0)?;
    each_slice(
        source,
        |slice| engine.run(slice),
        |slice, events, done| {
            for event in &events {
                confirmed += u64::from(event.flags.contains(Flags::CONFIRMED));
                for pixel in array.pixels_of(event.pixel, event.level) {
                    has_reported[usize::from(pixel.raw())] = true;
                }
            }
            for (place, cycles) in &mut masked {
                *cycles += u64::from(slice.pixels[*place].cycles);
            }
            if let Some(bins) = &mut bins {
                add_photons(slice, bins);
            }
            if let Some(brightness) = &mut brightness {
                brightness.add(slice);
            }
            for sink in &mut *sinks {
                sink.take(slice, &events)?;
            }
            progress.at(done)
        },
    )?;
    progress.end();
    for sink in &mut *sinks {
        sink.end(engine);
    }
    let x = settings.x.max(1);
    let longest = match settings.frame {
        Some(frame) => u64::from(frame.max(1)),
        None => u64::from(settings.l2.div_ceil(x)) * u64::from(x),
    };
    let expired_masked: u64 = masked.iter().map(|(_, cycles)| cycles / longest).sum();
    let reporting = has_reported.into_iter().filter(|&has| has).count();
    let mut summary = Summary::new(engine.statistics(), source, reporting, settings);
    summary.events_confirmed = confirmed;
    summary.expired = summary.expired.saturating_sub(expired_masked);
    watch_glass(requested, bins.as_deref(), &mut summary);
    let warning = brightness.and_then(|brightness| brightness.warning(&addresses));
    let warnings: Vec<String> = warning.into_iter().collect();
    summary.warnings.clone_from(&warnings);
    Ok(RunResult {
        summary,
        bins,
        warnings,
    })
}

/// Photons past the last bin are left out; statistics count them.
fn add_photons(slice: &Slice, bins: &mut [u64]) {
    for photon in slice.pixels.iter().flat_map(|pixel| &pixel.photons) {
        if let Some(count) = bins.get_mut(usize::from(photon.code)) {
            *count += 1;
        }
    }
}
