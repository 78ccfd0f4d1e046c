//! The events of a device as an AER file.

use std::fs;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use tempfile::NamedTempFile;

use dtof_data::events::aer_file::{Event, Header, Writer};
use dtof_data::options::files::{destination, flush_to_disk, temporary_file};

/// An AER file that is being written. It has a temporary name until [`EventFile::finish`] moves it
/// to its place. If it cannot be moved, the temporary file stays.
///
/// Written events are in the temporary file even if the program is killed.
pub struct EventFile {
    aer: Writer<BufWriter<NamedTempFile>>,
    path: PathBuf,
    aside: PathBuf,
    is_empty: bool,
    /// An existing file is not replaced.
    is_new: bool,
    /// An event could not be written, so the file cannot be completed.
    is_broken: bool,
}

impl EventFile {
    /// Begins a file that replaces none of `inputs`, with `settings` in its header.
    ///
    /// # Errors
    /// Fails if its folder cannot be written, or if `path` is something other than a file.
    pub fn new(path: &Path, inputs: &[&Path], header: &Header, settings: &str) -> Result<Self> {
        let place = destination(path, inputs)?;
        let name = || path.display().to_string();
        let mut file = temporary_file(&place.folder, ".dtof-recording-").with_context(name)?;
        file.disable_cleanup(true);
        let aside = file.path().to_owned();
        let begun =
            Writer::with_settings(BufWriter::new(file), header, settings).and_then(|mut aer| {
                aer.flush()?;
                Ok(aer)
            });
        if begun.is_err() {
            // The file is empty. A failure to remove it matters less than `begun`.
            let _ = fs::remove_file(&aside);
        }
        Ok(Self {
            aer: begun.with_context(name)?,
            path: place.file,
            aside,
            is_empty: true,
            is_new: false,
            is_broken: false,
        })
    }

    /// The same, but `finish` fails if a file has appeared at its place meanwhile.
    #[must_use]
    pub fn that_replaces_nothing(mut self) -> Self {
        self.is_new = true;
        self
    }

    /// Writes events in the order they come.
    ///
    /// # Errors
    /// Fails if the disk does not take them.
    pub fn write(&mut self, events: &[Event]) -> Result<()> {
        self.is_empty &= events.is_empty();
        let written = events.iter().try_for_each(|event| self.aer.write(event));
        let written = written.and_then(|()| self.aer.flush());
        self.is_broken |= written.is_err();
        written.with_context(|| self.path.display().to_string())
    }

    /// Ends the file after a failure. Without any event the file is removed, and an older one at its
    /// place stays.
    ///
    /// # Errors
    /// Fails as [`EventFile::finish`] does, or if the file cannot be removed.
    pub fn finish_after_failure(self) -> Result<()> {
        if !self.is_empty {
            return self.finish();
        }
        drop(self.aer);
        fs::remove_file(&self.aside).with_context(|| self.aside.display().to_string())
    }

    /// Ends the file and moves it to its place.
    ///
    /// # Errors
    /// Fails if the disk does not take it, or has not taken an event. The error says where the events
    /// are.
    pub fn finish(self) -> Result<()> {
        let Self {
            aer,
            path,
            aside,
            is_new,
            is_broken,
            ..
        } = self;
        let moved = || -> Result<()> {
            ensure!(!is_broken, "the disk did not take an event");
            let file = flush_to_disk(aer.finish()?)?;
            let moved = if is_new {
                file.persist_noclobber(&path)
            } else {
                file.persist(&path)
            };
            moved.map_err(|error| error.error)?;
            Ok(())
        };
        moved().with_context(|| {
            let (path, aside) = (path.display(), aside.display());
            format!("{path}: cannot be written, {aside} has what was recorded")
        })
    }
}

#[cfg(test)]
mod tests {
    use dtof_core::Array;
    use dtof_core::fixed::types::{I24F8, U16F16};

    use super::*;

    const HEADER: Header = Header {
        bins: 128,
        array: Array::new(2, 2).unwrap(),
        bin_width_ps: U16F16::lit("250"),
        offset_mm: I24F8::ZERO,
        offsets_mm: Vec::new(),
        laser_millihertz: 0,
        start_us: 0,
    };

    #[test]
    fn only_a_file_in_a_folder_that_is_there_is_begun() {
        let folder = tempfile::tempdir().unwrap();
        let gone = folder.path().join("gone").join("events.aer");
        for (path, part) in [
            (folder.path(), ": exists and is not a file"),
            (&gone, ": there is no folder "),
        ] {
            let error = EventFile::new(path, &[], &HEADER, "")
                .map(|_| ())
                .unwrap_err();
            assert!(format!("{error:#}").contains(part), "{error:#}");
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_new_one_replaces_nothing_that_came_meanwhile() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("events.aer");
        let recording = EventFile::new(&path, &[], &HEADER, "").unwrap();
        let recording = recording.that_replaces_nothing();
        fs::write(&path, "older").unwrap();
        let error = format!("{:#}", recording.finish().unwrap_err());
        assert!(error.contains(" has what was recorded"), "{error}");
        assert_eq!(fs::read(path).unwrap(), b"older");
    }

    #[test]
    fn what_cannot_be_moved_to_its_place_stays_and_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("events.aer");
        let recording = EventFile::new(&path, &[], &HEADER, "").unwrap();
        let aside = recording.aside.clone();
        fs::create_dir(&path).unwrap();
        let error = format!("{:#}", recording.finish().unwrap_err());
        assert!(
            error.contains(&format!("{} has what was recorded", aside.display())),
            "{error}"
        );
        assert_eq!(error.matches("os error").count(), 1, "{error}");
        // The header and the end.
        assert_eq!(fs::read(aside).unwrap().len(), 64 + 16);
    }
}
