//! `calibrate`: the settings of a sensor from a recording.

pub mod report;

use anyhow::{Context, Result};

use super::given::{Given, TDC_OF_ANY_RULE};
use super::recording::{
    RECORDING, bin_width_warning, check_once_per_bin, mask_capture, read_options, settings_of_file,
    warnings,
};
use dtof_calibrate::{Calibration, CalibrationOptions, Length, Observed, calibrate_with};
use dtof_data::options::Refused;
use dtof_data::options::keys::{Key, Reader, integer, real, yes_or_no};
use dtof_data::options::numbers::MAX_INTEGER;
use dtof_data::options::progress::{Progress, shared};
use dtof_data::photons::input::Input;
use dtof_data::photons::masked;
use dtof_data::photons::open::{Counts, counts};
use dtof_data::photons::recorded::{RecordingLength, check_totals};
use dtof_engine::settings::{
    DetectionSettings, FALSE_ALARM, RaySettings, SensorSettings, SettingsFile,
};

/// Options of this job; keys of settings files with these names mean something else.
const OWN: &[Key] = &[
    GLASS,
    Key::new(
        "target_mm",
        TARGET_MM.kind,
        "MM",
        "Distance in millimetres of a flat target that most pixels see: with `field_of_view_degrees` straight ahead, as \
         a tape measures it, else along the ray of the median pixel",
    ),
    Key::of(DetectionSettings::KEYS, "false_alarm").with_help(
        "Share of exposures without a target that end with an event, at most 0.1 [default: 0.01]",
    ),
    Key::new(
        "seed",
        SEED.kind,
        "N",
        "Seed of the simulation [default: 1]",
    ),
];
const TARGET_MM: Reader<f64> = real(0.0, 1e6);
const SEED: Reader<u64> = integer(0, MAX_INTEGER);

/// Whether there is a cover glass, if the user knows.
pub(super) const GLASS: Key = Key::new(
    "glass",
    IS_GLASS.kind,
    "GLASS",
    "Whether the nearest surface that most pixels see is a cover glass, which the gate then \
         leaves out [default: if all pixels have it at one place and half of them see something \
         behind it]",
);

pub(super) const IS_GLASS: Reader<bool> = yes_or_no();

/// What the user knows of the sensor.
const SENSOR: &[Key] = &[
    Key::of(SensorSettings::KEYS, "gate").with_help(
        "First and last bin that may hold the peak, as 20..119 [default: found]",
    ),
    Key::of(SensorSettings::KEYS, "masked").with_help(
        "Pixels to leave out, as 3,70, beside hot and dead ones that are found; none leaves out none",
    ),
    Key::of(DetectionSettings::KEYS, "once_per_bin").with_help(
        "Photons of one laser cycle in one bin count once. For photons, not for histograms",
    ),
    Key::of(SensorSettings::KEYS, "sigma_bins").with_help(
        "Standard deviation of the pulse in bins, at most 1.75, rounded to 1/256 [default: measured; \
         without a peak that is bright enough that of `settings`, else 1]",
    ),
];

/// Where the pixels look.
const RAYS: &[Key] = RaySettings::KEYS;

/// The options of a calibration.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// How to read the recording.
    pub given: Given,
    /// The options of the calibration itself.
    pub calibration: CalibrationOptions,
}

impl dtof_data::options::Options for Options {
    const KEYS: &'static [&'static [Key]] = &[RECORDING, SENSOR, TDC_OF_ANY_RULE, RAYS, OWN];

    fn set(&mut self, key: &'static str, text: &str) -> Result<(), String> {
        match key {
            "target_mm" => self.calibration.target_mm = Some(TARGET_MM.read(text)?),
            "glass" => self.calibration.glass = Some(IS_GLASS.read(text)?),
            "false_alarm" => self.calibration.false_alarm = FALSE_ALARM.read(text)?,
            "seed" => self.calibration.seed = SEED.read(text)?,
            key => self.given.set(key, text)?,
        }
        Ok(())
    }

    fn check(&self) -> Result<(), Refused> {
        self.given.check()
    }
}

/// No flat target is nearer than 20 mm, so such a distance was probably given in metres.
fn in_metres(target_mm: f64) -> Option<String> {
    (target_mm > 0.0 && target_mm < 20.0).then(|| {
        let mm = target_mm * 1000.0;
        format!(
            "a target at {target_mm} mm: --target-mm takes millimetres; {target_mm} m are {mm:.0}"
        )
    })
}

/// The result of a calibration.
pub struct CalibrateResult {
    /// The findings.
    pub found: Calibration,
    /// The settings of the sensor.
    pub settings: SettingsFile,
    /// Warnings about the recording, a line each.
    pub warnings: Vec<String>,
}

