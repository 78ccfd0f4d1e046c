//! The events of a device as an AER file.

use std::io::BufWriter;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use tempfile::NamedTempFile;

use crate::aer_file::{Event, Header, Writer};
use crate::output::{aside, flushed};

/// A file on its way: written aside, and at its place once [`Recording::finish`] has
/// returned.
pub struct Recording {
    aer: Writer<BufWriter<NamedTempFile>>,
    path: PathBuf,
}

impl Recording {
    /// Begins a file.
    ///
    /// # Errors
    /// If nothing can be written in its folder.
    pub fn new(path: &Path, header: &Header) -> Result<Self> {
        let folder = match path.parent() {
            Some(folder) if folder != "" => folder,
            _ => Path::new("."),
        };
        let name = || path.display().to_string();
        let file = BufWriter::new(aside(folder).with_context(name)?);
        Ok(Self {
            aer: Writer::new(file, header).with_context(name)?,
            path: path.to_owned(),
        })
    }

    /// Writes events in the order they come.
    ///
    /// # Errors
    /// If the disk does not take them.
    pub fn write(&mut self, events: &[Event]) -> Result<()> {
        for event in events {
            let written = self.aer.write(event);
            written.with_context(|| self.path.display().to_string())?;
        }
        Ok(())
    }

    /// Ends the file and moves it to its place.
    ///
    /// # Errors
    /// If the disk does not take it.
    pub fn finish(self) -> Result<()> {
        let name = || self.path.display().to_string();
        let file = flushed(self.aer.finish().with_context(name)?).with_context(name)?;
        file.persist(&self.path).with_context(name)?;
        Ok(())
    }
}
