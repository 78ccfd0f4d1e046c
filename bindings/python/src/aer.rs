//! AER files.

use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use dtof_core::RangeScale;
use dtof_events::aer_file::{Event, Reader, Writer};
use dtof_options::files::{destination, temporary_file};
use dtof_options::progress::Progress;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyByteArray;

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
    let mut reader = Reader::new(BufReader::new(File::open(path)?))?;
    let header = *reader.header();
    let scale = RangeScale::new(header.bin_width_ps, header.offset_mm)?;
    let (mut records, mut read) = (Vec::new(), 0usize);
    while let Some(event) = reader.next_event()? {
        match event {
            Event::Depth(event) => push(&mut records, &event, &scale),
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
