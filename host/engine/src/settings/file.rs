//! Reading and writing the file.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use anyhow::{Context, Error, Result, anyhow, ensure};
use serde::Serialize;
use toml::{Table, Value};

use super::{DetectionSettings, RaySettings, RunSettings, SensorSettings};
use dtof_data::options::files::read_text;
use dtof_data::options::keys::{Key, Kind};
use dtof_data::options::numbers::boolean;
use dtof_data::options::{KeysOfFile, NO_OPTION, Refused};

/// The first line of every file that this program writes.
pub const MARK: &str = "# dtof settings";

/// The sections with their keys and comments, in the order in which they are written.
pub(super) const SECTIONS: [(&str, &[Key]); 4] = [
    ("sensor", SensorSettings::KEYS),
    ("detection", DetectionSettings::KEYS),
    ("rays", RaySettings::KEYS),
    ("run", RunSettings::KEYS),
];

/// A key of older files: `true` is a TDC of the first photon of a laser cycle.
const ONE_HIT: &str = "one_hit_tdc";

/// A settings file, or the same settings from the command line. All of them may be missing.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SettingsFile {
    /// The sensor.
    pub sensor: SensorSettings,
    /// How pixels decide.
    pub detection: DetectionSettings,
    /// The rays of the pixels.
    pub rays: RaySettings,
    /// What is replayed or simulated.
    pub run: RunSettings,
    /// The dead time that sensor or scene say, in bins, for settings without one.
    #[serde(skip)]
    pub dead_time_of_sensor: Option<u16>,
    /// Range in bins and seed of the dither that the laser of a device or scene has; otherwise it is the one that
    /// [`Self::sensor`] asks for. It is not written: another laser may have another.
    #[serde(skip)]
    pub dither_of_laser: Option<(u16, u64)>,
    /// The file that set some of them.
    #[serde(skip)]
    pub file: Option<KeysOfFile>,
}

