//! The demo: what its pixels see, and how they decide.

use anyhow::{Context, Result};
use dtof_core::fixed::types::U8F8;
use dtof_core::{Array, BlockLevel, Count, EchoNumber, RangeGate, WindowRule, z_for_levels};
use dtof_link::AdaptiveBinning;

use super::SimulatedArray;
use super::scene::{self, Scene};
use dtof_engine::settings::Settings;

/// `demo.toml` beside this file.
///
/// # Errors
/// Never: it is a part of the program.
pub fn scene() -> Result<Scene> {
    Scene::parse(include_str!("demo.toml"))
}

/// Blocks of 4×4 pixels and two echoes, with the window rule and one false alarm in a hundred
/// exposures: `--rule window --sigma-bins 1 --binning 2 --echoes 2 --echo-wait 4`.
///
/// # Errors
/// Never: the numbers are those of a rule.
pub fn settings(seed: u64) -> Result<Settings> {
    const SIGMA: U8F8 = U8F8::ONE;
    let (x, l1, l2) = (4, 40, 2000);
    let levels = BlockLevel::saturating(2);
    let z = z_for_levels(100, &RangeGate::<128>::full(), x, l1, l2, levels);
    let width = WindowRule::width_for_pulse(SIGMA);
    Ok(Settings {
        rule: WindowRule::new(width, z, Count::saturating(5))?.into(),
        sigma_bins: Some(SIGMA),
        x,
        l1,
        l2,
        binning: Some(AdaptiveBinning {
            levels,
            patience: AdaptiveBinning::PATIENCE,
        }),
        echoes: EchoNumber::new(2).context("an echo")?,
        echo_wait: Some(4),
        ..scene::settings(seed)
    })
}

/// Its photons on an array, `cycles` laser cycles of them.
///
/// # Errors
/// Never: it is a part of the program.
pub fn photons(array: Array, seed: u64, cycles: u64) -> Result<SimulatedArray> {
    let scene = Scene {
        size: [array.columns(), array.rows()],
        ..scene()?
    };
    scene.photons(seed, cycles)
}
