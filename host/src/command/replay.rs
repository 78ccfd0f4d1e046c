//! `dtof replay`: recorded photons or histograms through the engine.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use dtof::cli::arguments::{bins, fixed, path, positive, whole};
use dtof::engine::host::host_engine;
use dtof::engine::run::run;
use dtof::events::echoes::Echo;
use dtof::events::output::Output;
use dtof::input::masked::Masked;
use dtof::input::open::{Opening, Recording, open};
use dtof::input::recorded::RecordingLength;
use dtof::input::source::PhotonSource;
use dtof::settings::{Run, Sensor, SettingsFile};
use dtof_core::fixed::types::{I24F8, U16F16};

use super::dynamic_depth::Shown;
use super::operation::{Frames, Operation};
use super::print_summary;

#[derive(Args)]
pub struct Replay {
    /// Histograms (.npy, or a TMF8820 capture log .json) or photons (.csv with the header
    /// pixel,cycle,bin)
    #[arg(long, value_name = "FILE", value_parser = path())]
    input: PathBuf,
    /// The folder of the results
    #[arg(long, value_name = "DIR", value_parser = path())]
    out: PathBuf,
    /// Photon lists: columns of the array, pixel = row × columns + column [default: one row]
    #[arg(long, value_name = "N", value_parser = whole(1..=65_536_u32))]
    columns: Option<u32>,
    /// Bins of a histogram, a power of two from 8 to 1024 [default: the file's; 128 for .csv]
    #[arg(long, value_name = "N", value_parser = bins)]
    bins: Option<u16>,
    /// Picoseconds a bin, rounded to 1/65536 [default: 250; 92.1 for .json]
    #[arg(long, value_name = "PS", value_parser = fixed::<U16F16>, allow_hyphen_values = true)]
    bin_width_ps: Option<U16F16>,
    /// Millimetres added to every range, rounded to 1/256 [default: 0; -179.5 for .json]
    #[arg(long, value_name = "MM", value_parser = fixed::<I24F8>, allow_hyphen_values = true)]
    offset_mm: Option<I24F8>,
    #[command(flatten)]
    operation: Operation,
    #[command(flatten)]
    frames: Frames,
    #[command(flatten)]
    changes: Shown,
    /// The echo of each exposure that maps and report show; the files of events hold all
    /// [default: the strongest in the maps, all in the report]
    #[arg(long, value_enum)]
    echo: Option<Echo>,
    /// Histograms: photons a laser cycle in the brightest pixel of each capture [default: 1]
    #[arg(long, value_name = "R", value_parser = positive, conflicts_with = "recorded_cycles")]
    photons_per_cycle: Option<f64>,
    /// Histograms: laser cycles the recording lasted
    #[arg(long, value_name = "N", value_parser = whole(1..=u64::MAX))]
    recorded_cycles: Option<u64>,
    /// Laser cycles a second, for what is exported [default: not known]
    #[arg(long, value_name = "HZ", value_parser = whole(1..=1_000_000_000_000_u64))]
    laser_hz: Option<u64>,
    /// Replay only the first N laser cycles [default: 10000]
    #[arg(long, value_name = "N", value_parser = whole(1..=u64::MAX))]
    cycles: Option<u64>,
    /// Seed of the laser cycles that recorded photons are given [default: 1]
    #[arg(long, value_name = "N", value_parser = whole(0..=u64::MAX))]
    seed: Option<u64>,
    /// Print nothing but errors
    #[arg(long)]
    quiet: bool,
}

impl Replay {
    pub fn run(&self) -> Result<()> {
        let changes = self.changes.wanted()?;
        let said = self.operation.said(self.options())?;
        let Recording { photons, format } = open(&self.input, &opening(&said))?;
        let said = said.or(SettingsFile {
            sensor: Sensor {
                laser_hz: photons.laser_hz(),
                columns: Some(photons.geometry().columns),
                bin_width_ps: format.bin_width_ps,
                offset_mm: format.offset_mm,
                gate: format.gate,
                ..Sensor::default()
            },
            ..SettingsFile::default()
        });
        let settings = said.settings(format.bins)?;
        let photons = Masked::new(photons, &settings.masked)?;
        let mut photons = photons.with_laser_hz(said.sensor.laser_hz);
        let mut engine = host_engine(&settings, photons.geometry(), &photons.addresses())?;
        let mut output = Output::create(&self.out, &settings, &photons, Some(&self.input))?
            .with_settings(said.with(&settings), self.operation.settings.as_deref())?
            .with_changes(changes.as_ref())?
            .with_echo(self.echo, &settings);
        let mut summary = run(
            &mut photons,
            engine.as_mut(),
            &mut output,
            &settings,
            self.quiet,
            |_| (),
        )?;
        let input = self.input.display().to_string();
        let lead = format!("Recorded photons of {input}.");
        summary.input = Some(input);
        output.finish(&summary, settings.title(), &lead, &[])?;
        if !self.quiet {
            print_summary(&summary, &[], &self.out)?;
        }
        Ok(())
    }

    /// What the options say, but for those of every command.
    fn options(&self) -> SettingsFile {
        SettingsFile {
            sensor: Sensor {
                laser_hz: self.laser_hz,
                columns: self.columns,
                bins: self.bins,
                bin_width_ps: self.bin_width_ps,
                offset_mm: self.offset_mm,
                ..Sensor::default()
            },
            run: Run {
                cycles: self.cycles,
                seed: self.seed,
                photons_per_cycle: self.photons_per_cycle,
                recorded_cycles: self.recorded_cycles,
                frame: self.frames.frame,
            },
            ..SettingsFile::default()
        }
    }
}

/// What is said of a recording.
pub fn opening(said: &SettingsFile) -> Opening {
    let Run {
        cycles,
        seed,
        photons_per_cycle,
        recorded_cycles,
        ..
    } = said.run;
    let recorded = recorded_cycles.map(RecordingLength::Cycles);
    let rate = photons_per_cycle.map(RecordingLength::PhotonsPerCycle);
    Opening {
        columns: said.sensor.columns,
        bins: said.sensor.bins,
        length: recorded.or(rate),
        cycles: cycles.unwrap_or(10_000),
        seed: seed.unwrap_or(1),
    }
}
