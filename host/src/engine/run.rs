//! One run: photons through an engine into an output folder.

use anyhow::Result;
use dtof_core::DepthEvent;

use crate::engine::Engine;
use crate::engine::settings::Settings;
use crate::events::output::Output;
use crate::events::summary::Summary;
use crate::input::source::PhotonSource;
use crate::progress::Progress;

/// Laser cycles produced and decided at a time, at most. Changes nothing in the events.
const SLICE: u16 = 256;
/// About how many photons these are: so many a pixel, that they stay near the processor, but
/// not so few in all that a slice takes longer than they do, nor more than fit into memory.
const PHOTONS_A_PIXEL: f64 = 128.0;
const FEWEST_PHOTONS: f64 = 5e5;
const MOST_PHOTONS: f64 = 1e7;

/// Runs all of `source` and writes its events into `output`. A progress bar
/// shows after a second, unless `quiet`, and only on a terminal. `watch` is given all
/// events, too.
///
/// # Errors
/// What is wrong with the recording, the engine or the folder.
pub fn run(
    source: &mut dyn PhotonSource,
    engine: &mut dyn Engine,
    output: &mut Output,
    settings: &Settings,
    quiet: bool,
    mut watch: impl FnMut(&[DepthEvent]),
) -> Result<Summary> {
    let cycles = source.cycles();
    let progress = Progress::new(cycles, "laser cycles", quiet);
    let pixels = source.addresses();
    let mut done = 0;
    while done < cycles {
        let next = next_cycles(source, done);
        let slice = source.next_slice(next)?;
        output.count(&pixels, &slice);
        let events = engine.run(&slice)?;
        output.write(&events)?;
        watch(&events);
        done += u64::from(next);
        progress.at(done);
    }
    progress.finish();
    output.end_events();
    let reporting = output.maps().reporting();
    Ok(Summary::new(
        engine.statistics(),
        source,
        reporting,
        settings,
    ))
}

/// Laser cycles of the next slice, `done` of all being done.
#[must_use]
pub fn next_cycles(source: &dyn PhotonSource, done: u64) -> u16 {
    let photons = source.addresses().len() as f64 * PHOTONS_A_PIXEL;
    let photons = photons.clamp(FEWEST_PHOTONS, MOST_PHOTONS);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "1 to SLICE"
    )]
    let most = (photons / source.photons_per_cycle()).clamp(1.0, SLICE.into()) as u16;
    u16::try_from(source.cycles() - done).map_or(most, |left| left.min(most))
}
