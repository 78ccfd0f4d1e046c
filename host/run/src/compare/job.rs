//! `compare`: all methods on the photons of a recording or a scene.

use anyhow::{Context, Result, ensure};
use dtof_core::CentredWindow;
use dtof_core::fixed::types::U8F8;

use crate::calibrate::{GLASS, IS_GLASS, calibrate_counts, with_mask};
use crate::compare::truth::Truth;
use crate::compare::{Comparison, Task, compare};
use crate::given::{Given, SENSOR, TDC_OF_ANY_RULE, of_given};
use crate::recording::{
    RECORDING, bin_width_warning, check_once_per_bin, mask_capture, read_options, settings_of_file,
    warnings,
};
use crate::simulate::settings_of_scene;
use dtof_calibrate::CalibrationOptions;
use dtof_data::options::keys::{Key, POSITIVE, Reader, integer};
use dtof_data::options::numbers::MAX_INTEGER;
use dtof_data::options::{Refused, plain};
use dtof_data::photons::input::Input;
use dtof_data::photons::masked::Masked;
use dtof_data::photons::open::{Counts, HISTOGRAM_CYCLES, ReadOptions, counts, open};
use dtof_data::photons::source::PhotonSource;
use dtof_engine::settings::{
    DetectionSettings, FALSE_ALARM, RuleName, RunSettings, Settings, SettingsFile,
};
use dtof_light::scene::Scene;

/// How exact, and how sure.
const ACCURACY: &[Key] = &[
    Key::new(
        "within",
        WITHIN.kind,
        "MM",
        "Largest error of 68 % of the reports in millimetres [default: that of the longest frames]",
    ),
    Key::of(DetectionSettings::KEYS, "false_alarm").with_help(
        "Share of exposures without a target that end with an event, at most 0.1 [default: 0.01]",
    ),
];
const WITHIN: Reader<f64> = POSITIVE;
/// What is compared.
const RUN: &[Key] = &[
    Key::of(DetectionSettings::KEYS, "once_per_bin").with_help(
        "Also try photons of one laser cycle in one bin that count once. For photons, not for \
         histograms",
    ),
    Key::of(RunSettings::KEYS, "cycles")
        .with_help("Laser cycles to use at most [default: 10000 of a recording; the scene's]"),
    Key::new(
        "seed",
        SEED.kind,
        "N",
        "Seed of every random number [default: 1]",
    ),
];

/// One more is the seed of a second run.
const SEED: Reader<u64> = integer(0, MAX_INTEGER - 1);

/// The options of a comparison.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The highest error of 68 % of the reports, in millimetres; by default that of the longest frames.
    pub within: Option<f64>,
    /// The share of exposures without a target that may end with an event; by default 0.01.
    pub false_alarm: Option<f64>,
    /// Whether the nearest surface is a cover glass, if the user knows.
    pub glass: Option<bool>,
    /// Settings of recording and sensor.
    pub given: Given,
}

impl dtof_data::options::Options for Options {
    const KEYS: &'static [&'static [Key]] =
        &[ACCURACY, RECORDING, SENSOR, TDC_OF_ANY_RULE, &[GLASS], RUN];

    fn set(&mut self, key: &'static str, text: &str) -> Result<(), String> {
        match key {
            "within" => self.within = Some(WITHIN.read(text)?),
            "false_alarm" => self.false_alarm = Some(FALSE_ALARM.read(text)?),
            "glass" => self.glass = Some(IS_GLASS.read(text)?),
            "seed" => self.given.options.run.seed = Some(SEED.read(text)?),
            key => self.given.set(key, text)?,
        }
        Ok(())
    }

    of_given!();
}

/// Where photons come from.
pub enum CompareInput {
    /// A recording, and an array with the true range of each pixel if there is one.
    Recording(Input, Option<Input>),
    /// A scene, and its name for errors.
    Scene(Box<Scene>, String),
}

/// Callbacks of a comparison.
pub struct Callbacks<'a> {
    /// Takes a warning about the recording.
    pub warning: &'a dyn Fn(String),
    /// Takes the name of the current step, and the share of the work that is done, 0 to 1. An error from it ends
    /// the comparison.
    pub step: &'a dyn Fn(&str, f64) -> Result<()>,
}

/// The result of a comparison.
pub struct CompareResult {
    /// All methods.
    pub comparison: Comparison,
    /// The settings of the method to take at full resolution, if there is one.
    pub settings: Option<SettingsFile>,
    /// The settings of the fastest method, if that is another.
    pub fastest: Option<SettingsFile>,
}

/// A recording or a scene that can be compared.
struct Subject {
    requested: SettingsFile,
    truth: Option<Truth>,
    photons: Photons,
    /// Why L1 is what it is.
    why_l1: &'static str,
}

