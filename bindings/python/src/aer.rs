//! AER files.

use std::io::BufWriter;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use dtof_data::events::aer_file::{self, Event, Writer};
use dtof_data::options::files::{destination, temporary_file};
use dtof_data::options::progress::Progress;
use dtof_data::options::{Refused, named};
use dtof_engine::settings::SettingsFile;
use dtof_run::export::{Format, ProjectionOptions};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyByteArray;

use crate::error::{Keywords, checked, options};
use crate::events::{Array, events, push};
use crate::work::{Control, work};

/// Events between reports of progress, which may stop the work.
const PROGRESS_INTERVAL: usize = 1 << 16;

/// The depth events of a file, and their array.
#[pyfunction]
pub fn read_events(py: Python<'_>, path: PathBuf) -> PyResult<(Bound<'_, PyByteArray>, Array)> {
    let (records, array) = work(py, None, move |control| {
        read(&path, control).with_context(|| path.display().to_string())
    })?;
    Ok((PyByteArray::new(py, &records), array))
}

fn read(path: &Path, mut control: &Control) -> Result<(Vec<u8>, Array)> {
    let mut reader = aer_file::open(path)?;
    let header = reader.header().clone();
    let ranges = header.ranges()?;
    let (mut records, mut read) = (Vec::new(), 0usize);
    while let Some(event) = reader.next_event()? {
        match event {
            Event::Depth(event) => {
                let cycle = event.cycle.raw();
                ensure!(
                    i64::try_from(cycle).is_ok(),
                    "cycle {cycle}: must be below 2^63 here"
                );
                push(&mut records, &event, &ranges);
            }
            Event::DynamicDepth(_) => {
                bail!("holds dynamic depth events; dtof export --format csv makes a table of them")
            }
        }
        read += 1;
        if read.is_multiple_of(PROGRESS_INTERVAL) {
            control.at(read as u64)?;
        }
    }
    Ok((records, Array::of(&header)))
}

/// Writes events as a file, whole or not at all.
#[pyfunction]
pub fn write_events(
    py: Python,
    path: PathBuf,
    records: PyBackedBytes,
    array: Array,
) -> PyResult<()> {
    work(py, None, move |_| {
        write(&path, &records, &array).with_context(|| path.display().to_string())
    })
}

/// Writes events in `format`, as the program does from an AER file. Returns its warnings.
#[pyfunction]
pub fn export(
    py: Python,
    path: PathBuf,
    format: &str,
    records: PyBackedBytes,
    array: Array,
    keywords: Keywords,
) -> PyResult<Vec<String>> {
    let options: ProjectionOptions = options(keywords)?;
    let format: Format = checked(|| {
        named(format).map_err(|reason| Refused::value("format", format, reason).into())
    })?;
    work(py, None, move |mut control| {
        let place = destination(&path, &[])?;
        let aer = temporary_file(&place.folder, ".dtof-")?.into_temp_path();
        write(&aer, &records, &array)?;
        let options = options.options(SettingsFile::default())?;
        let done = dtof_run::export::export(&aer, &path, format, &options, &mut control)?;
        ensure!(
            done.late == 0,
            "events are not in the order of their laser cycles"
        );
        Ok(done.warnings)
    })
}

fn write(path: &Path, records: &[u8], array: &Array) -> Result<()> {
    let header = array.header()?;
    let events = events(records, &header)?;
    let place = destination(path, &[])?;
    let file = BufWriter::new(temporary_file(&place.folder, ".dtof-")?);
    let mut writer = Writer::new(file, &header)?;
    for event in &events {
        writer.write(event)?;
    }
    let file = writer.finish()?.into_inner()?;
    file.as_file().sync_all()?;
    file.persist(&place.file)?;
    Ok(())
}
