//! `replay`: recorded photons or histograms through the engine.
//!
//! Without a settings file it finds the settings in the recording first, as `calibrate` does. Options override them.

use anyhow::{Result, ensure};

use super::calibrate::{GLASS, IS_GLASS, calibrate_counts, has_photons, with_mask};
use super::depth_map::MapInput;
use super::given::{FRAME, Given, ONCE, SENSOR, TDC, of_given};
use super::recording::{
    RECORDING, bin_width_warning, check_once_per_bin, mask_capture, read_options, settings_of_file,
};
use super::run::{RunResult, Sink, run};
use super::summary::Summary;
use crate::calibrate::report::rows;
use dtof_calibrate::{Calibration, CalibrationOptions};
use dtof_core::Neighbours;
use dtof_data::events::clock::LaserClock;
use dtof_data::options::keys::Key;
use dtof_data::options::progress::Progress;
use dtof_data::options::rows::Row;
use dtof_data::options::{KeysOfFile, Refused, flag};
use dtof_data::photons::geometry::FieldOfView;
use dtof_data::photons::input::Input;
use dtof_data::photons::masked::Masked;
use dtof_data::photons::open::{CheckedRecording, Metadata, Recording, check};
use dtof_data::photons::source::{PhotonSource, has_only_neighbours, is_one_capture};
use dtof_engine::Engine;
use dtof_engine::host::host_engine;
use dtof_engine::settings::{
    AdaptiveBinning, DEFAULT_L2, DetectionSettings, EstimatorName, RunSettings, Settings,
    SettingsFile,
};

/// What the user knows of the scene: an option of the search.
const SEARCH: &[Key] = &[GLASS];
/// The options that choose which photons are replayed.
const RUN: &[Key] = &[
    Key::of(RunSettings::KEYS, "cycles"),
    Key::of(RunSettings::KEYS, "seed")
        .with_help("Seed of the laser cycles that recorded photons get [default: 1]"),
];

/// The options that were part of the search, so that what is found is for them.
const SEARCHED_WITH: &[&str] = &["bins", "bin_width_ps", "gate", "masked", "sigma_bins"];
/// What takes the place of a rule or an estimator that is found, under another key.
const IN_PLACE: &[&str] = &["alpha", "estimator", "half_widths"];
/// What a z that is found depends on.
const OF_Z: &[&str] = &["window", "min_count", "l1", "l2", "x", "binning"];

/// The options of a replay.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The settings.
    pub given: Given,
    /// Whether the nearest surface is a cover glass, if the user knows.
    pub glass: Option<bool>,
}

impl dtof_data::options::Options for Options {
    const KEYS: &'static [&'static [Key]] = &[
        RECORDING,
        SENSOR,
        TDC,
        DetectionSettings::KEYS,
        FRAME,
        ONCE,
        SEARCH,
        RUN,
    ];

    fn set(&mut self, key: &'static str, text: &str) -> Result<(), String> {
        match key {
            "glass" => self.glass = Some(IS_GLASS.read(text)?),
            key => self.given.set(key, text)?,
        }
        Ok(())
    }

    of_given!();
}

/// A replay that can begin.
pub struct Replay {
    /// The photons.
    pub photons: Masked,
    /// The pixels.
    pub engine: Box<dyn Engine>,
    /// The settings of the pixels.
    pub settings: Settings,
    /// The requested settings, over those of the recording.
    pub requested: SettingsFile,
    /// Metadata of the recording.
    pub metadata: Metadata,
    /// How its depth map is decided; `None` if it is that of the frames.
    pub map: Option<MapInput>,
    /// What was found in the recording, one a row, if its settings come from there.
    pub found: Vec<Row>,
}

impl Replay {
    /// Replays all of `input`, from which it was opened, into `sink`.
    ///
    /// # Errors
    /// Those of [`run`].
    pub fn run(
        &mut self,
        input: &Input,
        sink: &mut dyn Sink,
        progress: &mut dyn Progress,
    ) -> Result<RunResult> {
        let settings = (&self.settings, &self.requested);
        let engine = self.engine.as_mut();
        let (photons, map) = (&mut self.photons, self.map.as_ref());
        let mut result = run(photons, engine, settings, map, &mut [sink], progress)?;
        result.summary.input = Some(input.to_string());
        result.summary.cut_off = self.metadata.cut_off;
        result.summary.recording.clone_from(&self.metadata.rows);
        result.summary.found.clone_from(&self.found);
        result.summary.assumed = self.assumed();
        let warnings = self.metadata.warnings.iter().cloned();
        result.summary.warnings.extend(warnings);
        result.summary.dim_targets = self.dim_targets(&result.summary);
        Ok(result)
    }
}

