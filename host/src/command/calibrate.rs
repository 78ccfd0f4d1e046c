//! `dtof calibrate`: the settings of a sensor from a recording.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use clap::{Args, ValueEnum};
use dtof::calibrate::report::{self, MARKS};
use dtof::calibrate::{Asked, Length, Observed, calibrate, remarks};
use dtof::cli::arguments::{bins, fixed, path, positive, real, whole};
use dtof::files::{Marked, write_marked};
use dtof::input::open::{Counts, counts};
use dtof::input::recorded::RecordingLength;
use dtof::input::source::Geometry;
use dtof::rows::aligned;
use dtof::settings::{Run, Sensor, SettingsFile};
use dtof_core::fixed::types::U16F16;

use super::replay::opening;

#[derive(Args)]
pub struct Calibrate {
    /// Histograms (.npy, or a TMF8820 capture log .json) or photons (.csv with the header
    /// pixel,cycle,bin)
    #[arg(long, value_name = "FILE", value_parser = path())]
    input: PathBuf,
    /// The settings file to write
    #[arg(long, value_name = "FILE", value_parser = path())]
    out: PathBuf,
    /// The report to write [default: as the settings file, with .html]
    #[arg(long, value_name = "FILE", value_parser = path())]
    report: Option<PathBuf>,
    /// Older settings of the sensor: what this recording does not tell is taken from them, and the
    /// report says what has changed
    #[arg(long, value_name = "FILE", value_parser = path())]
    settings: Option<PathBuf>,
    /// Histograms: laser cycles that each capture lasted
    #[arg(long, value_name = "N", value_parser = whole(1..=u64::MAX))]
    recorded_cycles: Option<u64>,
    /// Histograms, instead: photons a laser cycle in the brightest pixel of each capture
    #[arg(long, value_name = "R", value_parser = positive, conflicts_with = "recorded_cycles")]
    photons_per_cycle: Option<f64>,
    /// Photon lists: columns of the array, pixel = row × columns + column [default: one row]
    #[arg(long, value_name = "N", value_parser = whole(1..=65_536_u32))]
    columns: Option<u32>,
    /// Bins of a histogram, a power of two from 8 to 1024 [default: the file's; 128 for .csv]
    #[arg(long, value_name = "N", value_parser = bins)]
    bins: Option<u16>,
    /// Picoseconds a bin, rounded to 1/65536 [default: 250; 92.1 for .json]
    #[arg(long, value_name = "PS", value_parser = fixed::<U16F16>, allow_hyphen_values = true)]
    bin_width_ps: Option<U16F16>,
    /// Laser cycles a second
    #[arg(long, value_name = "HZ", value_parser = whole(1..=1_000_000_000_000_u64))]
    laser_hz: Option<u64>,
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
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole(0..=u64::MAX))]
    seed: u64,
    /// Print nothing but errors
    #[arg(long)]
    quiet: bool,
}

/// An answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Answer {
    Yes,
    No,
}

impl Calibrate {
    pub fn run(&self) -> Result<()> {
        let older = self.settings.as_deref().map(SettingsFile::read);
        let older = older.transpose()?;
        let said = self.options().or(older.clone().unwrap_or_default());
        let mut opening = opening(&said);
        opening.cycles = u64::MAX;
        let counts = counts(&self.input, &opening)?;
        let found = self.look(&said, &counts)?;
        let columns = counts.geometry.columns;
        let before = said.or(SettingsFile {
            sensor: Sensor {
                columns: Some(columns),
                offset_mm: counts.format.offset_mm,
                ..Sensor::default()
            },
            ..SettingsFile::default()
        });
        let settings = found.settings(before)?;
        let changes = older.map_or(Vec::new(), |older| report::changes(&settings, &older));
        let name = self.input.display().to_string();
        let page = report::page(&found, &settings, &changes, &name)?;
        let place = self.report.clone();
        let place = place.unwrap_or_else(|| self.out.with_extension("html"));
        ensure!(
            place != self.out,
            "{}: settings and report need two names",
            place.display()
        );
        let mut inputs: Vec<&Path> = vec![&self.input];
        inputs.extend(self.settings.as_deref());
        // The settings last: where they are, the report is.
        let text = settings.to_toml()?;
        let of = |place, text, mark| Marked { place, text, mark };
        let files = [
            of(place.as_path(), page.as_str(), MARKS[1]),
            of(&self.out, &text, MARKS[0]),
        ];
        write_marked(&files, &inputs)?;
        if !self.quiet {
            let mut out = io::stdout().lock();
            write!(out, "{}", aligned(&report::rows(&found)))?;
            if !changes.is_empty() {
                write!(out, "\nSince the older settings:\n{}", aligned(&changes))?;
            }
            for (topic, remark) in remarks(&found) {
                write!(out, "\n{topic}: {remark}\n")?;
            }
            writeln!(out, "\nOpen {} in a browser.", place.display())?;
            out.flush()?;
        }
        Ok(())
    }

    /// What the options say.
    fn options(&self) -> SettingsFile {
        SettingsFile {
            sensor: Sensor {
                laser_hz: self.laser_hz,
                columns: self.columns,
                bins: self.bins,
                bin_width_ps: self.bin_width_ps,
                ..Sensor::default()
            },
            run: Run {
                photons_per_cycle: self.photons_per_cycle,
                recorded_cycles: self.recorded_cycles,
                ..Run::default()
            },
            ..SettingsFile::default()
        }
    }

    fn look(&self, said: &SettingsFile, counts: &Counts) -> Result<dtof::calibrate::Calibration> {
        let captures = u32::try_from(counts.captures.len())?;
        let whole = counts.geometry;
        // Captures lie one after the other.
        let geometry = Geometry::new(whole.columns, (whole.rows / captures.max(1)).max(1));
        let length = match (counts.cycles, opening(said).length) {
            (Some(cycles), _) | (None, Some(RecordingLength::Cycles(cycles))) => {
                Length::Cycles(cycles)
            }
            (None, Some(RecordingLength::PhotonsPerCycle(rate))) => Length::PhotonsPerCycle(rate),
            (None, None) => Length::Unknown,
        };
        let width = said.sensor.bin_width_ps.or(counts.format.bin_width_ps);
        let observed = Observed {
            geometry,
            captures: &counts.captures,
            length,
            bin_width_ps: width.map_or(250.0, |width| width.to_num()),
            truth_mm: counts.truth_mm.as_deref(),
        };
        let asked = Asked {
            glass: self.glass.map(|answer| answer == Answer::Yes),
            target_mm: self.target_mm,
            false_alarm: self.false_alarm,
            seed: self.seed,
        };
        calibrate(&observed, &asked).with_context(|| self.input.display().to_string())
    }
}

fn distance(text: &str) -> Result<f64, String> {
    let distance = real(text).filter(|distance| (0.0..=1e6).contains(distance));
    distance.ok_or("must be a number from 0 to 1000000".to_owned())
}

fn share(text: &str) -> Result<f64, String> {
    let share = positive(text).ok().filter(|share| *share <= 0.1);
    share.ok_or("must be a number above 0, at most 0.1".to_owned())
}