/// Where photons come from, for each seed.
enum Photons {
    Scene(Box<Scene>),
    /// Histograms, in memory.
    Histograms(Box<Counts>),
    /// A photon list, which is read each time.
    List(Input),
}

impl CompareInput {
    /// Its name for errors.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Recording(input, _) => input.to_string(),
            Self::Scene(_, name) => name.clone(),
        }
    }
}

impl Options {
    /// These options over the settings file, for a recording or a scene.
    ///
    /// # Errors
    /// Fails if the file cannot be read, if an option that describes a recording is given for a scene,
    /// or if `rebin` and `bin_width_ps` do not fit.
    pub fn requested(&self, is_scene: bool) -> Result<SettingsFile> {
        let mut requested = if is_scene {
            let reason = "is for recordings, not for a scene";
            let names: Vec<_> = RECORDING.iter().map(|key| key.name).collect();
            self.given.refuse(&names, reason)?;
            self.given.merged_with_looks()?
        } else {
            let file = self.given.read()?.with_looks();
            self.given.for_recording_over(file)?
        };
        if self.false_alarm.is_some() {
            requested.override_key("false_alarm");
        }
        Ok(requested)
    }

    /// Compares all methods on `input`, with the settings from [`Self::requested`].
    ///
    /// # Errors
    /// Fails if the input cannot be read or has no targets, if a setting is invalid, or if the width of
    /// the pulse is neither given nor found.
    pub fn compare(
        &self,
        input: CompareInput,
        requested: &SettingsFile,
        callbacks: &Callbacks,
    ) -> Result<CompareResult> {
        let result = self.compare_requested(input, requested.clone(), callbacks);
        result.map_err(|error| requested.add_file_name(error))
    }

    fn compare_requested(
        &self,
        input: CompareInput,
        requested: SettingsFile,
        callbacks: &Callbacks,
    ) -> Result<CompareResult> {
        let name = input.name();
        let subject = match input {
            CompareInput::Scene(..) if self.glass.is_some() => {
                let reason = "is for recordings, not for a scene";
                return Err(Refused::new("glass", reason).into());
            }
            CompareInput::Scene(scene, name) => subject_of_scene(*scene, &name, requested)?,
            CompareInput::Recording(input, truth) => {
                self.subject_of_recording(input, truth.as_ref(), requested, callbacks)?
            }
        };
        let Subject {
            requested,
            truth,
            photons,
            why_l1,
        } = subject;
        let false_alarm = self.false_alarm_share(&requested);
        let sigma = requested.sensor.sigma_bins;
        let sigma = sigma.ok_or_else(|| unknown_pulse(&name))?;
        let mut settings = requested.settings(requested.sensor.bins.unwrap_or(128).into())?;
        let masked = settings.masked.clone();
        let photons = |seed: u64| -> Result<Box<dyn PhotonSource>> {
            let options = ReadOptions {
                seed,
                ..first_cycles(&requested)
            };
            let photons: Box<dyn PhotonSource> = match &photons {
                Photons::Scene(scene) => {
                    Box::new(scene.photons(seed, requested.run.cycles.unwrap_or(scene.cycles))?)
                }
                Photons::Histograms(counts) => Box::new(counts.photons(&options)?),
                Photons::List(input) => open(input, &options)?.photons,
            };
            let photons = Masked::new(photons, &masked)?;
            Ok(Box::new(photons.with_laser_hz(requested.sensor.laser_hz)))
        };
        if !settings.offsets_mm.is_empty() {
            settings = settings.for_source(photons(1)?.as_ref())?;
        }
        let comparison = compare(&Task {
            photons: &photons,
            truth,
            settings: &settings,
            sigma: sigma.to_num(),
            false_alarm,
            within_mm: self.within,
            why_l1,
            progress: callbacks.step,
        });
        let comparison = comparison.context(name)?;
        comparison
            .warnings()
            .into_iter()
            .for_each(callbacks.warning);
        let file = |settings: &Option<Settings>| {
            let settings = settings.as_ref();
            settings.map(|settings| requested.with_settings(settings).without_recording())
        };
        Ok(CompareResult {
            settings: file(&comparison.settings),
            fastest: file(&comparison.fastest),
            comparison,
        })
    }

    fn false_alarm_share(&self, requested: &SettingsFile) -> f64 {
        let share = self.false_alarm.or(requested.detection.false_alarm);
        share.unwrap_or(0.01)
    }

