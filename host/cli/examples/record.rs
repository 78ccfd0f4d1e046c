//! A scene to an array of histograms: `cargo run --package dtof --example record -- scenes/room.toml room.npy`.
//!
//! Without files it checks that `scenes/room.npy` is the recording of `scenes/room.toml`.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use dtof_data::photons::npy;
use dtof_data::photons::source::PhotonSource;
use dtof_light::scene::Scene;

/// The photons of the scene in `text`, as NumPy saves them: rows, columns, bins.
fn record(text: &str) -> Result<Vec<u8>> {
    let scene = Scene::parse(text)?;
    let mut photons = scene.photons(1, scene.cycles)?;
    let mut counts = vec![vec![0u16; scene.bins.into()]; photons.addresses().len()];
    let mut left = scene.cycles;
    while left > 0 {
        let cycles = left.min(1000);
        let slice = photons.next_slice(u16::try_from(cycles)?)?;
        for (histogram, pixel) in counts.iter_mut().zip(slice.pixels) {
            for photon in pixel.photons {
                // A code past the last bin has no place in a histogram.
                if let Some(count) = histogram.get_mut(usize::from(photon.code)) {
                    *count = count
                        .checked_add(1)
                        .context("more than 65,535 photons in a bin")?;
                }
            }
        }
        left -= cycles;
    }
    let array = scene.array()?;
    let shape = [array.rows(), array.columns(), scene.bins.into()].map(u64::from);
    let counts: Vec<u16> = counts.into_iter().flatten().collect();
    // A byte each, if all fit.
    let small: Result<Vec<u8>, _> = counts.iter().map(|&count| u8::try_from(count)).collect();
    let (kind, data) = match small {
        Ok(small) => ("|u1", small),
        Err(_) => (
            "<u2",
            counts.into_iter().flat_map(u16::to_le_bytes).collect(),
        ),
    };
    let mut bytes = npy::header(kind, &shape, 128);
    bytes.extend(data);
    Ok(bytes)
}

fn main() -> Result<()> {
    let mut names = std::env::args_os().skip(1);
    if let Some(scene) = names.next() {
        let out = names
            .next()
            .context("name the scene, and the file to write")?;
        let text = std::fs::read_to_string(scene)?;
        return Ok(std::fs::write(out, record(&text)?)?);
    }
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let text = std::fs::read_to_string(scenes.join("room.toml"))?;
    let kept = std::fs::read(scenes.join("room.npy"))?;
    ensure!(
        record(&text)? == kept,
        "scenes/room.npy is another recording"
    );
    println!("scenes/room.npy is the recording of scenes/room.toml");
    Ok(())
}
