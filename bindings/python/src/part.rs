//! Parts of a recording, replayed on several machines.

use anyhow::{Context, Result, ensure};
use dtof_calibrate::RunPhotons;
use dtof_core::Array;
use dtof_engine::settings::SettingsFile;
use dtof_photons::medium::Medium;
use dtof_photons::recorded::Whole;
use dtof_run::glass::brighter;
use dtof_run::replay::Options;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;

use crate::error::{Keywords, checked, options};
use crate::work;

/// The recording that a part is of: rows and columns of all captures, how many captures, the
/// photons of each pixel as numbers of 8 bytes, photons in bins that were cut off, and the address
/// of the first pixel of the part.
#[derive(FromPyObject)]
pub struct WholeGiven(u32, u32, usize, PyBackedBytes, u64, usize);

impl WholeGiven {
    /// The recording, of which `part` is a part.
    ///
    /// # Errors
    /// If there is none with such pixels.
    pub fn read(self, part: &Medium) -> Result<Whole> {
        let Self(rows, columns, captures, totals, cut_off, first) = self;
        let (totals, rest) = totals.as_chunks::<8>();
        ensure!(rest.is_empty(), "totals are numbers of 8 bytes");
        let totals: Vec<u64> = totals
            .iter()
            .map(|bytes| u64::from_le_bytes(*bytes))
            .collect();
        let array = Array::new(columns, rows);
        let array = array.with_context(|| {
            format!("{part}: {columns} columns and {rows} rows are not 1 to 65,536 pixels")
        })?;
        Ok(Whole::new(array, captures, &totals, first)?.with_cut_off(cut_off))
    }
}

/// Whether these are options of a replay.
#[pyfunction]
pub fn check_options(keywords: Keywords) -> PyResult<()> {
    options::<Options>(keywords).map(drop)
}

/// How many times as bright as `settings` say the cover glass is, and at least, if that is surely
/// more. `bins` are all photons of `pixels` pixels in so many laser cycles.
#[pyfunction]
#[allow(clippy::needless_pass_by_value, reason = "as Python gives it")]
pub fn cover_glass(
    settings: &str,
    bins: Vec<u64>,
    cycles: u64,
    pixels: u64,
) -> PyResult<Option<[f64; 2]>> {
    checked(|| {
        let run = RunPhotons {
            bins: &bins,
            cycles,
            pixels,
        };
        Ok(brighter(&SettingsFile::parse(settings)?, &run))
    })
}

/// From now on work has so many threads, 0 for one a core.
#[pyfunction]
pub fn use_threads(threads: usize) {
    work::use_threads(threads);
}
