//! The surfaces of the scene.

use super::scene;
use crate::sweep::PointTally;
use anyhow::Result;
use dtof_core::PixelAddress;

/// Every surface of a point with its mean signal photons a laser cycle.
pub fn surfaces(point: &PointTally) -> Result<Vec<(String, f64)>> {
    let scene = scene(&point.parameters, 0.0)?;
    let mut sums = vec![(0.0, 0.0); scene.surfaces.len()];
    let pixels = scene.array()?.pixels() as usize;
    for address in (0..u16::MAX).take(pixels).map(PixelAddress::new) {
        if let Some(view) = scene.truth(address, 0) {
            let (sum, count) = &mut sums[view.surface];
            *sum += scene.rates(address, 0).signal;
            *count += 1.0;
        }
    }
    let names = scene.surfaces.into_iter().map(|surface| surface.name);
    Ok(names
        .zip(sums)
        .map(|(name, (sum, count))| (name, sum / count))
        .collect())
}
