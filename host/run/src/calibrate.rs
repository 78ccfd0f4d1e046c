//! The settings of a sensor from a recording.

use anyhow::{Context, Result};

use super::given::Given;
use super::recording::{RECORDING, of_file, opening, warning_of_width, warnings};
use dtof_calibrate::{Asked, Calibration, Length, Observed, calibrate};
use dtof_engine::settings::{SettingsFile, share};
use dtof_options::Refused;
use dtof_options::numbers::{MOST_WHOLE, whole, within};
use dtof_photons::medium::Medium;
use dtof_photons::open::{Counts, counts};
use dtof_photons::recorded::RecordingLength;

/// The options that are not of settings files, whose keys of these names are others.
const OWN: &[&str] = &["target_mm", "glass", "false_alarm", "seed"];

/// What is calibrated by.
#[derive(Clone, Debug)]
pub struct Options {
    /// What the recording is.
    pub given: Given,
    /// The distance of a flat target that most of the pixels see, in millimetres.
    pub target_mm: Option<f64>,
    /// Whether the nearest surface, where all pixels have it at the same bin, is a cover glass.
    pub glass: Option<bool>,
    /// The share of exposures without a target that may end with an event.
    pub false_alarm: f64,
    /// Of what is simulated.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            given: Given::default(),
            target_mm: None,
            glass: None,
            false_alarm: 0.01,
            seed: 1,
        }
    }
}

impl dtof_options::Options for Options {
    const KEYS: &'static [&'static [&'static str]] = &[RECORDING, OWN];

    fn set(&mut self, key: &'static str, text: &str) -> Result<(), String> {
        match key {
            "target_mm" => self.target_mm = Some(within(0.0..=1e6)(text)?),
            "glass" => self.glass = Some(yes_or_no(text)?),
            "false_alarm" => self.false_alarm = share(text)?,
            "seed" => self.seed = whole(0..=MOST_WHOLE)(text)?,
            key => self.given.set(key, text)?,
        }
        Ok(())
    }

    fn check(&self) -> Result<(), Refused> {
        self.given.check()
    }
}

fn yes_or_no(text: &str) -> Result<bool, String> {
    match text {
        "yes" => Ok(true),
        "no" => Ok(false),
        _ => Err("must be yes or no".to_owned()),
    }
}

/// A calibrated sensor.
pub struct Calibrated {
    /// What was found.
    pub found: Calibration,
    /// The settings that say so.
    pub settings: SettingsFile,
    /// What to know of the recording, a line each.
    pub warnings: Vec<String>,
}

impl Options {
    /// What these options say, then the `older` settings of the sensor.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn said(&self, older: Option<&SettingsFile>) -> Result<SettingsFile> {
        let older = older.cloned().unwrap_or_default();
        let mut said = self.given.for_recording_over(older)?;
        for key in OWN {
            said.override_key(key);
        }
        Ok(said)
    }

    /// What is asked for.
    #[must_use]
    pub fn asked(&self) -> Asked {
        Asked {
            glass: self.glass,
            target_mm: self.target_mm,
            false_alarm: self.false_alarm,
            seed: self.seed,
        }
    }

    /// Calibrates by `input`, of which so much is `said`.
    ///
    /// # Errors
    /// What is wrong with the recording, its name first.
    pub fn calibrate(&self, input: &Medium, said: SettingsFile) -> Result<Calibrated> {
        let mut opening = opening(&said);
        opening.cycles = u64::MAX;
        let counts = counts(input, &opening)?;
        self.given.suits(input, &counts.known)?;
        let found = look(&said, &counts, &self.asked());
        let found = found.with_context(|| input.to_string())?;
        let of_width = warning_of_width(&counts.known, &said);
        let warnings = warnings(&counts.known).chain(of_width).collect();
        let before = said.or(of_file(&counts.known, counts.array));
        Ok(Calibrated {
            settings: found.settings(before)?,
            found,
            warnings,
        })
    }
}

/// Calibrates by what a recording holds.
///
/// # Errors
/// If it holds nothing to calibrate by.
pub(super) fn look(said: &SettingsFile, counts: &Counts, asked: &Asked) -> Result<Calibration> {
    let length = match (counts.cycles, opening(said).length) {
        (Some(cycles), _) | (None, Some(RecordingLength::Cycles(cycles))) => Length::Cycles(cycles),
        (None, Some(RecordingLength::PhotonsPerCycle(rate))) => Length::PhotonsPerCycle(rate),
        (None, None) => Length::Unknown,
    };
    let observed = Observed {
        array: counts.array,
        captures: &counts.captures,
        length,
        cycles: None,
        bin_width_ps: counts.known.bin_width_ps.to_num(),
        truth_mm: counts.truth_mm.as_deref(),
    };
    calibrate(&observed, asked)
}
