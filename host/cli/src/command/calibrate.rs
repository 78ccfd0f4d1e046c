//! `dtof calibrate`: the settings of a sensor from a recording, or from the sensor itself.

mod desk;

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use clap::Args;
use dtof::path;
use dtof_calibrate::remarks;
use dtof_calibrate::report::{self, MARKS};
use dtof_engine::settings::SettingsFile;
use dtof_options::files::{Marked, write_marked};
use dtof_options::rows::aligned;
use dtof_run::calibrate::Options;

use self::desk::{Desk, Gathered};
use super::flags::Flags;
use super::warn;

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
    options: Flags<Options>,
    /// Print nothing but errors
    #[arg(long)]
    quiet: bool,
}

impl Calibrate {
    pub fn run(&self) -> Result<()> {
        let older = self.settings.as_deref().map(SettingsFile::read);
        let older = older.transpose()?;
        let said = self.options.0.said(older.as_ref())?;
        let calibrated = self.calibrate(&said, older);
        calibrated.map_err(|error| said.blame(error))
    }

    fn calibrate(&self, said: &SettingsFile, older: Option<SettingsFile>) -> Result<()> {
        let name = self.input.as_ref().map(|input| input.display().to_string());
        let name = name.or(self.desk.device.clone()).unwrap_or_default();
        let (found, settings, collected) = match &self.input {
            Some(input) => {
                self.desk.suits_file()?;
                let of_file = self.options.0.calibrate(&input.into(), said.clone())?;
                warn(input, of_file.warnings, self.quiet);
                (of_file.found, of_file.settings, Vec::new())
            }
            None => {
                let (given, asked) = (&self.options.0.given, self.options.0.asked());
                let port = self.desk.open(given)?;
                let desk = &self.desk;
                let gathered = desk.calibrate((&name, port), said, &asked, self.quiet);
                let Gathered { found, known, rows } = gathered.with_context(|| name.clone())?;
                let settings = found.settings(said.clone().or(known))?;
                (found, settings, rows)
            }
        };
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
}
