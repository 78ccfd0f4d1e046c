//! The settings of a sensor from a recording.

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};

use super::recording::{Recording, of_file, opening, warning_of_width, warnings};
use crate::calibrate::{Asked, Calibration, Length, Observed, calibrate};
use crate::cli::arguments::{MOST_WHOLE, real, whole};
use crate::input::medium::Medium;
use crate::input::open::{Counts, counts};
use crate::input::recorded::RecordingLength;
use crate::input::source::Geometry;
use crate::settings::{SettingsFile, share};

/// What is calibrated by.
#[derive(Args)]
#[group(skip)]
pub struct Options {
    /// What the recording is.
    #[command(flatten)]
    pub recording: Recording,
    /// Distance of a flat target that most of the pixels see, in millimetres
    #[arg(long, value_name = "MM", value_parser = distance, allow_hyphen_values = true)]
    target_mm: Option<f64>,
    /// Whether the nearest surface, where all pixels have it at the same bin, is a cover glass
    #[arg(long, value_enum)]
    glass: Option<Answer>,
    /// The share of exposures without a target that may end with an event, at most 0.1
    #[arg(long, value_name = "SHARE", default_value_t = 0.01, value_parser = share)]
    false_alarm: f64,
    /// Seed of what is simulated
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole(0..=MOST_WHOLE))]
    seed: u64,
}

/// An answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Answer {
    Yes,
    No,
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
        let before = older.cloned().unwrap_or_default();
        self.recording.said(|options| Ok(options.or(before)))
    }

    /// What is asked for.
    #[must_use]
    pub fn asked(&self) -> Asked {
        Asked {
            glass: self.glass.map(|answer| answer == Answer::Yes),
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
        self.recording.suits(input, &counts.known)?;
        let found = look(&said, &counts, &self.asked());
        let found = found.with_context(|| input.to_string())?;
        let of_width = warning_of_width(&counts.known, &said);
        let warnings = warnings(&counts.known).chain(of_width).collect();
        let before = said.or(of_file(&counts.known, counts.geometry));
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
    let captures = u32::try_from(counts.captures.len())?;
    let whole = counts.geometry;
    // Captures lie one after the other.
    let geometry = Geometry::new(whole.columns, (whole.rows / captures.max(1)).max(1));
    let length = match (counts.cycles, opening(said).length) {
        (Some(cycles), _) | (None, Some(RecordingLength::Cycles(cycles))) => Length::Cycles(cycles),
        (None, Some(RecordingLength::PhotonsPerCycle(rate))) => Length::PhotonsPerCycle(rate),
        (None, None) => Length::Unknown,
    };
    let observed = Observed {
        geometry,
        captures: &counts.captures,
        length,
        cycles: None,
        bin_width_ps: counts.known.bin_width_ps.to_num(),
        truth_mm: counts.truth_mm.as_deref(),
    };
    calibrate(&observed, asked)
}

fn distance(text: &str) -> Result<f64, String> {
    let distance = real(text).filter(|distance| (0.0..=1e6).contains(distance));
    distance.ok_or("must be a number from 0 to 1000000".to_owned())
}
