//! `dtof calibrate`: the settings of a sensor from a recording, or from the sensor itself.

mod desk;

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use clap::{Args, ValueEnum};
use dtof::calibrate::report::{self, MARKS};
use dtof::calibrate::{Asked, Calibration, Length, Observed, calibrate, remarks};
use dtof::cli::arguments::{MOST_WHOLE, path, real, whole};
use dtof::files::{Marked, write_marked};
use dtof::input::open::{Counts, counts};
use dtof::input::recorded::RecordingLength;
use dtof::input::source::Geometry;
use dtof::rows::aligned;
use dtof::settings::{SettingsFile, share};

use self::desk::{Desk, Gathered};
use super::recording::{Recording, of_file, opening, warn, warn_of_width};

#[derive(Args)]
pub struct Calibrate {
    /// A recording, of any format that `replay` reads
    #[arg(long, value_name = "FILE", value_parser = path(), conflicts_with = "device")]
    input: Option<PathBuf>,
    #[command(flatten)]
    desk: Desk,
    /// The settings file to write
    #[arg(long, value_name = "FILE", value_parser = path())]
    out: PathBuf,
    /// The report to write [default: as the settings file, with .html]
    #[arg(long, value_name = "FILE", value_parser = path())]
    report: Option<PathBuf>,
    /// Older settings of the sensor: what is not found now is taken from them, and the report says
    /// what has changed
    #[arg(long, value_name = "FILE", value_parser = path())]
    settings: Option<PathBuf>,
    #[command(flatten)]
    recording: Recording,
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
        let before = older.clone().unwrap_or_default();
        let said = self.recording.said(|options| Ok(options.or(before)))?;
        let calibrated = self.calibrate(&said, older);
        calibrated.map_err(|error| said.name_origin(error))
    }

    fn calibrate(&self, said: &SettingsFile, older: Option<SettingsFile>) -> Result<()> {
        let asked = Asked {
            glass: self.glass.map(|answer| answer == Answer::Yes),
            target_mm: self.target_mm,
            false_alarm: self.false_alarm,
            seed: self.seed,
        };
        let name = self.input.as_ref().map(|input| input.display().to_string());
        let name = name.or(self.desk.device.clone()).unwrap_or_default();
        let Gathered {
            found,
            known,
            rows: collected,
        } = match &self.input {
            Some(input) => self.of_file(input, said, &asked)?,
            None => {
                let (desk, recording) = (&self.desk, &self.recording);
                let port = desk.open(recording)?;
                let found = desk.calibrate((&name, port), said, recording, &asked, self.quiet);
                found.with_context(|| name.clone())?
            }
        };
        let settings = found.settings(said.clone().or(known))?;
        let changes = older.map_or(Vec::new(), |older| report::changes(&settings, &older));
        let page = report::page(&found, &settings, &changes, &name)?;
        let place = self.report.clone();
        let place = place.unwrap_or_else(|| self.out.with_extension("html"));
        ensure!(
            place != self.out,
            "{}: settings and report need two names",
            place.display()
        );
        let inputs = [self.input.as_deref(), self.settings.as_deref()];
        let inputs: Vec<&Path> = inputs.into_iter().flatten().collect();
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
            let rows = [collected, report::rows(&found)].concat();
            write!(out, "{}", aligned(&rows))?;
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

    fn of_file(&self, input: &Path, said: &SettingsFile, asked: &Asked) -> Result<Gathered> {
        self.desk.suits_file()?;
        let mut opening = opening(said);
        opening.cycles = u64::MAX;
        let counts = counts(input, &opening)?;
        self.recording.suits(input, &counts.known)?;
        let found = look(said, &counts, asked);
        let found = found.with_context(|| input.display().to_string())?;
        warn(input, &counts.known, self.quiet);
        warn_of_width(input, &counts.known, said, self.quiet);
        Ok(Gathered {
            found,
            known: of_file(&counts.known, counts.geometry),
            rows: Vec::new(),
        })
    }
}

/// Calibrates by what a recording holds.
pub fn look(said: &SettingsFile, counts: &Counts, asked: &Asked) -> Result<Calibration> {
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
