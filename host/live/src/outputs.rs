//! The files of the live page: recordings and settings, in one folder, under names of their own.
//! None replaces another.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use dtof_device::monitor::EventFile;
use dtof_engine::settings::SettingsFile;
use dtof_events::aer_file::{Event, Header};
use dtof_options::files::aside;

/// Files of a kind in a folder, at most.
const MOST: u32 = 9999;

/// Where files are written, if anywhere.
#[derive(Debug, Default)]
pub struct Folder(Option<PathBuf>);

impl Folder {
    /// The folder, which is made if it is not there.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn new(path: Option<&Path>) -> Result<Self> {
        if let Some(path) = path {
            fs::create_dir_all(path).with_context(|| path.display().to_string())?;
        }
        Ok(Self(path.map(Path::to_owned)))
    }

    /// A name that is free: `NAME.END`, `NAME-2.END` and so on.
    fn free(&self, name: &str, end: &str) -> Result<PathBuf> {
        let Some(folder) = &self.0 else {
            bail!("nothing is written: start with --out DIR");
        };
        for number in 1..=MOST {
            let number = if number == 1 {
                String::new()
            } else {
                format!("-{number}")
            };
            let path = folder.join(format!("{name}{number}.{end}"));
            if fs::symlink_metadata(&path).is_err() {
                return Ok(path);
            }
        }
        bail!("{}: is full: {MOST} files of a kind", folder.display());
    }

    /// Writes settings, and gives the name of the file.
    ///
    /// # Errors
    /// If there is no folder, or it cannot be written.
    pub fn save(&self, settings: &SettingsFile) -> Result<PathBuf> {
        let path = self.free("dtof", "toml")?;
        let name = || path.display().to_string();
        let folder = path.parent().unwrap_or(Path::new("."));
        let mut file = aside(folder, ".dtof-")?;
        file.write_all(settings.to_toml()?.as_bytes())
            .and_then(|()| file.as_file().sync_all())
            .with_context(name)?;
        file.persist_noclobber(&path).with_context(name)?;
        Ok(path)
    }

    /// Begins a recording, and gives the name that its file gets.
    ///
    /// # Errors
    /// If there is no folder, or it cannot be written.
    pub fn record(&self, header: &Header) -> Result<(PathBuf, EventFile)> {
        let path = self.free("events", "aer")?;
        let recording = EventFile::new(&path, &[], header)?.that_replaces_nothing();
        Ok((path, recording))
    }
}

/// A recording that goes on, file after file, as long as it is wanted.
pub struct Recorder {
    folder: Folder,
    /// Whether events are to be recorded.
    is_wanted: bool,
    now: Option<(PathBuf, EventFile, u64)>,
}

/// What a recorder does, for pages.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Recorded {
    /// Whether events are recorded.
    pub on: bool,
    /// The file that is written, or was last.
    pub file: String,
    /// Events in it.
    pub events: u64,
    /// Files that are whole.
    pub files: u64,
    /// Why it ended by itself.
    pub error: String,
}

impl Recorder {
    /// One that records nothing yet.
    #[must_use]
    pub fn new(folder: Folder) -> Self {
        Self {
            folder,
            is_wanted: false,
            now: None,
        }
    }

    /// The folder.
    #[must_use]
    pub fn folder(&self) -> &Folder {
        &self.folder
    }

    /// Begins with events of a `header`, now, or with the next session if there is none.
    ///
    /// # Errors
    /// If no file can be begun.
    pub fn start(&mut self, header: Option<&Header>, told: &mut Recorded) -> Result<()> {
        if self.now.is_none()
            && let Some(header) = header
        {
            let (path, recording) = self.folder.record(header)?;
            *told = Recorded {
                on: true,
                file: path.display().to_string(),
                files: told.files,
                ..Recorded::default()
            };
            self.now = Some((path, recording, 0));
        }
        self.is_wanted = true;
        told.on = true;
        Ok(())
    }

    /// Ends the file; the next session begins another if that is still wanted.
    ///
    /// # Errors
    /// If the disk does not take it.
    pub fn end_file(&mut self, told: &mut Recorded) -> Result<()> {
        let Some((_, recording, events)) = self.now.take() else {
            return Ok(());
        };
        told.events = events;
        let ended = recording.finish();
        match &ended {
            Ok(()) => told.files += 1,
            Err(error) => self.failed(error, told),
        }
        ended
    }

    /// Ends it altogether.
    ///
    /// # Errors
    /// If the disk does not take it.
    pub fn stop(&mut self, told: &mut Recorded) -> Result<()> {
        self.is_wanted = false;
        told.on = false;
        self.end_file(told)
    }

    /// Begins the file of a session, if one is wanted.
    pub fn resume(&mut self, header: &Header, told: &mut Recorded) {
        if self.is_wanted
            && let Err(error) = self.start(Some(header), told)
        {
            self.failed(&error, told);
        }
    }

    /// Takes all events in. A disk that does not take them ends the recording.
    pub fn write(&mut self, events: &[Event], told: &mut Recorded) {
        let Some((_, recording, count)) = &mut self.now else {
            return;
        };
        let written = recording.write(events);
        match written {
            Ok(()) => {
                *count += events.len() as u64;
                told.events = *count;
            }
            Err(error) => {
                // Says where they are.
                let kept = self.end_file(told);
                self.failed(&kept.err().unwrap_or(error), told);
            }
        }
    }

    fn failed(&mut self, error: &anyhow::Error, told: &mut Recorded) {
        self.is_wanted = false;
        self.now = None;
        told.on = false;
        told.error = format!("{error:#}");
    }
}
