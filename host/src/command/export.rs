//! `dtof export`: the events of an AER file in formats that other programs read.

use std::io::{self, Write};
use std::path::PathBuf;

use anyhow::{Result, bail, ensure};
use clap::Args;
use dtof::cli::arguments::{MOST_WHOLE, path, whole};
use dtof::events::aer_file::EventKind;
use dtof::events::echoes::Echo;
use dtof::export::{Format, LaserClock, Optics, Options, export};
use dtof::geometry::FieldOfView;
use dtof::rows::grouped;
use dtof::settings::SettingsFile;

use super::{dynamic_depth, warn};

#[derive(Args)]
pub struct Export {
    /// The AER file
    #[arg(value_parser = path())]
    file: PathBuf,
    /// The format; docs/export.md describes each
    #[arg(long, value_enum)]
    format: Format,
    /// The file to write
    #[arg(long, value_name = "FILE", value_parser = path())]
    out: PathBuf,
    /// A settings file: its rays and its laser rate hold unless an option says otherwise
    #[arg(long, value_name = "FILE", value_parser = path())]
    settings: Option<PathBuf>,
    /// The field of view in degrees from edge to edge [default: 60 across the longer side,
    /// square pixels]
    #[arg(
        long,
        value_name = "HxV",
        allow_hyphen_values = true,
        conflicts_with = "calibration"
    )]
    fov: Option<FieldOfView>,
    /// A direction and a range bias for each pixel, a TOML file; docs/export.md has its keys
    #[arg(long, value_name = "FILE", value_parser = path())]
    calibration: Option<PathBuf>,
    /// Laser cycles a second, for a file that does not say or is wrong [default: what the file
    /// says, else 10000000 and a warning]
    #[arg(long, value_name = "HZ", value_parser = whole(1..=MOST_WHOLE))]
    laser_hz: Option<u64>,
    /// The kind of events to export from a file with both
    #[arg(long, value_enum)]
    events: Option<EventKind>,
    /// Which echo of each exposure of a pixel or block, of depth events
    #[arg(long, value_enum, default_value_t = Echo::All)]
    echo: Echo,
    /// MCAP and ROS 2: microseconds of a point cloud [default: 1/100 of the run, 10 to 10,000]
    #[arg(long, value_name = "N", value_parser = whole(1..=1_000_000_000_u64))]
    slice_us: Option<u64>,
    #[command(flatten)]
    dynamic_depth: dynamic_depth::Options,
    /// Print nothing but errors
    #[arg(long)]
    quiet: bool,
}

impl Export {
    pub fn run(&self) -> Result<()> {
        self.check()?;
        let file = self.settings.as_deref().map(SettingsFile::read);
        let file = file.transpose()?.unwrap_or_default();
        let optics = match (&self.calibration, self.fov) {
            (Some(file), _) => Optics::Calibration(file.clone()),
            (None, Some(view)) => Optics::Pinhole(Some(view)),
            (None, None) => Optics::of(&file.rays)?,
        };
        let laser_hz = self.laser_hz.or(file.sensor.laser_hz);
        let options = Options {
            optics,
            clock: laser_hz.map(LaserClock::new).transpose()?,
            kind: self.events,
            echo: self.echo,
            slice_ns: self.slice_us.map(|us| us * 1000),
            dynamic_depth: self.dynamic_depth.dynamic_depth(),
        };
        let exported = export(&self.file, &self.out, self.format, &options, self.quiet)?;
        let out = self.out.display();
        let written = grouped(exported.written);
        if exported.late > 0 {
            writeln!(
                io::stderr(),
                "{}: {} events came after more than 65,536 later ones: left out of {out}",
                self.file.display(),
                grouped(exported.late)
            )?;
        }
        if let Some(damage) = exported.damage {
            bail!(
                "{}: {damage}; {out} holds what came before: {written} events",
                self.file.display()
            );
        }
        warn(&self.file, exported.warning, self.quiet);
        if !self.quiet {
            writeln!(
                io::stdout(),
                "{out}: {written} events ({})",
                exported.assumed
            )?;
        }
        Ok(())
    }

    /// No option is left unused.
    fn check(&self) -> Result<()> {
        let evt2 = self.format == Format::Evt2;
        let slices = matches!(self.format, Format::Mcap | Format::Ros2);
        let of_changes = self.dynamic_depth.are_given();
        let points = "points, which evt2 has not";
        for (given, has_use, option, of) in [
            (
                self.slice_us.is_some(),
                slices,
                "--slice-us",
                "mcap and ros2",
            ),
            (of_changes, evt2, "--threshold-mm and --reference", "evt2"),
            (self.fov.is_some(), !evt2, "--fov", points),
            (self.calibration.is_some(), !evt2, "--calibration", points),
        ] {
            ensure!(!given || has_use, "{option}: only for {of}");
        }
        Ok(())
    }
}
