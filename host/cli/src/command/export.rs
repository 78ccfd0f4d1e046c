//! `dtof export`: the events of an AER file in formats that other programs read.

use std::io::{self, Write};
use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use dtof::path;
use dtof::progress::Bar;
use dtof_data::events::aer_file::EventKind;
use dtof_data::options::Refused;
use dtof_data::options::numbers::integer;
use dtof_data::options::rows::grouped;
use dtof_engine::settings::SettingsFile;
use dtof_run::export::{Format, Options, ProjectionOptions, export};

use super::flags::{Flags, name};
use super::{dynamic_depth, warn};

#[derive(Args)]
pub struct Export {
    /// AER file
    #[arg(value_parser = path())]
    file: PathBuf,
    /// Format; docs/export.md describes each
    #[arg(long, value_parser = name::<Format>())]
    format: Format,
    /// File to write
    #[arg(long, value_name = "FILE", value_parser = path())]
    out: PathBuf,
    /// Settings file whose [rays] and laser rate are used; options override them
    #[arg(long, value_name = "FILE", value_parser = path())]
    settings: Option<PathBuf>,
    #[command(flatten)]
    projection: Flags<ProjectionOptions>,
    /// Kind of events to export, if the file has depth events and changes of depth
    #[arg(long, value_parser = name::<EventKind>())]
    events: Option<EventKind>,
    /// MCAP and ROS 2: microseconds in a point cloud [default: 1/100 of the run, 10 to 10,000]
    #[arg(long, value_name = "N", value_parser = integer(1..=1_000_000_000_u64))]
    slice_us: Option<u64>,
    #[command(flatten)]
    dynamic_depth: dynamic_depth::DynamicDepthFlags,
    /// Print nothing but errors
    #[arg(long)]
    quiet: bool,
}

impl Export {
    pub fn run(&self) -> Result<()> {
        self.check()?;
        let file = self.settings.as_deref().map(SettingsFile::read);
        let file = file.transpose()?.unwrap_or_default();
        let options = Options {
            kind: self.events,
            slice_ns: self.slice_us.map(|us| us * 1000),
            dynamic_depth: self.dynamic_depth.dynamic_depth(),
            ..self.projection.0.clone().options(file)?
        };
        let exported = export(
            &self.file,
            &self.out,
            self.format,
            &options,
            &mut Bar::new(self.quiet),
        )?;
        let out = self.out.display();
        let written = grouped(exported.written);
        let what = match self.projection.0.one_per_pixel {
            true => "points, one a pixel",
            false => "events",
        };
        if exported.late > 0 {
            writeln!(
                io::stderr(),
                "{}: {} events were left out of {out}: more than 65,536 later events came before them",
                self.file.display(),
                grouped(exported.late)
            )?;
        }
        if let Some(damage) = exported.damage {
            bail!(
                "{}: {damage}; {out} has the {written} {what} before the damage",
                self.file.display()
            );
        }
        warn(self.file.as_path(), exported.warnings, self.quiet);
        if !self.quiet {
            writeln!(
                io::stdout(),
                "{out}: {written} {what} ({})",
                exported.assumptions
            )?;
        }
        Ok(())
    }

    /// Refuses options that the format does not use.
    fn check(&self) -> Result<()> {
        let evt2 = self.format == Format::Evt2;
        let slices = matches!(self.format, Format::Mcap | Format::Ros2);
        let projection = &self.projection.0.given.rays;
        let points = "formats with points, unlike evt2";
        for (key, is_used, formats) in [
            (self.slice_us.map(|_| "slice_us"), slices, "mcap and ros2"),
            (self.dynamic_depth.first_key(), evt2, "evt2"),
            (
                projection
                    .field_of_view_degrees
                    .map(|_| "field_of_view_degrees"),
                !evt2,
                points,
            ),
            (
                projection.calibration.as_ref().map(|_| "calibration"),
                !evt2,
                points,
            ),
        ] {
            if let Some(key) = key.filter(|_| !is_used) {
                bail!(Refused::new(key, format!("is only for {formats}")));
            }
        }
        Ok(())
    }
}
