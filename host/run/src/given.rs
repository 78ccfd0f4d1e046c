//! The settings of a job: options, and the settings file that they override.

use std::path::{Path, PathBuf};

use anyhow::Result;

use dtof_data::options::keys::{Key, Kind};
use dtof_data::options::{Options, Refused};
use dtof_engine::settings::{DetectionSettings, RunSettings, SensorSettings, SettingsFile};

/// The settings file, and options of the sensor that hold for any input.
pub const SENSOR: &[Key] = &[
    SETTINGS,
    Key::of(SensorSettings::KEYS, "gate"),
    Key::of(SensorSettings::KEYS, "masked"),
    Key::of(SensorSettings::KEYS, "sigma_bins"),
];
/// The dead time of a TDC.
pub const TDC: &[Key] = &[Key::of(SensorSettings::KEYS, "dead_time")];
/// The same for a job that chooses the rule.
pub const TDC_OF_ANY_RULE: &[Key] = &[TDC[0].with_help(
    "Bins for which the TDC is blind after a photon, 0 to 65535. With all bins of a histogram it takes the first photon \
     of a laser cycle only [default: the sensor's, else 0]",
)];
/// The dither of a laser that a device fires.
pub const DITHER: &[Key] = &[
    Key::of(SensorSettings::KEYS, "dither_bins"),
    Key::of(SensorSettings::KEYS, "dither_seed"),
];
/// The option for a frame-based sensor instead of asynchronous pixels.
pub const FRAME: &[Key] = &[Key::of(RunSettings::KEYS, "frame")];
/// The option for a single decision of each pixel.
pub const ONCE: &[Key] = &[Key::of(RunSettings::KEYS, "decide_once")];
/// The option for the settings file.
const SETTINGS: Key = Key::new(
    "settings",
    Kind::Settings,
    "FILE",
    "Settings file in TOML, such as every run writes; options override it. docs/settings.md lists \
         its keys",
);

/// A settings file, and the options that override it.
#[derive(Clone, Debug, Default)]
pub struct Given {
    /// The settings file.
    pub file: Option<PathBuf>,
    /// The text of a settings file, in place of [`Self::file`]. Errors call it "settings".
    pub text: Option<String>,
    /// The options.
    pub options: SettingsFile,
}

impl Given {
    /// Sets the option `key`.
    ///
    /// # Errors
    /// Returns the reason if `text` is not a value for it.
    pub fn set(&mut self, key: &str, text: &str) -> Result<(), String> {
        self.options.set(key, text)
    }

    /// Where to put the name of the settings file, if `key` is the option for it.
    pub fn file(&mut self, key: &str) -> Option<&mut Option<PathBuf>> {
        (key == "settings").then_some(&mut self.file)
    }

    /// Checks that options do not exclude each other.
    ///
    /// # Errors
    /// Returns the option that cannot be used with another.
    pub fn check(&self) -> Result<(), Refused> {
        self.options.check()?;
        match self.given_event_option() {
            Some(key) => self.refuse(&["frame"], &format!("cannot be used with `{key}`")),
            None => Ok(()),
        }
    }

    /// An option that only pixels with events have, if one is given.
    fn given_event_option(&self) -> Option<&'static str> {
        let of_frames = ["estimator", "half_widths"];
        let keys = DetectionSettings::KEYS.iter().map(|key| key.name);
        self.first_given(keys.filter(|key| !of_frames.contains(key)))
    }

    fn first_given(&self, keys: impl IntoIterator<Item = &'static str>) -> Option<&'static str> {
        let given = self.options.keys().unwrap_or_default();
        keys.into_iter().find(|key| given.contains(*key))
    }

    /// Refuses the options `keys`, for the `reason`.
    pub(super) fn refuse(&self, keys: &[&'static str], reason: &str) -> Result<(), Refused> {
        match self.first_given(keys.iter().copied()) {
            Some(key) => Err(Refused::new(key, reason)),
            None => Ok(()),
        }
    }

    /// The options over the file.
    ///
    /// # Errors
    /// Fails if the file cannot be read.
    pub fn merged(&self) -> Result<SettingsFile> {
        Ok(self.options.clone().or(self.read()?))
    }

    /// The same for pixels with looks, whatever the file says.
    ///
    /// # Errors
    /// Fails if the file cannot be read.
    pub fn merged_with_looks(&self) -> Result<SettingsFile> {
        Ok(self.options.clone().or(self.read()?.with_looks()))
    }

    /// The file, without `frame` if options are for pixels with events.
    pub(super) fn read(&self) -> Result<SettingsFile> {
        let mut file = match (&self.text, &self.file) {
            (Some(text), _) => SettingsFile::parse_as(Path::new("settings"), text)?,
            (None, Some(file)) => SettingsFile::read(file)?,
            (None, None) => SettingsFile::default(),
        };
        if self.given_event_option().is_some() {
            file.run.frame = None;
        }
        Ok(file)
    }
}

/// The methods of [`Options`] that a job leaves to its [`Given`].
macro_rules! of_given {
    () => {
        fn file(&mut self, key: &str) -> Option<&mut Option<std::path::PathBuf>> {
            self.given.file(key)
        }

        fn check(&self) -> Result<(), dtof_data::options::Refused> {
            self.given.check()
        }
    };
}
pub(crate) use of_given;

/// The bins of a device, and its ranges.
const DEVICE: &[Key] = &[
    Key::of(SensorSettings::KEYS, "bin_width_ps").with_help(
        "Width of a bin in picoseconds, rounded to 1/65536 [default: the device's, or 250 if it has \
         none]",
    ),
    Key::of(SensorSettings::KEYS, "offset_mm").with_help(
        "Millimetres added to every range, rounded to 1/256 [default: the device's]",
    ),
    Key::of(SensorSettings::KEYS, "offsets_mm"),
];

/// Options of the pixels of a device, or of a single pixel.
#[derive(Clone, Debug, Default)]
pub struct Operation {
    /// The settings.
    pub given: Given,
}

impl Options for Operation {
    const KEYS: &'static [&'static [Key]] = &[DEVICE, SENSOR, TDC, DITHER, DetectionSettings::KEYS];

    fn set(&mut self, key: &'static str, text: &str) -> Result<(), String> {
        self.given.set(key, text)
    }

    of_given!();
}
