//! One run: photons through an engine into an output folder.

use anyhow::Result;
use dtof_core::DepthEvent;

use crate::engine::Engine;
use crate::engine::settings::Settings;
use crate::events::output::Output;
use crate::events::summary::Summary;
use crate::input::source::PhotonSource;
use crate::progress::Progress;

/// Laser cycles produced and decided at a time, at most, and about how many
/// photons. Bounds the memory; changes nothing in the events.
const SLICE: u16 = 256;
const SLICE_PHOTONS: f64 = 1e7;

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
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "1 to SLICE"
        )]
        let most = (SLICE_PHOTONS / source.photons_per_cycle()).clamp(1.0, SLICE.into()) as u16;
        let next = u16::try_from(cycles - done).map_or(most, |left| left.min(most));
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
