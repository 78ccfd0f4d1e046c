//! `dtof replay`: recorded photons or histograms through the engine.

use anyhow::Result;
use clap::Args;
use dtof::missing;
use dtof::progress::Bar;
use dtof_data::photons::input::Input;
use dtof_data::photons::source::PhotonSource;
use dtof_engine::settings::SettingsFile;
use dtof_run::RunResult;
use dtof_run::recording::warnings;
use dtof_run::replay::Options;
use dtof_run::report::Section;

use super::flags::Flags;
use super::job::{Recorded, ResultOptions};
use super::{FOUND, check_complete, print_summary, say_kept, warn};

#[derive(Args)]
pub struct Replay {
    #[command(flatten)]
    recorded: Recorded,
    #[command(flatten)]
    results: ResultOptions,
    #[command(flatten)]
    options: Flags<Options>,
}

impl Replay {
    pub fn run(&self) -> Result<()> {
        let requested = self.options.0.requested()?;
        self.replay(&requested)
            .map_err(|error| requested.add_file_name(error))
    }

    fn replay(&self, requested: &SettingsFile) -> Result<()> {
        let file = self.recorded.file();
        let file = file.ok_or_else(|| missing("<FILE>", "is needed"))?;
        let inputs = [Some(file), self.options.0.given.file.as_deref()];
        self.results.check(inputs)?;
        let input = Input::from(file);
        let mut replay = self.options.0.open(&input, requested)?;
        let mut output = self.results.output(
            &replay.settings,
            &replay.photons,
            replay.requested.with_settings(&replay.settings),
            inputs,
        )?;
        let quiet = self.results.quiet;
        warn(file, warnings(&replay.metadata), quiet);
        let RunResult { summary, warnings } =
            replay.run(&input, &mut output, &mut Bar::new(quiet))?;
        warn(file, warnings, quiet);
        let lead = format!("Recorded photons of {input}.");
        let found = Section {
            heading: FOUND,
            rows: &summary.found,
        };
        let sections = match summary.found.is_empty() {
            true => &[][..],
            false => &[found],
        };
        let kept = output.finish(&summary, replay.settings.title(), &lead, sections)?;
        say_kept(kept.as_deref(), quiet)?;
        let folder = self.results.folder(Some(file));
        if !quiet {
            print_summary(&summary, &[], &folder)?;
        }
        check_complete(&summary, replay.photons.cycles(), &folder)
    }
}