impl Replay {
    /// Names the option that finds more dim targets, if most pixels have no depth and settings were found that allow it.
    fn dim_targets(&self, summary: &Summary) -> Option<String> {
        let has_little = 2 * summary.pixels_with_depth
            < summary.pixels.saturating_sub(self.settings.masked.len());
        let may_have =
            self.settings.configuration.neighbours.is_none() && self.settings.frame.is_none();
        if !has_little || !may_have || self.found.is_empty() {
            return None;
        }
        let with_neighbours = self.settings.clone();
        let with_neighbours =
            with_neighbours.configured(|array| array.neighbours = Some(Neighbours::Eight));
        let (array, addresses) = (self.photons.array(), self.photons.addresses());
        let may_help = self.metadata.has_shape
            && array.columns().min(array.rows()) > 1
            && is_one_capture(&self.photons)
            && host_engine(&with_neighbours, array, &addresses).is_ok();
        may_help.then(|| {
            "--neighbours 8 finds more of them, if pixels without a depth see any".to_owned()
        })
    }

    /// What neither options nor settings nor the recording give.
    fn assumed(&self) -> Vec<Row> {
        let array = self.photons.array();
        let width = self.metadata.bin_width_ps;
        let is_of_found = self.found.iter().any(|(name, _)| name == "bin width");
        let view = FieldOfView::default_for([array.columns(), array.rows()]);
        let rays = &self.requested.rays;
        let rows = [
            (
                self.metadata.is_width_assumed && !is_of_found,
                "bin width",
                format!("assumed: {width} ps; --bin-width-ps gives another"),
            ),
            (
                self.photons.laser_hz().is_none(),
                "laser rate",
                format!(
                    "assumed for times: {}; --laser-hz gives another",
                    LaserClock::default()
                ),
            ),
            (
                array.pixels() > 1
                    && rays.field_of_view_degrees.is_none()
                    && rays.calibration.is_none(),
                "field of view",
                format!("assumed for points: {view} degrees; export --fov gives another"),
            ),
        ];
        let assumed = rows.into_iter().filter(|(is_assumed, ..)| *is_assumed);
        assumed
            .map(|(_, name, text)| (name.to_owned(), text))
            .collect()
    }
}

impl Options {
    /// These options over the settings file.
    ///
    /// # Errors
    /// Fails if the file cannot be read, or if `rebin` and `bin_width_ps` do not fit.
    pub fn requested(&self) -> Result<SettingsFile> {
        self.given.merged_for_recording()
    }

    /// Opens `input`, with the settings from [`Self::requested`].
    ///
    /// # Errors
    /// Fails if the recording cannot be read or a setting does not suit it; the error begins with the name
    /// of the recording. If no settings can be found in it, the defaults hold, and the metadata has a warning.
    pub fn open(&self, input: &Input, requested: &SettingsFile) -> Result<Replay> {
        let mut recording = check(input, &read_options(requested))?;
        self.given.suits(input, recording.metadata())?;
        let mut given = requested.clone();
        let captures = recording.metadata().captures;
        let (capture, pixels) = (given.run.capture, recording.array().pixels());
        mask_capture(&mut given.sensor.masked, capture, pixels, captures)?;
        let mut requested = given.clone();
        let (found, warnings) = self.search(&mut requested, &mut recording)?;
        let options = read_options(&requested);
        let (recording, counts) = recording.photons_and_counts(&options)?;
        let Recording {
            photons,
            mut metadata,
        } = recording;
        metadata.warnings.extend(warnings);
        let requested = requested.or(settings_of_file(&metadata, photons.array()));
        // The search may have found another width in true distances.
        if requested.sensor.bin_width_ps == Some(metadata.bin_width_ps) {
            metadata.warnings.extend(bin_width_warning(&metadata));
        }
        if !self.has_file() {
            check_rule(&given, &requested)?;
        }
        let settings = requested.settings(metadata.bins);
        let settings = settings.and_then(|settings| settings.for_source(photons.as_ref()));
        let settings = settings.map_err(|error| requested.add_file_name(error))?;
        check_array(&settings, &metadata, photons.as_ref())
            .map_err(|refused| anyhow::Error::from(refused).context(input.to_string()))?;
        ensure!(
            metadata.is_list || options.length.is_some() || !settings.weighs_dead_time(),
            Refused::value(
                "dead_time",
                settings.dead_time(),
                "needs `recorded_cycles`: histograms are weighed by them"
            )
        );
        check_once_per_bin(settings.counts_once_per_bin(), metadata.is_list)?;
        let photons = Masked::new(photons, &settings.masked)?;
        let photons = photons.with_laser_hz(requested.sensor.laser_hz);
        let engine = host_engine(&settings, photons.array(), &photons.addresses());
        let engine = engine.map_err(|error| requested.add_file_name(error))?;
        Ok(Replay {
            map: MapInput::new(&requested, &settings, counts, &given)?,
            photons,
            engine,
            settings,
            requested,
            metadata,
            found,
        })
    }