impl SettingsFile {
    /// Reads a file.
    ///
    /// # Errors
    /// Returns one line with the name of the file, and the line or the key that is wrong.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse_as(path, &read_text(path)?)
    }

    /// Parses the text of a file, which errors call `path`.
    ///
    /// # Errors
    /// Those of [`Self::read`].
    pub fn parse_as(path: &Path, text: &str) -> Result<Self> {
        let name = || path.display().to_string();
        let mut file = Self::parse(text).map_err(|error| match error.downcast_ref() {
            Some(Refused { key: Some(key), .. }) => {
                let sections = SECTIONS.iter().map(|(section, ..)| *section);
                let keys = SECTIONS.iter().flat_map(|(_, keys)| keys.iter());
                let keys = keys.map(|key| key.name);
                let keys = sections.chain(keys).chain([&**key]);
                let keys = keys.map(str::to_owned).collect();
                let path = path.to_owned();
                dtof_data::options::add_file_name(error, Some(&KeysOfFile { path, keys }))
            }
            _ => error.context(name()),
        })?;
        // A relative path starts at the folder of the file.
        if let (Some(rays), Some(folder)) = (&mut file.rays.calibration, path.parent()) {
            *rays = std::path::absolute(folder.join(&rays)).with_context(name)?;
        }
        let (path, keys) = (path.to_owned(), file.keys().with_context(name)?);
        file.file = Some(KeysOfFile { path, keys });
        Ok(file)
    }

    /// Parses the text of a file.
    ///
    /// # Errors
    /// Names the line that is not TOML, or the key that is wrong.
    pub fn parse(text: &str) -> Result<Self> {
        let sections: Table = toml::from_str(text).map_err(|error| {
            let before = error.span().and_then(|span| text.get(..span.start));
            let line = before.map_or(1, |text| text.matches('\n').count() + 1);
            anyhow!("line {line}: {}", error.message())
        })?;
        let mut file = Self::default();
        for (section, values) in &sections {
            let Some((_, keys)) = SECTIONS.iter().find(|(name, ..)| name == section) else {
                return Err(match section_of(section) {
                    Some(name) => Refused::new(section, format!("belongs in [{name}]")),
                    None => Refused::unknown(section, None, SECTIONS.map(|(section, _)| section)),
                }
                .into());
            };
            let Value::Table(values) = values else {
                let reason = format!("is a section: [{section}]");
                return Err(Refused::new(section, reason).into());
            };
            for (key, value) in values {
                if section_of(key) != Some(section) {
                    return Err(match section_of(key) {
                        Some(name) => Refused::new(key, format!("belongs in [{name}]")),
                        None => {
                            Refused::unknown(key, Some(section), keys.iter().map(|key| key.name))
                        }
                    }
                    .into());
                }
                let is_empty = value.as_array().is_some_and(Vec::is_empty);
                // An empty list sets nothing.
                if !(is_empty && matches!(&**key, "masked" | "glass_bins" | "offsets_mm")) {
                    file.set_value(key, value)?;
                }
            }
        }
        let sensor = sections.get("sensor").and_then(Value::as_table);
        if sensor
            .is_some_and(|sensor| sensor.contains_key(ONE_HIT) && sensor.contains_key("dead_time"))
        {
            return Err(Refused::new(ONE_HIT, "cannot be used with `dead_time`").into());
        }
        file.check()?;
        Ok(file)
    }

    /// Sets a key to a TOML value.
    fn set_value(&mut self, key: &str, value: &Value) -> Result<(), Refused> {
        let text = text_of(value);
        if value.as_str() == Some("") {
            return Err(Refused::new(key, "needs a value"));
        }
        let refused = |reason| Refused::value(key, &text, reason);
        let list = value.as_array();
        let is_text = value.is_str() || list.is_some_and(|list| list.iter().any(Value::is_str));
        let kind = key_of(key).map(|(_, key)| key.kind);
        match (kind.is_some_and(Kind::is_list), list) {
            (true, None) => return Err(refused("must be a list".to_owned())),
            (false, Some(_)) => return Err(refused("must be one value".to_owned())),
            _ => {}
        }
        self.set(key, &text).map_err(refused)?;
        match (kind.is_some_and(Kind::is_text), is_text) {
            (true, false) => Err(refused("must be in quotes".to_owned())),
            (false, true) => Err(refused("must not be in quotes".to_owned())),
            _ => Ok(()),
        }
    }

    /// Sets a key of any section.
    ///
    /// # Errors
    /// Says what the value must be, or returns [`NO_OPTION`] for another key.
    pub fn set(&mut self, key: &str, text: &str) -> Result<(), String> {
        match section_of(key) {
            Some("sensor") if key == ONE_HIT => {
                if boolean(text)? {
                    self.sensor.dead_time = Some(u16::MAX);
                }
                Ok(())
            }
            Some("sensor") => self.sensor.set(key, text),
            Some("detection") => self.detection.set(key, text),
            Some("rays") => self.rays.set(key, text),
            Some(_) => self.run.set(key, text),
            None => Err(NO_OPTION.to_owned()),
        }
    }

    /// Checks that no two options exclude each other.
    ///
    /// # Errors
    /// Names the two.
    pub fn check(&self) -> Result<(), Refused> {
        let Self {
            detection,
            rays,
            run,
            ..
        } = self;
        let z = detection.z.is_some() && detection.false_alarm.is_some();
        let view = rays.field_of_view_degrees.is_some() && rays.calibration.is_some();
        let length = run.photons_per_cycle.is_some() && run.recorded_cycles.is_some();
        for (are_both, key, other) in [
            (z, "z", "false_alarm"),
            (view, "field_of_view_degrees", "calibration"),
            (length, "photons_per_cycle", "recorded_cycles"),
        ] {
            if are_both {
                let reason = format!("cannot be used with `{other}`");
                return Err(Refused::new(key, reason));
            }
        }
        Ok(())
    }

    /// The keys that are set.
    ///
    /// # Errors
    /// Fails if a value cannot be written as TOML.
    pub fn keys(&self) -> Result<BTreeSet<String>> {
        let sections = Table::try_from(self)?;
        let tables = sections.values().filter_map(Value::as_table);
        Ok(tables.flat_map(Table::keys).cloned().collect())
    }

    /// Records that an option sets `key`, so that errors do not name the file.
    pub fn override_key(&mut self, key: &str) {
        if let Some(file) = &mut self.file {
            file.keys.remove(key);
        }
    }

    /// Checks that the settings are for the bins of a device.
    ///
    /// # Errors
    /// Fails if they have another number of bins.
    pub fn check_bins(&self, bins: u16) -> Result<()> {
        let own = self.sensor.bins.unwrap_or(bins);
        ensure!(
            own == bins,
            "the settings are for {own} bins, the device has {bins}"
        );
        Ok(())
    }

    /// Adds the name of the file to `error`, if the file set the key it is about.
    #[must_use]
    pub fn add_file_name(&self, error: Error) -> Error {
        dtof_data::options::add_file_name(error, self.file.as_ref())
    }

    /// These settings for pixels with looks: without `decide_once`, and without the z of a single decision.
    #[must_use]
    pub fn with_looks(mut self) -> Self {
        if self.run.decide_once.take() == Some(true) {
            self.detection.z = None;
        }
        self
    }

    /// These settings for a single decision of each pixel by itself, or with its neighbours: with `decide_once`, without
    /// blocks, and without the z of a file that is for looks.
    #[must_use]
    pub fn deciding_once(mut self) -> Self {
        let is_of_file = |file: &KeysOfFile| file.keys.contains("z");
        if self.run.decide_once != Some(true) && self.file.as_ref().is_some_and(is_of_file) {
            self.detection.z = None;
        }
        self.run.decide_once = Some(true);
        (self.detection.binning, self.detection.patience) = (None, None);
        self
    }

    /// These settings, and those of `other` that they lack.
    #[must_use]
    pub fn or(self, mut other: Self) -> Self {
        // A z is for looks, or for a single decision.
        let decides_once = self.run.decide_once.or(other.run.decide_once) == Some(true);
        if decides_once != (other.run.decide_once == Some(true)) {
            other.detection.z = None;
        }
        // Half widths belong to a pulse.
        let sigma = self.sensor.sigma_bins;
        if sigma.is_some() && sigma != other.sensor.sigma_bins {
            other.detection.half_widths = None;
        }
        let (file, own) = (other.file.take(), self.keys());
        let mut merged = Self {
            sensor: self.sensor.or(other.sensor),
            detection: self.detection.or(other.detection),
            rays: self.rays.or(other.rays),
            run: self.run.or(other.run),
            dead_time_of_sensor: self.dead_time_of_sensor.or(other.dead_time_of_sensor),
            dither_of_laser: self.dither_of_laser.or(other.dither_of_laser),
            file: self.file,
        };
        // The file still sets the keys that no option sets or drops.
        if let (None, Some(mut file), Ok(own), Ok(all)) = (&merged.file, file, own, merged.keys()) {
            file.keys
                .retain(|key| all.contains(key) && !own.contains(key));
            merged.file = Some(file);
        }
        merged
    }

    /// Drops what belongs to a single recording.
    #[must_use]
    pub fn without_recording(mut self) -> Self {
        (self.run.axes, self.run.array) = (None, None);
        (self.run.capture, self.run.cycles) = (None, None);
        self
    }

    /// The text of the file: one line a key that is set, with its comment.
    ///
    /// # Errors
    /// Fails if a value cannot be written as TOML.
    pub fn to_toml(&self) -> Result<String> {
        let all = Table::try_from(self)?;
        let mut text = format!("{MARK}: `--settings FILE` takes them, options override them.\n");
        for (section, keys) in SECTIONS {
            let given = all.get(section).and_then(Value::as_table);
            let lines = keys.iter().filter_map(|key| {
                let value = given?.get(key.name)?;
                Some((format!("{} = {value}", key.name), key.comment))
            });
            let lines: Vec<_> = lines.collect();
            if lines.is_empty() {
                continue;
            }
            write!(text, "\n[{section}]\n")?;
            for (line, comment) in lines {
                writeln!(text, "{line:<28} # {comment}")?;
            }
        }
        Ok(text)
    }
}

/// The section in which a key stands.
fn section_of(key: &str) -> Option<&'static str> {
    match key {
        ONE_HIT => Some("sensor"),
        key => key_of(key).map(|(section, _)| section),
    }
}

/// A key, and the section in which it stands.
pub(super) fn key_of(name: &str) -> Option<(&'static str, &'static Key)> {
    let mut keys = SECTIONS
        .iter()
        .flat_map(|(section, keys)| keys.iter().map(move |key| (*section, key)));
    keys.find(|(_, key)| key.name == name)
}

/// A TOML value as text, as an option has it. Elements of a list are separated by commas.
fn text_of(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Float(number) => number.to_string(),
        Value::Array(values) => {
            let element = |value: &Value| match value {
                Value::Array(_) => value.to_string(),
                value => text_of(value),
            };
            let texts: Vec<String> = values.iter().map(element).collect();
            texts.join(",")
        }
        value => value.to_string(),
    }
}
