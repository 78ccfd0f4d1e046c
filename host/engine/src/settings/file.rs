//! Reading and writing the file.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use anyhow::{Context, Error, Result, anyhow};
use serde::Serialize;
use toml::{Table, Value};

use super::{Detection, Rays, Run, Sensor};
use dtof_options::{GivenByFile, NO_OPTION, Refused};

/// The first line of every file that this program writes.
pub const MARK: &str = "# dtof settings";

/// The keys of each section and what they are, in the order in which they are written.
const SECTIONS: [(&str, &[(&str, &str)]); 4] = [
    (
        "sensor",
        &[
            ("laser_hz", "laser cycles a second"),
            ("columns", "pixel = row * columns + column"),
            ("bins", "of a histogram"),
            ("bin_width_ps", "picoseconds a bin"),
            ("offset_mm", "added to every range"),
            ("gate", "first and last bin that may hold a peak"),
            ("masked", "addresses of pixels that are left out"),
            ("sigma_bins", "standard deviation of the pulse"),
            ("one_hit_tdc", "the TDC takes one photon a laser cycle"),
            (
                "background",
                "photons a bin and laser cycle of the median pixel",
            ),
            (
                "glass",
                "photons a laser cycle and pixel of the cover glass",
            ),
            ("glass_bins", "the same for each bin before the gate"),
        ],
    ),
    (
        "detection",
        &[
            ("rule", "paper, average or window"),
            ("alpha", "standard deviations, of rules paper and average"),
            ("window", "bins, of rule window"),
            ("z", "standard deviations, of rule window"),
            (
                "false_alarm",
                "share of exposures without a target, instead of z",
            ),
            ("estimator", "centroid or window"),
            (
                "half_widths",
                "bins before and after the place, of estimator window",
            ),
            ("min_count", "photons"),
            ("l1", "laser cycles that a decision must exceed"),
            ("l2", "laser cycles at which a pixel starts over"),
            ("x", "laser cycles between looks"),
            ("binning", "levels of blocks"),
            (
                "patience",
                "laser cycles until a silent pixel counts in its block",
            ),
            ("tracking", "expect the next event near the last"),
            ("echoes", "of an exposure"),
            ("echo_wait", "times the laser cycles of the last echo"),
        ],
    ),
    (
        "rays",
        &[
            ("field_of_view_degrees", "horizontal, vertical"),
            ("calibration", "file with a ray for each pixel"),
        ],
    ),
    (
        "run",
        &[
            ("cycles", "laser cycles"),
            ("seed", "of every random number"),
            ("photons_per_cycle", "in the brightest pixel of a recording"),
            ("recorded_cycles", "laser cycles of a recording"),
            ("frame", "laser cycles, of a frame-based sensor"),
            ("axes", "of a recorded array"),
            ("array", "of an archive"),
            ("rebin", "neighbouring bins that are added up"),
        ],
    ),
];

/// The keys whose values are lists.
const LISTS: [&str; 5] = [
    "gate",
    "masked",
    "glass_bins",
    "half_widths",
    "field_of_view_degrees",
];

/// The keys whose values are texts.
const TEXTS: [&str; 5] = ["rule", "estimator", "calibration", "axes", "array"];

/// A settings file, or what the command line says of the same. All of it may be missing.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SettingsFile {
    /// What is known of the sensor.
    pub sensor: Sensor,
    /// How pixels decide.
    pub detection: Detection,
    /// Where pixels look.
    pub rays: Rays,
    /// What is replayed or simulated.
    pub run: Run,
    /// The file that gave some of it.
    #[serde(skip)]
    pub file: Option<GivenByFile>,
}

impl SettingsFile {
    /// Reads a file.
    ///
    /// # Errors
    /// One line with the name of the file, and the line or the key that is wrong.
    pub fn read(path: &Path) -> Result<Self> {
        let name = || path.display().to_string();
        let text = fs::read_to_string(path).with_context(name)?;
        let mut file = Self::parse(&text).map_err(|error| match error.downcast_ref() {
            Some(Refused { key: Some(key), .. }) => {
                let sections = SECTIONS.iter().map(|(section, _)| *section);
                let keys = SECTIONS.iter().flat_map(|(_, keys)| *keys);
                let keys = sections.chain(keys.map(|(key, _)| *key)).chain([&**key]);
                let keys = keys.map(str::to_owned).collect();
                let path = path.to_owned();
                dtof_options::blamed(error, Some(&GivenByFile { path, keys }))
            }
            _ => error.context(name()),
        })?;
        // A path of the file is meant from where the file is.
        if let (Some(rays), Some(folder)) = (&mut file.rays.calibration, path.parent()) {
            let whole = std::path::absolute(folder.join(&rays)).with_context(name)?;
            *rays = whole.display().to_string();
        }
        let (path, keys) = (path.to_owned(), file.keys()?);
        file.file = Some(GivenByFile { path, keys });
        Ok(file)
    }

