//! The scene and the settings of the demo.

use anyhow::Result;
use dtof_core::Array;

use super::SimulatedArray;
use super::scene::Scene;
use dtof_engine::settings::{Settings, SettingsFile};

/// `demo.toml` beside this file.
///
/// # Errors
/// Never fails: the text is a part of the program.
pub fn scene() -> Result<Scene> {
    Scene::parse(include_str!("demo.toml"))
}

/// Blocks of 4×4 pixels and two echoes, with the window rule and one false alarm in a hundred
/// exposures.
///
/// # Errors
/// Never fails: the text is a part of the program.
pub fn settings(seed: u64) -> Result<Settings> {
    let mut file = SettingsFile::parse(
        "[sensor]
         sigma_bins = 1
         [detection]
         rule = 'window'
         binning = 2
         echoes = 2
         echo_wait = 4",
    )?;
    file.run.seed = Some(seed);
    file.settings(128)
}

/// The photons of `cycles` laser cycles on an array.
///
/// # Errors
/// Fails if the array is so large that there are too many photons a laser cycle.
pub fn photons(array: Array, seed: u64, cycles: u64) -> Result<SimulatedArray> {
    let scene = Scene {
        size: [array.columns(), array.rows()],
        ..scene()?
    };
    scene.photons(seed, cycles)
}
