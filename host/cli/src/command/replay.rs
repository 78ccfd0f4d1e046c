//! `dtof replay`: recorded photons or histograms through the engine.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use dtof::path;
use dtof::progress::Bar;
use dtof_engine::settings::SettingsFile;
use dtof_events::echoes::Echo;
use dtof_photons::medium::Medium;
use dtof_run::Ran;
use dtof_run::output::Output;
use dtof_run::recording::warnings;
use dtof_run::replay::Options;

use super::dynamic_depth::Shown;
use super::flags::{Flags, name};
use super::{print_summary, warn};

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
    options: Flags<Options>,
    #[command(flatten)]
    changes: Shown,
    /// The echo of each exposure that maps and report show; the files of events hold all
    /// [default: the strongest in the maps, all in the report]
    #[arg(long, value_parser = name::<Echo>())]
    echo: Option<Echo>,
    /// Do not write events.csv
    #[arg(long)]
    no_csv: bool,
    /// Print nothing but errors
    #[arg(long)]
    quiet: bool,
}

impl Replay {
    pub fn run(&self) -> Result<()> {
        let said = self.options.0.said()?;
        self.replay(&said).map_err(|error| said.blame(error))
    }

    fn replay(&self, said: &SettingsFile) -> Result<()> {
        let changes = self.changes.wanted()?;
        let input = Medium::from(&self.input);
        let mut replay = self.options.0.open(&input, said)?;
        let settings = &replay.settings;
        let file = self.options.0.given.file.as_deref();
        let mut output = Output::create(&self.out, settings, &replay.photons, Some(&self.input))?
            .with_settings(replay.said.with(settings), file)?
            .with_changes(changes.as_ref())?
            .with_echo(self.echo, settings)
            .without_csv(self.no_csv);
        warn(&self.input, warnings(&replay.known), self.quiet);
        let Ran { summary, .. } = replay.run(&input, &mut output, &mut Bar::new(self.quiet))?;
        let lead = format!("Recorded photons of {input}.");
        output.finish(&summary, replay.settings.title(), &lead, &[])?;
        if !self.quiet {
            print_summary(&summary, &[], &self.out)?;
        }
        Ok(())
    }
}
