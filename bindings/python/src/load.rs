//! Recordings of every format as arrays.

use anyhow::Result;
use dtof_photons::medium::Medium;
use dtof_photons::open::{Counts, counts};
use dtof_run::recording::{opening, warnings};
use dtof_run::replay::Options;
use pyo3::prelude::*;
use pyo3::types::PyByteArray;

use crate::error::{Keywords, checked, options};
use crate::medium::Given;
use crate::work::work;

/// A recording.
#[derive(IntoPyObject)]
pub struct Loaded<'py> {
    /// Counts of 8 bytes: captures, rows, columns, bins.
    counts: Bound<'py, PyByteArray>,
    shape: [usize; 4],
    bin_width_ps: f64,
    offset_mm: Option<f64>,
    gate: Option<(u16, u16)>,
    /// Of each pixel, in millimetres.
    truth_mm: Option<Vec<Option<f64>>>,
    cycles: Option<u64>,
    cut_off: u64,
    notes: Vec<(String, String)>,
    warnings: Vec<String>,
}

/// Reads a recording. Photon lists are summed over their laser cycles.
#[pyfunction]
pub fn load<'py>(py: Python<'py>, input: Given, keywords: Keywords) -> PyResult<Loaded<'py>> {
    let options: Options = options(keywords)?;
    let input = Medium::from(input);
    let counts = work(py, None, move |_| {
        let said = options.said()?;
        let mut opening = opening(&said);
        if said.run.cycles.is_none() {
            opening.cycles = u64::MAX;
        }
        counts(&input, &opening).map_err(|error| said.blame(error))
    })?;
    let shape = checked(|| shape(&counts))?;
    let all = counts.captures.iter().flatten().flatten();
    let bytes = 8 * shape.iter().product::<usize>();
    let array = PyByteArray::new_with(py, bytes, |array| {
        for (place, count) in array.chunks_exact_mut(8).zip(all) {
            place.copy_from_slice(&count.to_le_bytes());
        }
        Ok(())
    })?;
    let known = counts.known;
    Ok(Loaded {
        counts: array,
        shape,
        bin_width_ps: known.bin_width_ps.to_num(),
        offset_mm: known.offset_mm.map(|offset| offset.to_num()),
        gate: known.gate,
        truth_mm: counts.truth_mm,
        cycles: counts.cycles,
        cut_off: known.cut_off,
        warnings: warnings(&known).collect(),
        notes: known.rows,
    })
}

/// Captures, rows, columns and bins.
fn shape(counts: &Counts) -> Result<[usize; 4]> {
    let captures = counts.captures.len();
    let columns = usize::try_from(counts.array.columns())?;
    let pixels = counts.captures.first().map_or(0, Vec::len);
    let same = counts.captures.iter().flatten();
    let bins = counts.known.bins;
    anyhow::ensure!(
        columns > 0
            && pixels.is_multiple_of(columns)
            && counts
                .captures
                .iter()
                .all(|capture| capture.len() == pixels)
            && same.clone().all(|histogram| histogram.len() == bins),
        "captures of different sizes"
    );
    Ok([captures, pixels / columns, columns, bins])
}
