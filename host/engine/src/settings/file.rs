//! Reading and writing the file.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use anyhow::{Context, Error, Result, anyhow, ensure};
use serde::Serialize;
use toml::{Table, Value};

use super::{DetectionSettings, RaySettings, RunSettings, SensorSettings};
use dtof_options::files::read_text;
use dtof_options::numbers::boolean;
use dtof_options::{KeysOfFile, NO_OPTION, Refused};

/// The first line of every file that this program writes.
pub const MARK: &str = "# dtof settings";

/// The sections with their keys and comments, in the order in which they are written.
const SECTIONS: [(&str, &[&str], &[&str]); 4] = [
    ("sensor", SensorSettings::KEYS, SensorSettings::COMMENTS),
    (
        "detection",
        DetectionSettings::KEYS,
        DetectionSettings::COMMENTS,
    ),
    ("rays", RaySettings::KEYS, RaySettings::COMMENTS),
    ("run", RunSettings::KEYS, RunSettings::COMMENTS),
];

/// The keys whose values are lists.
const LISTS: [&str; 6] = [
    "gate",
    "offsets_mm",
    "masked",
    "glass_bins",
    "half_widths",
    "field_of_view_degrees",
];

/// The keys whose values are strings.
const TEXTS: [&str; 5] = ["rule", "estimator", "calibration", "axes", "array"];

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
                let keys = SECTIONS
                    .iter()
                    .flat_map(|(_, keys, _)| keys.iter().copied());
                let keys = sections.chain(keys).chain([&**key]);
                let keys = keys.map(str::to_owned).collect();
                let path = path.to_owned();
                dtof_options::add_file_name(error, Some(&KeysOfFile { path, keys }))
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
            let Some((_, keys, _)) = SECTIONS.iter().find(|(name, ..)| name == section) else {
                return Err(match section_of(section) {
                    Some(name) => Refused::new(section, format!("belongs in [{name}]")),
                    None => Refused::unknown(section, SECTIONS.map(|(section, ..)| section)),
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
                        None => Refused::unknown(key, keys.iter().copied()),
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
        match (LISTS.contains(&key), list) {
            (true, None) => return Err(refused("must be a list".to_owned())),
            (false, Some(_)) => return Err(refused("must be one value".to_owned())),
            _ => {}
        }
        self.set(key, &text).map_err(refused)?;
        match (TEXTS.contains(&key), is_text) {
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
        dtof_options::add_file_name(error, self.file.as_ref())
    }

    /// These settings for pixels with looks: without `decide_once`, and without the z of a single decision.
    #[must_use]
    pub fn with_looks(mut self) -> Self {
        if self.run.decide_once.take() == Some(true) {
            self.detection.z = None;
        }
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
        for (section, keys, comments) in SECTIONS {
            let given = all.get(section).and_then(Value::as_table);
            let lines = keys.iter().zip(comments).filter_map(|(key, comment)| {
                let value = given?.get(*key)?;
                Some((format!("{key} = {value}"), comment))
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
    if key == ONE_HIT {
        return Some("sensor");
    }
    let mut sections = SECTIONS.iter();
    let section = sections.find(|(_, keys, _)| keys.contains(&key));
    section.map(|(section, ..)| *section)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Every key of every section.
    const ALL_KEYS: &str = "
[sensor]
laser_hz = 10_000_000
columns = 16
bins = 128
bin_width_ps = 92.1
offset_mm = -179.5
offsets_mm = [1.5, -78.0, 0.0]
gate = [12, 127]
masked = [3, 70]
sigma_bins = 0.8
dead_time = 128
dither_bins = 64
dither_seed = 9
background = 0.05
glass = 0.4
glass_bins = [0.0, 0.1, 0.3]
[detection]
rule = 'window'
window = 3
z = 4.45
estimator = 'window'
half_widths = [1.75, 4.0]
min_count = 5
l1 = 40
l2 = 2000
x = 4
binning = 2
patience = 64
tracking = true
echoes = 2
echo_wait = 4
once_per_bin = true
counter_bits = 8
[rays]
field_of_view_degrees = [60.0, 40.0]
[run]
cycles = 10_000
seed = 7
recorded_cycles = 20_000
frame = 500
axes = 'rows,columns,bins'
array = 'counts'
rebin = 2
";

    #[test]
    fn what_is_written_reads_as_what_it_was() {
        let file = SettingsFile::parse(ALL_KEYS).unwrap();
        let text = file.to_toml().unwrap();
        assert_eq!(SettingsFile::parse(&text).unwrap(), file, "{text}");
        assert!(text.contains("sigma_bins = 0.8 "), "{text}");
        // Each key is written with its comment, except those of other rules and choices.
        let others = [
            "alpha",
            "false_alarm",
            "neighbours",
            "calibration",
            "photons_per_cycle",
            "decide_once",
            "capture",
        ];
        for (_, keys, comments) in SECTIONS {
            for (key, comment) in keys.iter().zip(comments) {
                let line = text
                    .lines()
                    .find(|line| line.starts_with(&format!("{key} = ")));
                assert_eq!(line.is_none(), others.contains(key), "{key}");
                assert!(line.is_none_or(|line| line.ends_with(comment)), "{key}");
            }
        }
        let empty = SettingsFile::default().to_toml().unwrap();
        assert_eq!(
            SettingsFile::parse(&empty).unwrap(),
            SettingsFile::default()
        );
    }

    #[test]
    fn settings_become_the_same_file() {
        let file = SettingsFile::parse(ALL_KEYS).unwrap();
        let settings = file.settings(128).unwrap();
        assert_eq!(file.with_settings(&settings), file);
        let file = SettingsFile::parse("[detection]\nrule = 'average'\nalpha = 6.3").unwrap();
        let settings = file.settings(64).unwrap();
        let again = file.with_settings(&settings);
        assert_eq!(again.settings(64).unwrap(), settings);
        assert_eq!(again.detection.alpha, file.detection.alpha);
        assert_eq!((again.sensor.bins, again.run.seed), (Some(64), Some(1)));
    }

    #[test]
    fn a_single_decision_has_the_z_of_a_single_look() {
        let of = |text: &str| {
            SettingsFile::parse(&format!("{text}[detection]\nrule = 'window'\nwindow = 3"))
        };
        let file = of("[run]\ndecide_once = true\n").unwrap();
        let once = file.settings(128).unwrap();
        assert!(once.decide_once);
        assert_eq!(file.with_settings(&once).run.decide_once, Some(true));
        let z = |settings: &super::super::Settings| match settings.rule {
            dtof_core::AnyRule::Window(rule) => rule.z(),
            _ => panic!("another rule"),
        };
        let looks = of("").unwrap().settings(128).unwrap();
        assert!(z(&once) < z(&looks));
        // One in 100 of 128 bins: 12,800 trials.
        assert!(
            (z(&once).to_num::<f64>() - 3.78).abs() < 0.02,
            "{}",
            z(&once)
        );
        let refused = of("[run]\ndecide_once = true\nframe = 9\n")
            .unwrap()
            .settings(128);
        assert!(
            refused
                .unwrap_err()
                .to_string()
                .contains("cannot be used with")
        );
    }

    #[test]
    fn a_z_is_for_looks_or_for_a_single_decision() {
        let of = |once: &str, z: &str| {
            let text = format!("[run]\n{once}\n[detection]\nrule = 'window'\nwindow = 3\n{z}");
            SettingsFile::parse(&text).unwrap()
        };
        let [on, off, none] = ["decide_once = true", "decide_once = false", ""];
        for (options, file, z) in [
            (none, none, Some("4.5")),
            (off, none, Some("4.5")),
            (none, off, Some("4.5")),
            (none, on, Some("4.5")),
            (on, on, Some("4.5")),
            (on, none, None),
            (on, off, None),
            (off, on, None),
        ] {
            let z = z.map(|z| z.parse().unwrap());
            let over = |own: &str| of(options, own).or(of(file, "z = 4.5"));
            assert_eq!(over("").detection.z, z, "{options} over {file}");
            // One that is given comes with how it is used.
            let own = over("z = 5").detection.z;
            assert_eq!(own, Some("5".parse().unwrap()), "{options} over {file}");
        }
        let once = of(on, "z = 4.5").with_looks();
        assert_eq!((once.detection.z, once.run.decide_once), (None, None));
        let looks = of(none, "z = 4.5");
        assert_eq!(looks.clone().with_looks(), looks);
    }

    #[test]
    fn the_dither_of_a_laser_is_used_and_only_what_was_asked_for_is_written() {
        for (text, of_laser, used) in [
            ("", None, (0, 0)),
            ("", Some((128, 77)), (128, 77)),
            ("dither_bins = 64", None, (64, 0)),
            ("dither_bins = 64\ndither_seed = 9", None, (64, 9)),
            // Those of a scene are not the ones of the file.
            ("dither_bins = 64\ndither_seed = 9", Some((0, 1)), (0, 1)),
        ] {
            let mut file = SettingsFile::parse(&format!("[sensor]\n{text}")).unwrap();
            file.dither_of_laser = of_laser;
            let file = file.clone().or(SettingsFile {
                dither_of_laser: Some((2, 2)).filter(|_| of_laser.is_some()),
                ..SettingsFile::default()
            });
            let settings = file.settings(128).unwrap();
            assert_eq!((settings.dither_bins, settings.dither_seed), used, "{text}");
            let written = file.with_settings(&settings);
            assert_eq!(written.dither_of_laser, of_laser);
            assert_eq!(written.settings(128).unwrap(), settings);
            let written = written.to_toml().unwrap();
            for key in ["dither_bins", "dither_seed"] {
                assert_eq!(written.contains(key), text.contains(key), "{written}");
            }
        }
    }

    #[test]
    fn an_option_overrides_the_file() {
        let file = SettingsFile::parse(ALL_KEYS).unwrap();
        let over = |text: &str| {
            let options = SettingsFile::parse(text).unwrap();
            options.or(file.clone())
        };
        let of = |text: &str| over(&format!("[detection]\n{text}")).detection;
        assert_eq!(of("l1 = 8").l1, Some(8));
        assert_eq!(of("l1 = 8").z, file.detection.z);
        // z and false_alarm exclude each other.
        let share = of("false_alarm = 0.02");
        assert_eq!((share.z, share.false_alarm), (None, Some(0.02)));
        // Numbers of another rule are dropped, those of any rule are kept.
        let paper = of("rule = 'paper'");
        assert_eq!((paper.z, paper.window, paper.tracking), (None, None, None));
        assert_eq!((paper.l1, paper.binning), (Some(40), Some(2)));
        assert_eq!(of("rule = 'window'").z, file.detection.z);
        assert_eq!(of("tracking = false").tracking, Some(false));
        let run = over("[run]\nphotons_per_cycle = 0.5").run;
        assert_eq!(
            (run.photons_per_cycle, run.recorded_cycles),
            (Some(0.5), None)
        );
        let rays = over("[rays]\ncalibration = 'rays.toml'").rays;
        assert_eq!(rays.field_of_view_degrees, None);
    }

    #[test]
    fn a_dead_time_is_that_of_the_settings_or_of_the_sensor() {
        let settings = |text: &str, of_sensor| {
            let mut file = SettingsFile::parse(text).unwrap();
            file.dead_time_of_sensor = of_sensor;
            file.settings(128).map(|settings| {
                // What is written gives the same.
                let written = file.with_settings(&settings).to_toml().unwrap();
                let mut again = SettingsFile::parse(&written).unwrap();
                again.dead_time_of_sensor = of_sensor;
                assert!(!written.contains("one_hit_tdc"), "{written}");
                assert_eq!(again.settings(128).unwrap().dead_time, settings.dead_time);
                (settings.dead_time, settings.is_dead_time_of_sensor)
            })
        };
        let window = "[detection]\nrule = 'window'\nwindow = 3\n";
        for (text, of_sensor, dead_time) in [
            (window.to_owned(), None, (0, false)),
            (
                format!("{window}[sensor]\ndead_time = 20"),
                None,
                (20, false),
            ),
            (
                format!("{window}[sensor]\ndead_time = 20"),
                Some(7),
                (20, false),
            ),
            (
                format!("{window}[sensor]\ndead_time = 0"),
                Some(7),
                (0, false),
            ),
            (window.to_owned(), Some(7), (7, true)),
            // All bins, as many as there are.
            (window.to_owned(), Some(u16::MAX), (128, true)),
            ("[sensor]\ndead_time = 500".to_owned(), None, (128, false)),
            (
                "[sensor]\none_hit_tdc = true".to_owned(),
                None,
                (128, false),
            ),
            (
                "[sensor]\none_hit_tdc = false".to_owned(),
                Some(128),
                (128, true),
            ),
            (
                "[detection]\nbinning = 1".to_owned(),
                Some(128),
                (128, true),
            ),
            // One of the sensor that cannot be used is not.
            (String::new(), Some(127), (0, false)),
            (format!("{window}binning = 1"), Some(7), (0, false)),
            (format!("{window}[run]\nframe = 9"), Some(7), (0, false)),
        ] {
            assert_eq!(settings(&text, of_sensor).unwrap(), dead_time, "{text}");
        }
        for (text, reason) in [
            ("[sensor]\ndead_time = 127".to_owned(), "is for rule window"),
            (
                "[sensor]\ndead_time = 1\n[detection]\nrule = 'average'".to_owned(),
                "is for rule window",
            ),
            (
                format!("{window}binning = 1\n[sensor]\ndead_time = 20"),
                "cannot be used with binning",
            ),
            (
                format!("{window}[sensor]\ndead_time = 20\n[run]\nframe = 9"),
                "cannot be used with frame",
            ),
        ] {
            let error = settings(&text, None).unwrap_err().to_string();
            assert!(error.starts_with("dead_time "), "{error}");
            let expected = format!(": {reason}, unless it is 128 bins or more");
            assert!(error.ends_with(&expected), "{error}");
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, reason) in [
            ("l1 = 4", "l1 belongs in [detection]"),
            ("[detection]\nl1 = []", "l1 : must be one value"),
            ("[detection]\nhalf_widths = []", "half_widths : must be"),
            ("[sensor]\ngate = []", "gate : must be FIRST..LAST"),
            (
                "[detections]\nl1 = 4",
                "detections is unknown; is it detection?",
            ),
            ("sensor = 4", "sensor is a section: [sensor]"),
            ("[sensor", "line 1: "),
            ("[sensor]\nbins = 100", "bins 100: must be a power of two"),
            ("[sensor]\nbins = 'x'", "bins x: must be a power of two"),
            (
                "[sensor]\nsigma_bins = 0.001",
                "sigma_bins 0.001: is less than half",
            ),
            (
                "[sensor]\nsigma_bins = 2",
                "sigma_bins 2: must be a number above 0",
            ),
            (
                "[sensor]\nlaser_hz = 0",
                "laser_hz 0: must be a whole number from 1 to 1000000000000",
            ),
            (
                "[sensor]\nglass = -1.0",
                "glass -1: must be a number from 0 to 1000000",
            ),
            (
                "[sensor]\nmasked = [70000]",
                "masked 70000: must be a whole number from 0 to 65535",
            ),
            (
                "[detection]\nrule = 'best'",
                "rule best: must be paper, average or window",
            ),
            ("[detection]\nz = 99", "z 99: must be a number from 0"),
            (
                "[detection]\nz = 4\nfalse_alarm = 0.01",
                "z cannot be used with false_alarm",
            ),
            (
                "[detection]\nfalse_alarm = 0.5",
                "false_alarm 0.5: must be a number above 0, at most 0.1",
            ),
            (
                "[detection]\nwindow = 8",
                "window 8: must be a whole number from 1 to 7",
            ),
            (
                "[detection]\nechoes = 0",
                "echoes 0: must be a whole number from 1 to 4",
            ),
            ("[detection]\nalpha = nan", "alpha NaN: must be a number"),
            (
                "[rays]\nfield_of_view_degrees = [0, 40]",
                "field_of_view_degrees 0,40: must be HORIZONTALxVERTICAL",
            ),
            (
                "[rays]\nfield_of_view_degrees = [60]",
                "field_of_view_degrees 60: must be HORIZONTALxVERTICAL",
            ),
            (
                "[rays]\nfield_of_view_degrees = [60, 40]\ncalibration = 'rays.toml'",
                "field_of_view_degrees cannot be used with calibration",
            ),
            (
                "[run]\nrecorded_cycles = 9\nphotons_per_cycle = 1",
                "photons_per_cycle cannot be used with recorded_cycles",
            ),
            (
                "[sensor]\none_hit_tdc = 1",
                "one_hit_tdc 1: must be true or false",
            ),
            (
                "[sensor]\none_hit_tdc = true\ndead_time = 20",
                "one_hit_tdc cannot be used with dead_time",
            ),
            (
                "[detection]\none_hit_tdc = true",
                "one_hit_tdc belongs in [sensor]",
            ),
            (
                "[sensor]\ndead_time = -1",
                "dead_time -1: must be a whole number from 0 to 65535",
            ),
            (
                "[sensor]\ndead_time = 2.5",
                "dead_time 2.5: must be a whole number from 0 to 65535",
            ),
            ("[sensor]\ngate = 3", "gate 3: must be a list"),
            ("[sensor]\ngate = [3]", "gate 3: must be FIRST..LAST"),
            (
                "[sensor]\ngate = [[3], [9]]",
                "gate [3],[9]: must be FIRST..LAST",
            ),
            ("[sensor]\nmasked = 3", "masked 3: must be a list"),
            ("[sensor]\nmasked = ['']", "masked : must be a whole number"),
            (
                "[sensor]\nmasked = ['3']",
                "masked 3: must not be in quotes",
            ),
            (
                "[sensor]\nmasked = [1, 70000, 3]",
                "masked 1,70000,3: 70000 must be a whole number from 0 to 65535",
            ),
            ("[sensor]\nbins = [8]", "bins 8: must be one value"),
            ("[detection]\nl1 = '40'", "l1 40: must not be in quotes"),
            ("[detection]\nrule = true", "rule true: must be paper"),
            ("[run]\narray = 5", "array 5: must be in quotes"),
            ("[run]\narray = ''", "array needs a value"),
            ("[rays]\ncalibration = \"\"", "calibration needs a value"),
            (
                "[run]\naxes = 'rows'",
                "axes rows: one axis must be the bins",
            ),
            (
                "[run]\ncycles = 0",
                "cycles 0: must be a whole number from 1",
            ),
            ("[run]\nphotons_per_cycle = inf", "must be a number above 0"),
        ] {
            let error = format!("{:#}", SettingsFile::parse(text).unwrap_err());
            assert!(error.contains(reason), "{text}: {error}");
            assert!(!error.contains('\n'), "{error}");
        }
    }
}
