//! Photons through an engine, slice by slice.

use std::ops::ControlFlow;

use anyhow::Result;
use dtof_core::{Array, DepthEvent, Flags, PixelAddress};

use crate::bright::bright_bins;
use crate::depth_map::{DepthMap, MapInput, RunCounts};
use crate::glass::watch_glass;
use crate::summary::{ALL_PHOTONS, Summary};
use dtof_data::options::progress::Progress;
use dtof_data::options::rows::grouped;
use dtof_data::photons::pixel_counts::PixelCounts;
use dtof_data::photons::source::{PhotonSource, PixelPhotons, Slice};
use dtof_engine::Engine;
use dtof_engine::once_per_bin::once_per_bin;
use dtof_engine::settings::{Settings, SettingsFile};
use dtof_engine::slices::each_slice;

/// Where the photons and the events of a run go.
pub trait Sink {
    /// The run begins.
    fn begin(&mut self, _source: &dyn PhotonSource, _engine: &mut dyn Engine) {}

    /// Takes a slice of photons, and the events of its laser cycles.
    ///
    /// # Errors
    /// Fails if they cannot be written.
    fn take(&mut self, slice: &Slice, events: &[DepthEvent]) -> Result<()>;

    /// The run has ended. `map` is the depth of its pixels, decided on all photons, if there is one.
    fn end(&mut self, _engine: &dyn Engine, _map: Option<&DepthMap>) {}
}

/// The pixels that have reported, and how many events neighbours confirmed.
#[derive(Clone, Debug)]
pub struct Reported {
    array: Array,
    has_reported: Vec<bool>,
    confirmed: u64,
}

impl Reported {
    /// No pixel of `array` has reported.
    #[must_use]
    pub fn new(array: Array) -> Self {
        Self {
            array,
            has_reported: vec![false; array.pixels() as usize],
            confirmed: 0,
        }
    }

    /// Takes an event. That of a block is one of all its pixels.
    pub fn add(&mut self, event: &DepthEvent) {
        self.confirmed += u64::from(event.flags.contains(Flags::CONFIRMED));
        for pixel in self.array.pixels_of(event.pixel, event.level) {
            self.has_reported[usize::from(pixel.raw())] = true;
        }
    }

    /// The summary of the photons of `source` through `engine`, whose events these are.
    #[must_use]
    pub fn summary(
        &self,
        engine: &dyn Engine,
        source: &dyn PhotonSource,
        settings: &Settings,
    ) -> Summary {
        let reporting = self.has_reported.iter().filter(|&&has| has).count();
        let mut summary = Summary::new(engine.statistics(), source, reporting, settings);
        summary.events_confirmed = self.confirmed;
        summary
    }
}

/// The result of a run.
#[derive(Clone, Debug)]
pub struct RunResult {
    /// Its totals.
    pub summary: Summary,
    /// Warnings about its photons, which are also in the summary.
    pub warnings: Vec<String>,
}

/// Runs all of `source` with `settings`, which resolve `requested`, into `sinks`. The depth map is that of `map`; without
/// one it is that of the events.
///
/// # Errors
/// Fails if the recording, the engine or a sink fails, or if `progress` ends the run.
pub fn run(
    source: &mut dyn PhotonSource,
    engine: &mut dyn Engine,
    (settings, requested): (&Settings, &SettingsFile),
    map: Option<&MapInput>,
    sinks: &mut [&mut dyn Sink],
    progress: &mut dyn Progress,
) -> Result<RunResult> {
    let mut reported = Reported::new(source.array());
    let has_glass = requested.sensor.glass_bins.is_some();
    let addresses = source.addresses();
    let (pixels, bins) = (addresses.len(), settings.bins);
    let is_once_per_bin = settings.counts_once_per_bin();
    let counts_run = map.is_some_and(MapInput::counts_run);
    let mut counts = counts_run.then(|| RunCounts::new(pixels, bins, source.cycles()));
    // Photons that count once per bin and those that are not for the map are other ones.
    let has_other = is_once_per_bin || (has_glass && !counts_run);
    let mut other_counts = has_other.then(|| PixelCounts::new(pixels, bins));
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
    let (all, mut cycles) = (source.cycles(), 0);
    progress.begin(all, "laser cycles");
    progress.at(0)?;
    each_slice(
        source,
        |slice| engine.run(slice),
        |slice, events, done| {
            for (place, cycles) in &mut masked {
                *cycles += u64::from(slice.pixels[*place].cycles);
            }
            if let Some(counts) = &mut other_counts {
                counts.add(slice);
            }
            match &mut counts {
                Some(counts) if is_once_per_bin => counts.add(&once_per_bin(slice, bins)),
                Some(counts) => counts.add(slice),
                None => {}
            }
            deliver(slice, &events, &mut reported, sinks)?;
            cycles = done;
            progress.at(done)?;
            Ok(match progress.ends_early() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            })
        },
    )?;
    let decided = engine.finish();
    if !decided.is_empty() {
        let slice = Slice {
            first_cycle: cycles,
            pixels: vec![PixelPhotons::default(); addresses.len()],
        };
        deliver(&slice, &decided, &mut reported, sinks)?;
    }
    progress.end();
    let array = source.array();
    let contradictions = match (map, &counts) {
        (Some(map), Some(counts)) => counts.contradictions(map, array, &addresses)?,
        _ => Vec::new(),
    };
    let counts = counts.map(RunCounts::all);
    let map = match map {
        Some(map) => DepthMap::decide(map, counts.as_ref(), &contradictions, array, &addresses)?,
        None => None,
    };
    for sink in &mut *sinks {
        sink.end(engine, map.as_ref());
    }
    let x = settings.configuration.x.max(1);
    let longest = match settings.frame {
        _ if settings.decide_once => u64::MAX, // They are not counted.
        Some(frame) => u64::from(frame.max(1)),
        None => u64::from(settings.configuration.l2.div_ceil(x)) * u64::from(x),
    };
    let expired_masked: u64 = masked.iter().map(|(_, cycles)| cycles / longest).sum();
    let mut summary = reported.summary(engine, source, settings);
    summary.expired = summary.expired.saturating_sub(expired_masked);
    let counts = other_counts.as_ref().or(counts.as_ref());
    if let (true, Some(counts)) = (has_glass, counts) {
        watch_glass(requested, &counts.sum(), &mut summary);
    }
    let bright = counts.filter(|_| is_once_per_bin);
    let bright = bright.and_then(|counts| bright_bins(counts, &addresses));
    let mut warnings: Vec<String> = bright.into_iter().collect();
    if let Some(map) = &map {
        summary.depth_from = ALL_PHOTONS;
        summary.pixels_with_depth = map.pixels_with_depth();
        warnings.extend(map.warning(!settings.decide_once));
    }
    if cycles < all {
        summary.cycles = cycles;
        let (cycles, all) = (grouped(cycles), grouped(all));
        warnings.push(format!("ended early, after {cycles} of {all} laser cycles"));
    }
    summary.warnings.clone_from(&warnings);
    Ok(RunResult { summary, warnings })
}

/// Gives a slice and its events to all sinks.
fn deliver(
    slice: &Slice,
    events: &[DepthEvent],
    reported: &mut Reported,
    sinks: &mut [&mut dyn Sink],
) -> Result<()> {
    for event in events {
        reported.add(event);
    }
    for sink in sinks {
        sink.take(slice, events)?;
    }
    Ok(())
}
