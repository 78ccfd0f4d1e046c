//! `dtof replay`: recorded photons or histograms through the engine.

use std::path::PathBuf;

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use dtof::cli::arguments::{bins, fixed, path, positive, whole};
use dtof::engine::host::host_engine;
use dtof::engine::run::run;
use dtof::engine::settings::Settings;
use dtof::events::echoes::Echo;
use dtof::events::output::Output;
use dtof::input::photon_csv::PhotonCsv;
use dtof::input::recorded::{Capture, RecordedHistograms, RecordingLength};
use dtof::input::source::{Geometry, PhotonSource};
use dtof::input::{npy, tmf8820};
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
    /// Replay only the first N laser cycles
    #[arg(long, value_name = "N", default_value_t = 10_000, value_parser = whole(1..=u64::MAX))]
    cycles: u64,
    /// Seed of the laser cycles that recorded photons are given
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole(0..=u64::MAX))]
    seed: u64,
    /// Print nothing but errors
    #[arg(long)]
    quiet: bool,
}

/// An opened recording and the settings its format stands for.
struct Recording {
    photons: Box<dyn PhotonSource>,
    bins: usize,
    bin_width_ps: U16F16,
    offset_mm: I24F8,
}

impl Replay {
    pub fn run(&self) -> Result<()> {
        let changes = self.changes.wanted()?;
        let Recording {
            mut photons,
            bins,
            bin_width_ps,
            offset_mm,
        } = self.open()?;
        let settings = Settings {
            frame: self.frames.frame,
            ..self.operation.settings(
                bins,
                self.bin_width_ps.unwrap_or(bin_width_ps),
                self.offset_mm.unwrap_or(offset_mm),
                self.seed,
            )?
        };
        let mut engine = host_engine(&settings, photons.geometry(), &photons.addresses())?;
        let mut output = Output::create(&self.out, &settings, photons.as_ref(), Some(&self.input))?
            .with_changes(changes.as_ref())?
            .with_echo(self.echo, &settings);
        let mut summary = run(
            photons.as_mut(),
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

    /// Reads or checks the whole file, by its extension.
    fn open(&self) -> Result<Recording> {
        let path = &self.input;
        let extension = path.extension().and_then(|extension| extension.to_str());
        let extension = extension.map(str::to_ascii_lowercase);
        ensure!(
            self.columns.is_none() || extension.as_deref() == Some("csv"),
            "--columns is for photon lists; {} has its own",
            path.display()
        );
        match extension.as_deref() {
            Some("npy") => {
                let npy = npy::read(path)?;
                self.expect_bins(npy.bins)?;
                let photons = self.histograms(npy.geometry, &[npy.capture])?;
                Ok(Recording::new(photons, npy.bins))
            }
            Some("json") => {
                let log = tmf8820::read(path)?;
                self.expect_bins(tmf8820::BINS)?;
                let photons = self
                    .histograms(log.geometry, &log.captures)?
                    .with_sides(tmf8820::SIDES);
                Ok(Recording {
                    bin_width_ps: tmf8820::BIN_WIDTH_PS,
                    offset_mm: tmf8820::OFFSET_MM,
                    ..Recording::new(photons, tmf8820::BINS)
                })
            }
            Some("csv") => {
                ensure!(
                    self.photons_per_cycle.is_none() && self.recorded_cycles.is_none(),
                    "--photons-per-cycle and --recorded-cycles are for histograms; {} holds photons",
                    path.display()
                );
                let bins = self.bins.unwrap_or(128).into();
                Ok(Recording::new(
                    PhotonCsv::open(path, bins, self.columns, self.cycles)?,
                    bins,
                ))
            }
            _ => bail!(
                "{}: the name must end in .npy, .json or .csv",
                path.display()
            ),
        }
    }

    fn histograms(&self, geometry: Geometry, captures: &[Capture]) -> Result<RecordedHistograms> {
        let length = match (self.recorded_cycles, self.photons_per_cycle) {
            (Some(cycles), _) => RecordingLength::Cycles(cycles),
            (None, rate) => RecordingLength::PhotonsPerCycle(rate.unwrap_or(1.0)),
        };
        let name = || self.input.display().to_string();
        RecordedHistograms::new(geometry, captures, length, self.cycles, self.seed)
            .with_context(name)
    }

    /// A file that says how many bins it has is not read as another.
    fn expect_bins(&self, bins: usize) -> Result<()> {
        let name = self.input.display();
        let wanted = self.bins.map_or(bins, usize::from);
        ensure!(
            wanted == bins,
            "{name}: --bins {wanted}, but the file has {bins}; leave --bins out"
        );
        Ok(())
    }
}

impl Recording {
    fn new(photons: impl PhotonSource + 'static, bins: usize) -> Self {
        Self {
            photons: Box::new(photons),
            bins,
            bin_width_ps: U16F16::lit("250"),
            offset_mm: I24F8::ZERO,
        }
    }
}
