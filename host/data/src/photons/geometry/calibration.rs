//! Calibration files: a direction and a range bias for each pixel.

use crate::options::rows::printable;
use anyhow::{Context, Result, anyhow, ensure};
use dtof_core::Array;
use serde::Deserialize;
use toml::Spanned;

use super::{Ray, unit};
use crate::photons::range::within;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CalibrationFile {
    columns: Spanned<u32>,
    rows: u32,
    /// x, y, z and range bias, row by row.
    pixels: Vec<Spanned<[f64; 4]>>,
}

/// The rays of a calibration, row by row.
///
/// # Errors
/// Returns what is wrong, after its line.
pub fn parse(text: &str, array: Array) -> Result<Vec<Ray>> {
    let line = |at: usize| {
        let before = text.get(..at).unwrap_or(text);
        before.matches('\n').count() + 1
    };
    let file: CalibrationFile = toml::from_str(text).map_err(|error| {
        let at = error.span().map_or(0, |span| span.start);
        anyhow!("line {}: {}", line(at), printable(error.message()))
    })?;
    let size = (*file.columns.get_ref(), file.rows);
    ensure!(
        size == (array.columns(), array.rows()),
        "line {}: is of {}x{} pixels, the events are of {}x{}",
        line(file.columns.span().start),
        size.0,
        size.1,
        array.columns(),
        array.rows()
    );
    let expected = array.pixels() as usize;
    // The first row too many, or the last row.
    let last = file.pixels.get(expected).or(file.pixels.last());
    ensure!(
        file.pixels.len() == expected,
        "line {}: {} pixels, should be {expected}",
        line(last.map_or(0, |pixel| pixel.span().start)),
        file.pixels.len()
    );
    let rays = file.pixels.iter().map(|pixel| {
        ray(*pixel.get_ref()).with_context(|| format!("line {}", line(pixel.span().start)))
    });
    rays.collect()
}

fn ray([x, y, z, bias_mm]: [f64; 4]) -> Result<Ray> {
    for side in [x, y, z] {
        within("direction", side, -1e6..=1e6)?;
    }
    let longest = x.abs().max(y.abs()).max(z.abs());
    ensure!(longest >= 1e-6, "the direction has no length");
    within("range bias", bias_mm, -1e6..=1e6)?;
    Ok(Ray {
        direction: unit([x, y, z]),
        bias_mm,
    })
}