    /// The text of a file.
    ///
    /// # Errors
    /// The line that is no TOML, or the key that is wrong.
    pub fn parse(text: &str) -> Result<Self> {
        let sections: Table = toml::from_str(text).map_err(|error| {
            let before = error.span().and_then(|span| text.get(..span.start));
            let line = before.map_or(1, |text| text.matches('\n').count() + 1);
            anyhow!("line {line}: {}", error.message())
        })?;
        let mut file = Self::default();
        for (section, values) in &sections {
            let Some((_, keys)) = SECTIONS.iter().find(|(known, _)| known == section) else {
                return Err(match section_of(section) {
                    Some(known) => Refused::new(section, format!("stands in [{known}]")),
                    None => Refused::unknown(section, SECTIONS.map(|(section, _)| section)),
                }
                .into());
            };
            let Value::Table(values) = values else {
                let reason = format!("is a section: [{section}]");
                return Err(Refused::new(section, reason).into());
            };
            for (key, value) in values {
                if !keys.iter().any(|(known, _)| known == key) {
                    return Err(match section_of(key) {
                        Some(known) => Refused::new(key, format!("stands in [{known}]")),
                        None => Refused::unknown(key, keys.iter().map(|(key, _)| *key)),
                    }
                    .into());
                }
                let is_empty = value.as_array().is_some_and(Vec::is_empty);
                // No pixels and no photons: nothing is given.
                if !(is_empty && matches!(&**key, "masked" | "glass_bins")) {
                    file.set_value(key, value)?;
                }
            }
        }
        file.check()?;
        Ok(file)
    }