    /// A recording; settings that are not given are found by calibration.
    fn subject_of_recording(
        &self,
        input: Input,
        truth: Option<&Input>,
        mut requested: SettingsFile,
        callbacks: &Callbacks,
    ) -> Result<Subject> {
        (callbacks.step)("reads the recording", 0.0)?;
        let counts = counts(&input, &first_cycles(&requested))?;
        mask_capture(
            &mut requested.sensor.masked,
            requested.run.capture,
            counts.array.pixels(),
            counts.metadata.captures,
        )?;
        self.given.suits(&input, &counts.metadata)?;
        let is_once_per_bin = requested.detection.once_per_bin == Some(true);
        check_once_per_bin(is_once_per_bin, counts.metadata.is_list)?;
        let width = bin_width_warning(&counts.metadata);
        warnings(&counts.metadata)
            .chain(width)
            .for_each(callbacks.warning);
        let pixels = counts.histograms.len();
        let truth = match (truth, &counts.truth_mm) {
            (Some(truth), _) => Some(Truth::read(truth, pixels)?),
            (None, ranges) => ranges.clone().map(Truth::Ranges),
        };
        let metres = truth.as_ref().and_then(Truth::in_metres);
        metres.into_iter().for_each(callbacks.warning);
        let with_biases = |truth: Truth| -> Result<Truth> {
            Ok(match requested.rays.slants(counts.array)? {
                Some([_, biases]) => truth.with_biases(&biases),
                None => truth,
            })
        };
        let truth = truth.map(with_biases).transpose()?;
        let merged = requested
            .clone()
            .or(settings_of_file(&counts.metadata, counts.array));
        let is_calibrated = requested.sensor.sigma_bins.is_none();
        let why_l1 = match merged.detection.l1 {
            Some(_) => GIVEN_L1,
            None if is_calibrated => "which `calibrate` found for this background and signal",
            None => SECOND_LOOK,
        };
        ensure!(
            is_calibrated || self.glass.is_none(),
            Refused::new(
                "glass",
                "is for the search, which `sigma_bins` replaces: give `gate`"
            )
        );
        let requested = if !is_calibrated {
            merged
        } else {
            (callbacks.step)("calibrates", 0.0)?;
            let options = CalibrationOptions {
                false_alarm: self.false_alarm_share(&requested),
                glass: self.glass,
                dead_time: requested.sensor.dead_time,
                gate: requested.sensor.gate,
                ..CalibrationOptions::default()
            };
            let masked = requested.sensor.masked.clone();
            let counted = masked.as_deref();
            let found = calibrate_counts(&requested, &counts, counted, &options, &mut ());
            let found = found.with_context(|| input.to_string())?;
            found.warnings().into_iter().for_each(callbacks.warning);
            if found.pulse.is_none() {
                return Err(unknown_pulse(&input.to_string()).into());
            }
            requested.sensor.masked = None;
            with_mask(requested.or(found.settings(merged)?), masked.as_deref())
        };
        Ok(Subject {
            requested: with_short_exposures(requested),
            truth,
            why_l1,
            photons: if counts.metadata.is_list {
                Photons::List(input)
            } else {
                Photons::Histograms(Box::new(counts))
            },
        })
    }
}

/// How to open a recording. Of a list the same laser cycles are taken as of histograms: harder conditions add photons to
/// each of them, also in the dark.
fn first_cycles(requested: &SettingsFile) -> ReadOptions {
    let options = read_options(requested);
    ReadOptions {
        cycles: options.cycles.or(Some(HISTOGRAM_CYCLES)),
        ..options
    }
}

/// The width of the pulse in the recording or the scene `name` is not known.
fn unknown_pulse(name: &str) -> Refused {
    let reason = format!(
        "is needed: no peak of {} is bright enough to measure the pulse",
        plain(name)
    );
    Refused::new("sigma_bins", reason)
}

/// Why L1 is what it is.
const GIVEN_L1: &str = "as the settings have it";
const SECOND_LOOK: &str = "at the second look: the thresholds allow for that";

/// A scene; the width of the pulse is that of the scene unless it is given.
fn subject_of_scene(scene: Scene, name: &str, requested: SettingsFile) -> Result<Subject> {
    let mut requested = settings_of_scene(requested, &scene).with_context(|| name.to_owned())?;
    let sigma = U8F8::checked_from_num(scene.pulse_sigma_bins);
    let sigma = sigma.filter(|sigma| *sigma <= CentredWindow::WIDEST_PULSE);
    requested.sensor.sigma_bins = requested.sensor.sigma_bins.or(sigma);
    let is_given = requested.detection.l1.is_some();
    Ok(Subject {
        requested: with_short_exposures(requested),
        why_l1: if is_given { GIVEN_L1 } else { SECOND_LOOK },
        truth: Some(Truth::Scene(Box::new(scene.clone()))),
        photons: Photons::Scene(Box::new(scene)),
    })
}

/// By default a pixel may decide at its second look: the thresholds of the rules allow for that.
fn with_short_exposures(mut requested: SettingsFile) -> SettingsFile {
    let x = requested.detection.x.unwrap_or(4);
    requested.detection.l1.get_or_insert(x);
    if requested.sensor.dead_time.is_some() || requested.dead_time_of_sensor.is_some() {
        // Only the window rule weighs a dead time; all rules are tried.
        requested.detection.rule.get_or_insert(RuleName::Window);
    }
    requested
}
