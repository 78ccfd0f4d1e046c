//! A run: photons in, a folder of results out. The program and bindings to other languages do the
//! same jobs, each with options of its own.

pub mod calibrate;
pub mod compare;
pub mod given;
pub mod glass;
pub mod output;
pub mod recording;
pub mod replay;
pub mod simulate;
pub mod summary;
pub mod truth;
pub mod tune;

use anyhow::Result;
use dtof_core::DepthEvent;

use self::output::Output;
use self::summary::Summary;
use dtof_engine::Engine;
use dtof_engine::decisions::Kept;
use dtof_engine::settings::Settings;
use dtof_engine::slices::each_slice;
use dtof_options::progress::Progress;
use dtof_photons::source::PhotonSource;

/// Runs all of `source` and writes its events into `output`. `watch` is given all events, too.
///
/// # Errors
/// What is wrong with the recording, the engine or the folder.
pub fn run(
    source: &mut dyn PhotonSource,
    engine: &mut dyn Engine,
    output: &mut Output,
    settings: &Settings,
    progress: &mut dyn Progress,
    mut watch: impl FnMut(&[DepthEvent]),
) -> Result<Summary> {
    progress.begin(source.cycles(), "laser cycles");
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
    progress.end();
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
