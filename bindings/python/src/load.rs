//! Recordings of every format as arrays.

use dtof_data::photons::input::Input;
use dtof_data::photons::open::counts;
use dtof_run::recording::{read_options, warnings};
use dtof_run::replay::Options;
use pyo3::prelude::*;
use pyo3::types::PyByteArray;

use crate::error::{Keywords, options_over};
use crate::input::PyInput;
use crate::work::work;

/// A recording.
#[derive(IntoPyObject)]
pub struct Loaded<'py> {
    /// Counts of 8 bytes, in the order of captures, rows, columns and bins.
    counts: Bound<'py, PyByteArray>,
    shape: [usize; 4],
    bin_width_ps: f64,
    offset_mm: Option<f64>,
    gate: Option<(u16, u16)>,
    /// True ranges of the pixels in millimetres.
    truth_mm: Option<Vec<Option<f64>>>,
    cycles: Option<u64>,
    cut_off: u64,
    notes: Vec<(String, String)>,
    warnings: Vec<String>,
}

/// Reads a recording as counts. Photon lists are summed over their laser cycles.
#[pyfunction]
pub fn load<'py>(py: Python<'py>, input: PyInput, keywords: Keywords) -> PyResult<Loaded<'py>> {
    let options: Options = options_over(keywords)?;
    let input = Input::from(input);
    let counts = work(py, None, move |_| {
        let requested = options.requested()?;
        let mut options = read_options(&requested);
        if requested.run.cycles.is_none() {
            options.cycles = Some(u64::MAX);
        }
        counts(&input, &options).map_err(|error| requested.add_file_name(error))
    })?;
    let side = |side: u32| side as usize;
    let shape = [
        counts.captures(),
        side(counts.array.rows()),
        side(counts.array.columns()),
        counts.metadata.bins,
    ];
    let all = counts.histograms.iter().flatten();
    let bytes = 8 * shape.iter().product::<usize>();
    let array = PyByteArray::new_with(py, bytes, |array| {
        for (place, count) in array.chunks_exact_mut(8).zip(all) {
            place.copy_from_slice(&count.to_le_bytes());
        }
        Ok(())
    })?;
    let metadata = counts.metadata;
    Ok(Loaded {
        counts: array,
        shape,
        bin_width_ps: metadata.bin_width_ps.to_num(),
        offset_mm: metadata.offset_mm.map(|offset| offset.to_num()),
        gate: metadata.gate,
        truth_mm: counts.truth_mm,
        cycles: counts.cycles,
        cut_off: metadata.cut_off,
        warnings: warnings(&metadata).collect(),
        notes: metadata.rows,
    })
}