impl Options {
    /// These options over the `older` settings of the sensor.
    ///
    /// # Errors
    /// Fails if `rebin` is given without the bin width of the recording, or the bin width overflows.
    pub fn requested(&self, older: Option<&SettingsFile>) -> Result<SettingsFile> {
        let older = older.cloned().unwrap_or_default();
        let mut requested = self.given.for_recording_over(older)?;
        for key in OWN {
            requested.override_key(key.name);
        }
        Ok(requested)
    }

    /// The options of the calibration itself, with the pulse of the settings from [`Self::requested`].
    #[must_use]
    pub const fn calibration(&self, requested: &SettingsFile) -> CalibrationOptions {
        let given = &self.given.options.sensor;
        let mut options = self.calibration;
        options.dead_time = given.dead_time;
        options.gate = given.gate;
        options.with_pulse_of(requested, given.sigma_bins.is_some())
    }

    /// Calibrates the sensor that recorded `input`, with the settings from [`Self::requested`].
    ///
    /// # Errors
    /// Fails if the recording cannot be read or calibrated, or if `progress` ends the work; the error begins with the name of
    /// the recording.
    pub fn calibrate(
        &self,
        input: &Input,
        requested: SettingsFile,
        progress: &mut dyn Progress,
    ) -> Result<CalibrateResult> {
        let mut options = read_options(&requested);
        options.cycles = Some(u64::MAX);
        let counts = counts(input, &options)?;
        self.given.suits(input, &counts.metadata)?;
        let is_once = requested.detection.once_per_bin == Some(true);
        check_once_per_bin(is_once, counts.metadata.is_list)?;
        let mut masked = self.given.options.sensor.masked.clone();
        let pixels = counts.array.pixels();
        mask_capture(
            &mut masked,
            requested.run.capture,
            pixels,
            counts.metadata.captures,
        )?;
        masked::check(masked.as_deref().unwrap_or(&[]), counts.histograms.len())?;
        let options = self.calibration(&requested);
        let found = calibrate_counts(&requested, &counts, masked.as_deref(), &options, progress);
        let found = found.with_context(|| input.to_string())?;
        let width = bin_width_warning(&counts.metadata);
        let metres = self.calibration.target_mm.and_then(in_metres);
        let warnings = warnings(&counts.metadata);
        let warnings = warnings.chain(width).chain(metres).collect();
        let before = requested.or(settings_of_file(&counts.metadata, counts.array));
        Ok(CalibrateResult {
            settings: with_mask(found.settings(before)?, masked.as_deref()),
            found,
            warnings,
        })
    }
}

/// These settings with the pixels to leave out that are given, beside those that were found. If none are given, none are.
#[must_use]
pub fn with_mask(mut found: SettingsFile, given: Option<&[u16]>) -> SettingsFile {
    let Some(given) = given else { return found };
    let mut masked = given.to_vec();
    if !masked.is_empty() {
        masked.extend(found.sensor.masked.iter().flatten());
        masked.sort_unstable();
        masked.dedup();
    }
    found.sensor.masked = Some(masked).filter(|masked| !masked.is_empty());
    found
}

/// Whether there is a photon in any histogram.
pub(super) fn has_photons(counts: &Counts) -> bool {
    let mut all = counts.histograms.iter().flatten();
    all.any(|count| count > 0)
}

/// Calibrates the sensor of a recording that has been read, without the `masked` pixels.
///
/// # Errors
/// Those of [`calibrate_with`], and a pixel with more photons than can be counted.
pub(super) fn calibrate_counts(
    requested: &SettingsFile,
    counts: &Counts,
    masked: Option<&[u16]>,
    options: &CalibrationOptions,
    progress: &mut dyn Progress,
) -> Result<Calibration> {
    check_totals(&counts.histograms)?;
    let length = match (counts.cycles, read_options(requested).length) {
        (Some(cycles), _) | (None, Some(RecordingLength::Cycles(cycles))) => Length::Cycles(cycles),
        (None, Some(RecordingLength::PhotonsPerCycle(rate))) => Length::PhotonsPerCycle(rate),
        (None, None) => Length::Unknown,
    };
    let rays = requested.rays.slants(counts.array)?;
    let observed = Observed {
        array: counts.array,
        histograms: &counts.histograms,
        masked,
        length,
        cycles: None,
        bin_width_ps: counts.metadata.bin_width_ps.to_num(),
        truth_mm: counts.truth_mm.as_deref(),
        slant: rays.as_ref().map(|[slants, _]| &slants[..]),
        bias_mm: rays.as_ref().map(|[_, biases]| &biases[..]),
        offsets_mm: &requested.sensor.pixel_offsets_mm(),
        times: counts.times.as_ref(),
    };
    let mut found = calibrate_with(&observed, options, &shared(progress, "steps"))?;
    found.is_void = counts.metadata.looks_swapped;
    Ok(found)
}