    fn has_file(&self) -> bool {
        self.given.file.is_some() || self.given.text.is_some()
    }

    /// Finds settings in the recording and puts them under `requested`, unless there is a settings file. Gives what was
    /// found, one a row, and warnings.
    ///
    /// # Errors
    /// Fails if an option is for the search and there is none.
    fn search(
        &self,
        requested: &mut SettingsFile,
        recording: &mut CheckedRecording,
    ) -> Result<(Vec<Row>, Vec<String>)> {
        if self.has_file() {
            let reason = "is for the search, which a settings file replaces: give `gate`";
            ensure!(self.glass.is_none(), Refused::new("glass", reason));
            return Ok((Vec::new(), Vec::new()));
        }
        let found = find(requested, recording, self.glass);
        Ok(found.unwrap_or_else(|reason| {
            let warning = format!("no settings were found: {reason:#}; the defaults are used");
            (Vec::new(), vec![warning])
        }))
    }
}

/// Checks that the options that were given are for the rule of a search.
fn check_rule(given: &SettingsFile, requested: &SettingsFile) -> Result<(), Refused> {
    let detection = &requested.detection;
    if detection.rule.is_none() {
        let reason = "needs the window rule, but no settings were found in the recording: give `rule` window and `sigma_bins`";
        return match detection.of_window_rule() {
            Some(key) => Err(Refused::new(key, reason)),
            None => Ok(()),
        };
    }
    match detection.alpha.is_some() && given.detection.rule.is_none() {
        true => Err(Refused::new(
            "alpha",
            "is for `rule` paper or average: say which",
        )),
        false => Ok(()),
    }
}

/// Checks that blocks and neighbours are pixels side by side.
fn check_array(
    settings: &Settings,
    metadata: &Metadata,
    photons: &dyn PhotonSource,
) -> Result<(), Refused> {
    let binning = settings.configuration.binning;
    let asks_neighbours = settings.configuration.neighbours.is_some() && settings.frame.is_none();
    for (key, is_used) in [
        ("binning", binning.is_some()),
        ("neighbours", asks_neighbours),
    ] {
        if is_used && !metadata.has_shape {
            let reason = match metadata.is_list {
                true => "needs the array: give `columns`",
                false => {
                    "needs the array: say with `axes` which axes are captures, rows and columns"
                }
            };
            return Err(Refused::new(key, reason));
        }
    }
    if asks_neighbours && !is_one_capture(photons) {
        let reason = "needs one capture of columns and rows: pixels of different captures are not neighbours";
        return Err(Refused::new("neighbours", reason));
    }
    if let Some(AdaptiveBinning { levels, .. }) = binning
        && !has_only_neighbours(photons, levels)
    {
        let ([column, row], side) = (photons.axis_names(), 1 << levels.raw());
        let reason = format!(
            "blocks of {side}x{side} pixels would reach across captures; a {column} and a {row} are not neighbours there"
        );
        return Err(Refused::value("binning", levels.raw(), reason));
    }
    Ok(())
}

