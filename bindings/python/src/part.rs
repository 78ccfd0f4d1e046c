//! Parts of a recording, for replay on several machines.

use anyhow::{Context, Result, ensure};
use dtof_calibrate::RunPhotons;
use dtof_core::Array;
use dtof_engine::settings::SettingsFile;
use dtof_photons::input::Input;
use dtof_photons::recorded::Layout;
use dtof_run::glass::brighter;
use dtof_run::replay::Options;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;

use crate::error::{Keywords, checked, options_over};

/// The layout of a recording that is replayed in parts: rows and columns of all captures together, the
/// number of captures, the photons of each pixel as numbers of 8 bytes, photons in bins that were cut off,
/// and the address of the first pixel of the part.
#[derive(FromPyObject)]
pub struct PyLayout(u32, u32, usize, PyBackedBytes, u64, usize);

impl PyLayout {
    /// The layout; `part` names the part in errors.
    ///
    /// # Errors
    /// Fails if the number of pixels or totals is invalid.
    pub fn read(self, part: &Input) -> Result<Layout> {
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
        Ok(Layout {
            cut_off,
            ..Layout::new(array, captures, &totals, first)?
        })
    }
}

/// Checks the options of a replay.
#[pyfunction]
pub fn check_options(keywords: Keywords) -> PyResult<()> {
    options_over::<Options>(keywords).map(drop)
}

/// Checks the options of a replay in parts.
#[pyfunction]
pub fn check_part_options(keywords: Keywords) -> PyResult<()> {
    let options: Options = options_over(keywords)?;
    checked(|| Ok(options.check_for_parts()?))
}

/// How many times as bright crosstalk of the cover glass is as in `settings`, and at least, if it is
/// significantly brighter. `bins` are all photons of `pixels` pixels in `cycles` laser cycles.
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
