//! The files of the live page: recordings and settings, in one folder, under new names.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use dtof_data::events::aer_file::Event;
use dtof_data::options::Refused;
use dtof_data::options::files::temporary_file;
use dtof_data::options::rows::grouped;
use dtof_device::Setup;
use dtof_device::monitor::EventFile;
use dtof_engine::settings::SettingsFile;

/// Most files of a kind in a folder.
const MOST: u32 = 9999;

/// The folder for files, or none.
#[derive(Debug, Default)]
pub struct Folder(Option<PathBuf>);

impl Folder {
    /// The folder at `path`, which is created if it does not exist.
    ///
    /// # Errors
    /// Fails if it cannot be created.
    pub fn new(path: Option<&Path>) -> Result<Self> {
        if let Some(path) = path {
            fs::create_dir_all(path).with_context(|| path.display().to_string())?;
        }
        Ok(Self(path.map(Path::to_owned)))
    }

    /// A free name: `NAME.END`, `NAME-2.END` and so on.
    fn free(&self, name: &str, end: &str) -> Result<PathBuf> {
        let Some(folder) = &self.0 else {
            bail!(Refused::input("nothing is written: start with `out` DIR"));
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

    /// Writes settings and returns the path of the file.
    ///
    /// # Errors
    /// Fails if there is no folder, or it cannot be written.
    pub fn save(&self, settings: &SettingsFile) -> Result<PathBuf> {
        let path = self.free("dtof", "toml")?;
        let name = || path.display().to_string();
        let folder = path.parent().unwrap_or(Path::new("."));
        let mut file = temporary_file(folder, ".dtof-")?;
        file.write_all(settings.to_toml()?.as_bytes())
            .and_then(|()| file.as_file().sync_all())
            .with_context(name)?;
        file.persist_noclobber(&path).with_context(name)?;
        Ok(path)
    }

    /// Begins a recording and returns the path that its file will have.
    ///
    /// # Errors
    /// Fails if there is no folder, or it cannot be written.
    pub fn record(&self, setup: &Setup) -> Result<(PathBuf, EventFile)> {
        let path = self.free("events", "aer")?;
        let file =
            EventFile::new(&path, &[], &setup.header(), &setup.toml()?)?.that_replaces_nothing();
        Ok((path, file))
    }
}

/// Records events into one file after another.
pub struct Recorder {
    folder: Folder,
    file: Option<EventFile>,
    status: RecordingStatus,
    /// The first recording that was not saved, and why.
    failed: Option<String>,
}

/// Status of a recorder, for pages.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct RecordingStatus {
    /// Whether recording is on. A session without a file begins one then.
    pub on: bool,
    /// The current file, or the last one.
    pub file: String,
    /// Events in it.
    pub events: u64,
    /// Number of complete files.
    pub files: u64,
    /// Why recording has ended by itself.
    pub error: String,
}

impl Recorder {
    /// A recorder that is off.
    #[must_use]
    pub fn new(folder: Folder) -> Self {
        Self {
            folder,
            file: None,
            status: RecordingStatus::default(),
            failed: None,
        }
    }

    /// The folder of its files.
    #[must_use]
    pub fn folder(&self) -> &Folder {
        &self.folder
    }

    /// Its status.
    #[must_use]
    pub fn status(&self) -> &RecordingStatus {
        &self.status
    }

    /// Switches recording on or off. Without a `setup`, the next session begins the file. Returns a
    /// line that says what was done.
    ///
    /// # Errors
    /// Fails if no file can be begun, or the disk does not take the last one.
    pub fn switch(&mut self, on: bool, setup: Option<&Setup>) -> Result<String> {
        if !on {
            self.stop()?;
        } else if let Some(setup) = setup {
            self.begin_file(setup)?;
        }
        self.status.on = on;
        let RecordingStatus { file, events, .. } = &self.status;
        Ok(match (on, setup) {
            (true, Some(_)) => format!("Recording into {file}."),
            (true, None) => "Recording begins with the device.".to_owned(),
            (false, _) if file.is_empty() => "Nothing was recorded.".to_owned(),
            (false, _) => format!("Saved {} events as {file}.", grouped(*events)),
        })
    }

    /// Switches recording off and ends the file.
    ///
    /// # Errors
    /// Fails if the disk does not take it.
    pub fn stop(&mut self) -> Result<()> {
        self.status.on = false;
        self.end_file()
    }

    /// Ends the last file.
    ///
    /// # Errors
    /// Fails if the disk did not take one of the recordings.
    pub fn finish(&mut self) -> Result<()> {
        let ended = self.stop();
        match self.failed.take() {
            Some(failed) => bail!(failed),
            None => ended,
        }
    }

    /// Ends the file. Recording stays on, and the next session begins another file.
    ///
    /// # Errors
    /// Fails if the disk does not take it.
    pub fn end_file(&mut self) -> Result<()> {
        let ended = self.file.take().map(EventFile::finish);
        match &ended {
            None => {}
            Some(Ok(())) => self.status.files += 1,
            Some(Err(error)) => self.fail(error),
        }
        ended.unwrap_or(Ok(()))
    }

    /// Begins the file of a session, if recording is on.
    pub fn resume(&mut self, setup: &Setup) {
        if self.status.on
            && let Err(error) = self.begin_file(setup)
        {
            self.fail(&error);
        }
    }

    /// Records events. If the disk does not take them, recording is switched off.
    pub fn write(&mut self, events: &[Event]) {
        let Some(file) = &mut self.file else {
            return;
        };
        match file.write(events) {
            Ok(()) => self.status.events += events.len() as u64,
            Err(error) => {
                // The error of the end says where the events are.
                let ended = self.end_file();
                self.fail(&ended.err().unwrap_or(error));
            }
        }
    }

    fn begin_file(&mut self, setup: &Setup) -> Result<()> {
        if self.file.is_some() {
            return Ok(());
        }
        let (path, file) = self.folder.record(setup)?;
        self.file = Some(file);
        self.status = RecordingStatus {
            on: true,
            file: path.display().to_string(),
            files: self.status.files,
            ..RecordingStatus::default()
        };
        Ok(())
    }

    fn fail(&mut self, error: &anyhow::Error) {
        self.status.on = false;
        self.status.error = format!("{error:#}");
        self.failed.get_or_insert(self.status.error.clone());
    }
}
