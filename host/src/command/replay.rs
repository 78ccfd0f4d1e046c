//! `dtof replay`: recorded photons or histograms through the engine.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use dtof::cli::arguments::{bins, fixed, path, positive, whole};
use dtof::engine::host::host_engine;
use dtof::engine::run::run;
use dtof::engine::settings::Settings;
use dtof::events::echoes::Echo;
use dtof::events::output::Output;
use dtof::input::open::{Opening, Recording, open};
use dtof::input::recorded::RecordingLength;
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

impl Replay {
    pub fn run(&self) -> Result<()> {
        let changes = self.changes.wanted()?;
        let Recording {
            mut photons,
            format,
        } = open(&self.input, &self.opening())?;
        let settings = Settings {
            frame: self.frames.frame,
            ..self.operation.settings(
                format.bins,
                self.bin_width_ps
                    .or(format.bin_width_ps)
                    .unwrap_or(const { U16F16::lit("250") }),
                self.offset_mm.or(format.offset_mm).unwrap_or(I24F8::ZERO),
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

    /// What the options say of the recording.
    fn opening(&self) -> Opening {
        let cycles = self.recorded_cycles.map(RecordingLength::Cycles);
        let rate = self.photons_per_cycle.map(RecordingLength::PhotonsPerCycle);
        Opening {
            columns: self.columns,
            bins: self.bins,
            length: cycles.or(rate),
            cycles: self.cycles,
            seed: self.seed,
        }
    }
}