    /// Sets a key to a value of a file.
    fn set_value(&mut self, key: &str, value: &Value) -> Result<(), Refused> {
        let text = text_of(value);
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
            (true, false) => Err(refused("must stand in quotes".to_owned())),
            (false, true) => Err(refused("must not stand in quotes".to_owned())),
            _ => Ok(()),
        }
    }

    /// Sets a key of any section.
    ///
    /// # Errors
    /// Why it cannot be so.
    pub fn set(&mut self, key: &str, text: &str) -> Result<(), String> {
        match section_of(key) {
            Some("sensor") => self.sensor.set(key, text),
            Some("detection") => self.detection.set(key, text),
            Some("rays") => self.rays.set(key, text),
            Some(_) => self.run.set(key, text),
            None => Err(NO_OPTION.to_owned()),
        }
    }

    /// Are there two options of which only one can be given?
    ///
    /// # Errors
    /// Which.
    pub fn check(&self) -> Result<(), Refused> {
        self.detection.check()?;
        self.rays.check()?;
        self.run.check()
    }

    /// The keys that are given.
    ///
    /// # Errors
    /// If a number is none.
    pub fn keys(&self) -> Result<BTreeSet<String>> {
        let sections = Table::try_from(self)?;
        let tables = sections.values().filter_map(Value::as_table);
        Ok(tables.flat_map(Table::keys).cloned().collect())
    }

    /// The option `key` is given by itself: the file has no part in it.
    pub fn override_key(&mut self, key: &str) {
        if let Some(file) = &mut self.file {
            file.keys.remove(key);
        }
    }

    /// `error`, which names the file where it is about a key that the file gave.
    #[must_use]
    pub fn blame(&self, error: Error) -> Error {
        dtof_options::blamed(error, self.file.as_ref())
    }

    /// These, and of `other` what these do not say.
    #[must_use]
    pub fn or(self, mut other: Self) -> Self {
        // Half widths are those of a pulse.
        let sigma = self.sensor.sigma_bins;
        if sigma.is_some() && sigma != other.sensor.sigma_bins {
            other.detection.half_widths = None;
        }
        let (file, own) = (other.file.take(), self.keys());
        // A field of view replaces a calibration, and the other way round.
        let rays = if self.rays == Rays::default() {
            other.rays
        } else {
            self.rays
        };
        let mut merged = Self {
            sensor: self.sensor.or(other.sensor),
            detection: self.detection.or(other.detection),
            rays,
            run: self.run.or(other.run),
            file: self.file,
        };
        // Of the file are keys that no option has set, nor dropped.
        if let (None, Some(mut file), Ok(own), Ok(all)) = (&merged.file, file, own, merged.keys()) {
            file.keys
                .retain(|key| all.contains(key) && !own.contains(key));
            merged.file = Some(file);
        }
        merged
    }

    /// Without what holds for one recording alone.
    #[must_use]
    pub fn of_any_file(mut self) -> Self {
        (self.run.axes, self.run.array, self.run.cycles) = (None, None, None);
        self
    }

    /// The text of the file: what is said, a line a key, with what it is.
    ///
    /// # Errors
    /// If a number is none.
    pub fn to_toml(&self) -> Result<String> {
        let all = Table::try_from(self)?;
        let mut text = format!("{MARK}: `--settings FILE` takes them, options override them.\n");
        for (section, keys) in SECTIONS {
            let said = all.get(section).and_then(Value::as_table);
            let lines = keys.iter().filter_map(|(key, comment)| {
                let value = said?.get(*key)?;
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

impl From<Run> for SettingsFile {
    fn from(run: Run) -> Self {
        Self {
            run,
            ..Self::default()
        }
    }
}

/// The section in which a key stands.
fn section_of(key: &str) -> Option<&'static str> {
    let has_key = |(_, keys): &&(_, &[(&str, _)])| keys.iter().any(|(known, _)| *known == key);
    SECTIONS.iter().find(has_key).map(|(section, _)| *section)
}

/// A value of a file as an option has it: the elements of a list after each other.
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
    const WHOLE: &str = "
[sensor]
laser_hz = 10_000_000
columns = 16
bins = 128
bin_width_ps = 92.1
offset_mm = -179.5
gate = [12, 127]
masked = [3, 70]
sigma_bins = 0.8
one_hit_tdc = true
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
        let file = SettingsFile::parse(WHOLE).unwrap();
        let text = file.to_toml().unwrap();
        assert_eq!(SettingsFile::parse(&text).unwrap(), file, "{text}");
        assert!(text.contains("sigma_bins = 0.8 "), "{text}");
        // Each key is there, with its comment; those of other rules and choices are not.
        let others = ["alpha", "false_alarm", "calibration", "photons_per_cycle"];
        for (_, keys) in SECTIONS {
            for (key, comment) in keys {
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
    fn what_holds_can_be_said_again() {
        let file = SettingsFile::parse(WHOLE).unwrap();
        let settings = file.settings(128).unwrap();
        assert_eq!(file.with(&settings), file);
        let file = SettingsFile::parse("[detection]\nrule = 'average'\nalpha = 6.3").unwrap();
        let settings = file.settings(64).unwrap();
        let said = file.with(&settings);
        assert_eq!(said.settings(64).unwrap(), settings);
        assert_eq!(said.detection.alpha, file.detection.alpha);
        assert_eq!((said.sensor.bins, said.run.seed), (Some(64), Some(1)));
    }

    #[test]
    fn an_option_overrides_the_file() {
        let file = SettingsFile::parse(WHOLE).unwrap();
        let over = |text: &str| {
            let options = SettingsFile::parse(text).unwrap();
            options.or(file.clone())
        };
        let of = |text: &str| over(&format!("[detection]\n{text}")).detection;
        assert_eq!(of("l1 = 8").l1, Some(8));
        assert_eq!(of("l1 = 8").z, file.detection.z);
        // z and false_alarm say the same.
        let share = of("false_alarm = 0.02");
        assert_eq!((share.z, share.false_alarm), (None, Some(0.02)));
        // The numbers of another rule are not taken, those of any rule are.
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
    fn what_is_wrong_is_named() {
        for (text, reason) in [
            ("l1 = 4", "l1 stands in [detection]"),
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
            ("[sensor]\nsigma_bins = 2", "sigma_bins 2: must be above 0"),
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
                "masked 3: must not stand in quotes",
            ),
            (
                "[sensor]\nmasked = [1, 70000, 3]",
                "masked 1,70000,3: 70000 must be a whole number from 0 to 65535",
            ),
            ("[sensor]\nbins = [8]", "bins 8: must be one value"),
            ("[detection]\nl1 = '40'", "l1 40: must not stand in quotes"),
            ("[detection]\nrule = true", "rule true: must be paper"),
            ("[run]\narray = 5", "array 5: must stand in quotes"),
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
