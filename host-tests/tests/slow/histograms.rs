//! The histograms of an emulated board are those of its simulated scene.

use std::time::Duration;

use anyhow::{Result, ensure};
use dtof_device::histograms::{SoFar, collect};
use dtof_device::{Client, HostTimeout};
use dtof_engine::settings::Settings;

/// Collects histograms for some seconds. Per laser cycle the scene has half a background photon in 128
/// bins, and 0.5 to 0.1 signal photons in three bins from `20 + 6 * pixel`.
pub fn are_those_of_the_scene(client: &mut Client, settings: &Settings) -> Result<()> {
    const PIXELS: u16 = 16;
    let length = Duration::from_secs(4);
    let timeout = HostTimeout::default();
    let done = |so_far: &SoFar| so_far.elapsed >= length;
    let collected = collect(client, settings, PIXELS, timeout, done)?;
    ensure!(collected.full == 0);
    for (pixel, counts) in (0u32..).zip(&collected.histograms) {
        let cycles = collected.cycles[pixel as usize] as f64;
        let first = 20 + 6 * pixel as usize;
        let signal: u64 = counts[first..first + 3].iter().sum();
        let background = counts.iter().sum::<u64>() - signal;
        let of_signal = 0.5 * 5.0 / f64::from(5 + pixel * 4 / 3) + 3.0 * 0.5 / 128.0;
        for (photons, rate) in [(signal, of_signal), (background, 125.0 * 0.5 / 128.0)] {
            let expected = rate * cycles;
            let off = (photons as f64 - expected) / expected.sqrt();
            ensure!(
                cycles > 2_000.0 && off.abs() < 5.0,
                "pixel {pixel}: {photons} photons, not {expected:.0}, in {cycles} laser cycles"
            );
        }
    }
    println!("histograms of {:?} laser cycles", collected.cycles);
    Ok(())
}
