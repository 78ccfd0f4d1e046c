//! `dtof replay`: recorded photons or histograms through the engine.

use std::path::PathBuf;

use anyhow::{Result, ensure};
use clap::Args;
use dtof::cli::arguments::{MOST_WHOLE, path, whole};
use dtof::engine::host::host_engine;
use dtof::engine::run::run;
use dtof::events::echoes::Echo;
use dtof::events::output::Output;
use dtof::input::masked::Masked;
use dtof::input::open::open;
use dtof::input::source::{PhotonSource, has_only_neighbours};
use dtof::settings::{Run, SettingsFile};

use super::dynamic_depth::Shown;
use super::operation::{Frames, Operation};
use super::recording::{Recording, of_file, opening, warn};
use super::{print_summary, watch_glass};

#[derive(Args)]
pub struct Replay {
    /// Histograms (.npy, .npz, or the log of a TMF8820 or TMF8829, .json or .json.gz), or photons
    /// (.csv with the header pixel,cycle,bin, or .npy with these fields)
    #[arg(long, value_name = "FILE", value_parser = path())]
    input: PathBuf,
    /// The folder of the results
    #[arg(long, value_name = "DIR", value_parser = path())]
    out: PathBuf,
    #[command(flatten)]
    recording: Recording,
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
    /// Replay only the first N laser cycles [default: 10000]
    #[arg(long, value_name = "N", value_parser = whole(1..=MOST_WHOLE))]
    cycles: Option<u64>,
    /// Seed of the laser cycles that recorded photons are given [default: 1]
    #[arg(long, value_name = "N", value_parser = whole(0..=MOST_WHOLE))]
    seed: Option<u64>,
    /// Do not write events.csv
    #[arg(long)]
    no_csv: bool,
    /// Print nothing but errors
    #[arg(long)]
    quiet: bool,
}

impl Replay {
    pub fn run(&self) -> Result<()> {
        let options = Run {
            cycles: self.cycles,
            seed: self.seed,
            frame: self.frames.frame,
            ..Run::default()
        };
        let said = self
            .recording
            .said(|recording| self.operation.said(recording.or(options.into())))?;
        self.replay(&said).map_err(|error| said.name_origin(error))
    }

    fn replay(&self, said: &SettingsFile) -> Result<()> {
        let changes = self.changes.wanted()?;
        let recording = open(&self.input, &opening(said))?;
        let (photons, known) = (recording.photons, recording.known);
        self.recording.suits(&self.input, &known)?;
        let said = said.clone().or(of_file(&known, photons.geometry()));
        let settings = said.settings(known.bins)?;
        ensure!(
            known.has_shape || settings.binning.is_none(),
            "{}: --binning needs to know the array: say --columns",
            self.input.display()
        );
        if let Some(binning) = settings.binning {
            let ([column, row], side) = (photons.sides(), 1 << binning.levels.raw());
            ensure!(
                has_only_neighbours(photons.as_ref(), binning.levels),
                "{}: --binning {}: blocks of {side}x{side} pixels would reach across captures; \
                 a {column} and a {row} are no neighbours there",
                self.input.display(),
                binning.levels.raw()
            );
        }
        let photons = Masked::new(photons, &settings.masked)?;
        let mut photons = photons.with_laser_hz(said.sensor.laser_hz);
        let mut engine = host_engine(&settings, photons.geometry(), &photons.addresses())?;
        let mut output = Output::create(&self.out, &settings, &photons, Some(&self.input))?
            .with_settings(
                said.with(&settings),
                self.operation.known.settings.as_deref(),
            )?
            .with_changes(changes.as_ref())?
            .with_echo(self.echo, &settings)
            .without_csv(self.no_csv);
        warn(&self.input, &known, self.quiet);
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
        watch_glass(&said, &output, &mut summary);
        summary.cut_off = known.cut_off;
        summary.recording = known.rows;
        summary.warnings = known.warnings;
        output.finish(&summary, settings.title(), &lead, &[])?;
        if !self.quiet {
            print_summary(&summary, &[], &self.out)?;
        }
        Ok(())
    }
}