/// Finds the settings of the sensor in a recording, and puts them under those that were requested. Of a
/// photon list it reads the laser cycles that are replayed. Gives what was found, one a row, and warnings
/// about options that do not suit it.
fn find(
    requested: &mut SettingsFile,
    recording: &mut CheckedRecording,
    glass: Option<bool>,
) -> Result<(Vec<Row>, Vec<String>)> {
    let counts = recording.counts()?;
    if !has_photons(&counts) {
        return Ok((Vec::new(), Vec::new())); // A warning says so already.
    }
    let metadata = &counts.metadata;
    let source = match requested.sensor.bin_width_ps {
        Some(_) => "as given",
        None if metadata.is_width_assumed => "assumed: --bin-width-ps gives another",
        None => "that of the sensor",
    };
    let width = format!("{} ps, {source}", metadata.bin_width_ps);
    // Without a settings file the pulse and the share of false alarms are options.
    let mut options = CalibrationOptions::default().with_pulse_of(requested, true);
    let share = requested.detection.false_alarm;
    options.false_alarm = share.unwrap_or(options.false_alarm);
    options.glass = glass;
    options.dead_time = requested.sensor.dead_time;
    options.gate = requested.sensor.gate;
    let masked = requested.sensor.masked.as_deref();
    let mut found = calibrate_counts(requested, &counts, masked, &options, &mut ())?;
    if requested.sensor.offsets_mm.is_some() {
        found.pixel_offsets = None;
    }
    let mut settings = found.settings(
        requested
            .clone()
            .or(settings_of_file(metadata, counts.array)),
    )?;
    let mut given = requested.clone();
    given.detection.false_alarm = None;
    let given_keys = given.keys()?;
    let warnings = [
        glass_in_gate(&given, &found),
        unsuited_offset(&given, &found),
    ];
    let warnings = warnings.into_iter().flatten().chain(found.warnings());
    let warnings: Vec<String> = warnings.collect();
    // A z is for the exposures that were simulated.
    if settings.detection.z.is_some() && OF_Z.iter().any(|key| given_keys.contains(*key)) {
        settings.detection.z = None;
        settings.detection.false_alarm = Some(options.false_alarm);
    }
    // Pixels to leave out come on top of those that are found.
    settings = with_mask(settings, given.sensor.masked.take().as_deref());
    let together = given.clone().or(settings.clone());
    if together.dead_time_obstacle().is_some() {
        settings.dead_time_of_sensor = settings.sensor.dead_time.take();
    }
    // An error about a key that was found says so.
    let found_keys = found.settings(SettingsFile::default())?.keys()?;
    let mut keys = found_keys.clone();
    // The default is nothing found.
    if found.detection.l2 == DEFAULT_L2 {
        keys.remove("l2");
    }
    settings.file = Some(KeysOfFile {
        path: "found in the recording".into(),
        keys,
    });
    *requested = given.or(settings);
    let mut rows = rows(&found);
    if requested.run.decide_once == Some(true) {
        // Its z, L1 and L2 are for looks. The settings have the rule.
        rows.retain(|(name, _)| name != "rule");
    }
    // A width that fits true distances better comes with the offset.
    if !rows.iter().any(|(name, _)| name == "bin width") {
        rows.insert(1, ("bin width".to_owned(), width));
    }
    for (name, undone_by) in [
        ("hot pixels", "; --mask none keeps them"),
        ("dead pixels", "; --mask none keeps them"),
        ("gate", "; --glass no keeps all bins"),
    ] {
        let is_left_out = |row: &&mut Row| row.0 == name && !row.1.starts_with("none");
        let is_undone = match name {
            "gate" => found.glass().is_some() && requested.sensor.gate == found.written_gate(),
            _ => !found.keeps_hot,
        };
        let rows = rows.iter_mut().filter(is_left_out);
        rows.filter(|_| is_undone)
            .for_each(|row| row.1 += undone_by);
    }
    let replaces = |key: &&String| found_keys.contains(*key) || IN_PLACE.contains(&key.as_str());
    let overridden = given_keys.iter().filter(replaces);
    let flags = overridden
        .filter(|key| !SEARCHED_WITH.contains(&key.as_str()))
        .map(|key| flag(key));
    let flags: Vec<String> = flags.collect();
    if !flags.is_empty() {
        rows.push(("overridden".to_owned(), format!("by {}", flags.join(", "))));
    }
    Ok((rows, warnings))
}

/// Warns if the gate that is given surely takes in what seems to be crosstalk of a cover glass.
fn glass_in_gate(given: &SettingsFile, found: &Calibration) -> Option<String> {
    let (first, last) = given.sensor.gate?;
    let glass = found.glass()?;
    let surely = glass.end.min(glass.end_between.0);
    (usize::from(first) < surely && usize::from(last) >= glass.top).then(|| {
        format!(
            "--gate begins at bin {first}, but what seems to be a cover glass matters up to bin {}: events may show it",
            glass.end.saturating_sub(1)
        )
    })
}

/// Warns if the offset that is found is for another estimator than the one that is given.
fn unsuited_offset(given: &SettingsFile, found: &Calibration) -> Option<String> {
    let detection = &given.detection;
    let is_other =
        detection.half_widths.is_some() || detection.estimator == Some(EstimatorName::Centroid);
    let is_used = found.offset.is_some() && given.sensor.offset_mm.is_none();
    (is_other && is_used).then(|| {
        "the offset was found with another estimator, so all ranges may be off: --offset-mm sets it"
            .to_owned()
    })
}
