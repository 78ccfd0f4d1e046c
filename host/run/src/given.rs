//! The settings of a job: options, and the settings file that they override.

use std::path::PathBuf;

use anyhow::Result;

use dtof_engine::settings::{Detection, SettingsFile};
use dtof_options::{Options, Refused};

/// The settings file, and what options say of the sensor beside a recording.
pub const SENSOR: &[&str] = &["settings", "gate", "masked", "sigma_bins"];
/// A frame-based sensor in place of asynchronous pixels.
pub const FRAME: &[&str] = &["frame"];

/// Settings that are given.
#[derive(Clone, Debug, Default)]
pub struct Given {
    /// The settings file.
    pub file: Option<PathBuf>,
    /// The options.
    pub options: SettingsFile,
}

impl Given {
    /// Sets a key of a settings file.
    ///
    /// # Errors
    /// Why it cannot be so.
    pub fn set(&mut self, key: &str, text: &str) -> Result<(), String> {
        self.options.set(key, text)
    }

    /// The place of the settings file's name.
    pub fn file(&mut self, key: &str) -> Option<&mut Option<PathBuf>> {
        (key == "settings").then_some(&mut self.file)
    }

    /// Are there two options of which only one can be given?
    ///
    /// # Errors
    /// Which.
    pub fn check(&self) -> Result<(), Refused> {
        self.options.check()?;
        if let (Some(_), Some(key)) = (self.options.run.frame, self.decides()) {
            return Err(Refused::new(
                "frame",
                format!("cannot be used with `{key}`"),
            ));
        }
        Ok(())
    }

    /// An option of detection that frames do not have, if one is given.
    fn decides(&self) -> Option<&'static str> {
        let keys = self.options.keys().unwrap_or_default();
        let of_frames = ["estimator", "half_widths"];
        let mut of_pixels = Detection::KEYS
            .iter()
            .filter(|key| !of_frames.contains(key));
        of_pixels.find(|key| keys.contains(**key)).copied()
    }

    /// The options, then the file.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn merged(&self) -> Result<SettingsFile> {
        Ok(self.options.clone().or(self.read()?))
    }

    /// The file, less what the options leave no room for.
    pub(super) fn read(&self) -> Result<SettingsFile> {
        let file = self.file.as_deref().map(SettingsFile::read);
        let mut file = file.transpose()?.unwrap_or_default();
        if self.decides().is_some() {
            file.run.frame = None;
        }
        Ok(file)
    }
}

/// What [`Options`] of a job that has them leaves to [`Given`].
macro_rules! of_given {
    () => {
        fn file(&mut self, key: &str) -> Option<&mut Option<std::path::PathBuf>> {
            self.given.file(key)
        }

        fn check(&self) -> Result<(), dtof_options::Refused> {
            self.given.check()
        }
    };
}
pub(crate) use of_given;

/// How pixels operate: those of a device, or one alone.
#[derive(Clone, Debug, Default)]
pub struct Operation {
    /// The settings.
    pub given: Given,
}

impl Options for Operation {
    const KEYS: &'static [&'static [&'static str]] =
        &[&["bin_width_ps", "offset_mm"], SENSOR, Detection::KEYS];

    fn set(&mut self, key: &'static str, text: &str) -> Result<(), String> {
        self.given.set(key, text)
    }

    of_given!();
}
