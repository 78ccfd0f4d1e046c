//! One run: photons through an engine into an output folder.

use anyhow::{Context, Result};
use dtof_core::DepthEvent;

use crate::engine::Engine;
use crate::engine::decisions::Kept;
use crate::engine::settings::Settings;
use crate::events::output::Output;
use crate::events::summary::Summary;
use crate::input::source::{PhotonSource, Slice};
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
    let progress = Progress::new(source.cycles(), "laser cycles", quiet);
    let pixels = source.addresses();
    let kept = Kept::of(source.geometry(), settings.bins);
    engine.keep_decisions(&|pixel| kept.holds(pixel));
    each_slice(
        source,
        |slice| engine.run(slice),
        |slice, events, done| {
            output.count(&pixels, slice);
            output.write(&events)?;
            watch(&events);
            progress.at(done);
            Ok(())
        },
    )?;
    progress.finish();
    output.end_events();
    output.keep(kept, engine.decisions());
    let reporting = output.maps().reporting();
    Ok(Summary::new(
        engine.statistics(),
        source,
        reporting,
        settings,
    ))
}

/// Gives all of `source` to `decide`, slice by slice, and makes the photons of the next slice
/// meanwhile. `see` is given each slice, what was decided, and how many laser cycles are done.
///
/// # Errors
/// Those of the recording, of `decide` and of `see`. The first of them ends it.
pub fn each_slice<T: Send>(
    source: &mut dyn PhotonSource,
    mut decide: impl FnMut(&Slice) -> Result<T> + Send,
    mut see: impl FnMut(&Slice, T, u64) -> Result<()>,
) -> Result<()> {
    let mut done = 0;
    let mut next = next_slice(source, done)?;
    while let Some((slice, length)) = next {
        done += u64::from(length);
        let (mut decided, mut after) = (None, Ok(None));
        rayon::in_place_scope(|scope| {
            scope.spawn(|_| decided = Some(decide(&slice)));
            after = next_slice(source, done);
        });
        see(&slice, decided.context("no slice was decided on")??, done)?;
        next = after?;
    }
    Ok(())
}

/// The photons after `done` laser cycles, if there are any, and of how many laser cycles.
fn next_slice(source: &mut dyn PhotonSource, done: u64) -> Result<Option<(Slice, u16)>> {
    if done >= source.cycles() {
        return Ok(None);
    }
    let length = next_cycles(source, done);
    Ok(Some((source.next_slice(length)?, length)))
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
