//! `dtof calibrate`: the settings of a sensor from a recording, or from the sensor itself.

mod from_device;

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use clap::Args;
use dtof::path;
use dtof::progress::Bar;
use dtof_calibrate::remarks;
use dtof_data::options::files::{MarkedFile, marked_destination, write_marked};
use dtof_data::options::rows::aligned;
use dtof_engine::settings::SettingsFile;
use dtof_run::calibrate::report::{self, MARKS};
use dtof_run::calibrate::{Options, with_mask};

use self::from_device::{DeviceArgs, FromDevice};
use super::flags::Flags;
use super::job::Recorded;
use super::{say_kept, warn};

#[derive(Args)]
pub struct Calibrate {
    #[command(flatten)]
    recorded: Recorded,
    #[command(flatten)]
    from_device: DeviceArgs,
    /// Settings file to write
    #[arg(long, value_name = "FILE", value_parser = path())]
    out: PathBuf,
    /// Report to write [default: the name of the settings file, with .html]
    #[arg(long, value_name = "FILE", value_parser = path())]
    report: Option<PathBuf>,
    /// Older settings of the sensor. They fill in what is not found now, and the report compares them
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
        let requested = self.options.0.requested(older.as_ref())?;
        let calibrated = self.calibrate(&requested, older);
        calibrated.map_err(|error| requested.add_file_name(error))
    }

    fn calibrate(&self, requested: &SettingsFile, older: Option<SettingsFile>) -> Result<()> {
        let input = self.recorded.file();
        let place = self.report.clone();
        let place = place.unwrap_or_else(|| self.out.with_extension("html"));
        let inputs = [input, self.settings.as_deref()];
        let inputs: Vec<&Path> = inputs.into_iter().flatten().collect();
        self.check_places(&place, &inputs)?;
        let name = input.map(|input| input.display().to_string());
        let name = name.or(self.from_device.device.clone()).unwrap_or_default();
        let (found, settings, collected) = match input {
            Some(input) => {
                self.from_device.check_unused()?;
                let mut bar = Bar::new(self.quiet);

                let options = &self.options.0;
                let calibrated = options.calibrate(&input.into(), requested.clone(), &mut bar)?;
                warn(input, calibrated.warnings, self.quiet);
                (calibrated.found, calibrated.settings, Vec::new())
            }
            None => {
                let options = &self.options.0;
                let port = self.from_device.open(&options.given)?;
                let device = &self.from_device;
                let calibration = options.calibration(requested);
                let masked = options.given.options.sensor.masked.as_deref();
                let calibrated =
                    device.calibrate((&name, port), requested, (&calibration, masked), self.quiet);
                let FromDevice {
                    found,
                    settings,
                    rows,
                } = calibrated.with_context(|| name.clone())?;
                let settings = found.settings(requested.clone().or(settings))?;
                let settings = with_mask(settings, masked);
                (found, settings, rows)
            }
        };
        let changes = older.map_or(Vec::new(), |older| report::changes(&settings, &older));
        let page = report::page(&found, &settings, &changes, &name)?;
        // The report of the older settings goes first: a report is that of the settings beside it.
        let text = settings.to_toml()?;
        let report = MarkedFile {
            place: &place,
            text: &page,
            mark: MARKS[1],
            is_edited: false,
        };
        let settings_file = MarkedFile {
            place: &self.out,
            text: &text,
            mark: MARKS[0],
            is_edited: true,
        };
        let kept = write_marked(&[settings_file, report], &[&place], &inputs)?;
        say_kept(kept.as_deref(), self.quiet)?;
        if !self.quiet {
            let mut out = io::stdout().lock();
            let rows = [collected, report::rows(&found)].concat();
            write!(out, "{}", aligned(&rows))?;
            if !changes.is_empty() {
                write!(out, "\nSince the older settings:\n{}", aligned(&changes))?;
            }
            for (topic, remark) in remarks(&found, &settings) {
                write!(out, "\n{topic}: {remark}\n")?;
            }
            writeln!(out, "\nOpen {} in a browser.", place.display())?;
            out.flush()?;
        }
        Ok(())
    }

    /// Checks that settings and report may be written, before anything is read: the report to `report`.
    fn check_places(&self, report: &Path, inputs: &[&Path]) -> Result<()> {
        ensure!(
            report != self.out,
            "{}: settings and report need two names",
            report.display()
        );
        for (place, mark) in [&*self.out, report].into_iter().zip(MARKS) {
            marked_destination(place, mark, inputs)?;
        }
        Ok(())
    }
}
