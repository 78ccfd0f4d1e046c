//! The options that say how pixels operate, the same for every command.

use std::path::PathBuf;

use crate::cli::arguments::{fixed, path, whole};
use crate::settings::{Detection, Sensor, SettingsFile, pulse};
use anyhow::Result;
use clap::Args;
use dtof_core::fixed::types::U8F8;

/// What is known of the sensor.
#[derive(Args)]
pub struct Known {
    /// A TOML file with settings, as every run writes one; options override it. docs/settings.md
    /// lists its keys
    #[arg(long, value_name = "FILE", value_parser = path())]
    pub settings: Option<PathBuf>,
    /// Only these bins may hold the peak, both inclusive [default: all]
    #[arg(long, value_name = "FIRST..LAST", value_parser = gate)]
    gate: Option<(u16, u16)>,
    /// Pixels that are left out, such as hot and dead ones, as 3,70
    #[arg(long, value_name = "PIXELS", value_delimiter = ',', value_parser = whole(0..=u16::MAX))]
    mask: Option<Vec<u16>>,
    /// Standard deviation of the pulse in bins, at most 1.75, rounded to 1/256. The depth then
    /// comes from a window that suits it [default: the centroid of three bins]
    #[arg(long, value_name = "S", value_parser = sigma, allow_hyphen_values = true)]
    sigma_bins: Option<U8F8>,
}

impl Known {
    /// What these options say, then `more`, then the file.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn said(&self, more: SettingsFile) -> Result<SettingsFile> {
        let own = Sensor {
            gate: self.gate,
            masked: self.mask.clone(),
            sigma_bins: self.sigma_bins,
            ..Sensor::default()
        };
        let file = self.settings.as_deref().map(SettingsFile::read);
        let mut file = file.transpose()?.unwrap_or_default();
        let decides = Detection {
            estimator: None,
            half_widths: None,
            ..more.detection.clone()
        };
        if decides != Detection::default() {
            // Frames have none of these options.
            file.run.frame = None;
        }
        // One command: half widths beside a pulse are its own, those of the file may be another's.
        let options = SettingsFile {
            sensor: own.or(more.sensor.clone()),
            ..more
        };
        Ok(options.or(file))
    }
}

/// How pixels operate.
#[derive(Args)]
pub struct Operation {
    /// What is known of the sensor.
    #[command(flatten)]
    pub known: Known,
    #[command(flatten)]
    detection: Detection,
}

/// The option of commands that run on this computer: a device reports events.
#[derive(Args)]
pub struct Frames {
    /// Simulate a frame-based sensor for comparison: every N laser cycles each pixel reads its
    /// highest bin, if that stands above the background
    #[arg(long, value_name = "N", value_parser = whole(1..=u16::MAX),
        conflicts_with_all = ["rule", "alpha", "window", "z", "false_alarm", "min_count", "l1", "l2", "x", "binning", "patience", "tracking", "echoes", "echo_wait"])]
    pub frame: Option<u16>,
}

impl Operation {
    /// What these options say, then `more`, then the file.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn said(&self, more: SettingsFile) -> Result<SettingsFile> {
        self.known.said(SettingsFile {
            detection: self.detection.clone(),
            ..more
        })
    }
}

fn gate(text: &str) -> Result<(u16, u16), String> {
    let bins = text.split_once("..").and_then(|(first, last)| {
        let bin = whole(0..=u16::MAX);
        Some((bin(first).ok()?, bin(last).ok()?))
    });
    bins.ok_or("must be FIRST..LAST, as 20..119".to_owned())
}

fn sigma(text: &str) -> Result<U8F8, String> {
    pulse(fixed(text)?)
}
