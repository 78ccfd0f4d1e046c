//! A recording to millimetres: `cargo run --package dtof --example recording -- counts.npy`.
//!
//! Without a file it takes a list of photons that it writes first.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use anyhow::Result;
use dtof_data::photons::open::{ReadOptions, open};
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_engine::slices::each_slice;

/// Prints each event of the recording `file` and gives their number.
fn replay(file: &Path) -> Result<usize> {
    let mut recording = open(file, &ReadOptions::default())?;
    let settings = Settings::static_scene(1).with_bins(recording.metadata.bins);
    let settings = settings.configured(|array| {
        array.bin_width_ps = recording.metadata.bin_width_ps;
        (array.x, array.l1) = (4, 40);
    });
    let photons = recording.photons.as_mut();
    let ranges = settings.ranges(photons.array())?;
    let mut engine = host_engine(&settings, photons.array(), &photons.addresses())?;
    let mut events = 0;
    each_slice(
        photons,
        |slice| engine.run(slice),
        |_, found, _| {
            for event in &found {
                let range = ranges.of(event.pixel, event.level, event.position());
                println!(
                    "cycle {} pixel {}: {range} mm",
                    event.cycle.raw(),
                    event.pixel.raw()
                );
            }
            events += found.len();
            Ok(ControlFlow::Continue(()))
        },
    )?;
    Ok(events)
}

fn main() -> Result<()> {
    if let Some(file) = std::env::args_os().nth(1) {
        replay(&PathBuf::from(file))?;
        return Ok(());
    }
    // A photon in bin 60 of each of 200 laser cycles: an event every 44.
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("photons.csv");
    let rows: String = (0..200).map(|cycle| format!("0,{cycle},60\n")).collect();
    std::fs::write(&file, format!("pixel,cycle,bin\n{rows}"))?;
    assert_eq!(replay(&file)?, 4);
    Ok(())
}
