//! The scene of the demo.

use anyhow::Result;
use dtof_core::Array;

use super::SimulatedArray;
use super::scene::Scene;

/// `demo.toml` beside this file.
///
/// # Errors
/// Never fails: the text is a part of the program.
pub fn scene() -> Result<Scene> {
    Scene::parse(include_str!("demo.toml"))
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
