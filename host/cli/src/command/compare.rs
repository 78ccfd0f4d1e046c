//! `dtof compare`: all methods on the same photons, the best that keeps every pixel, and the fastest.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use dtof::path;
use dtof::progress::Steps;
use dtof_data::options::rows::aligned;
use dtof_data::photons::input::Input;
use dtof_light::scene::Scene;
use dtof_run::compare::job::{Callbacks, CompareInput, CompareResult, Options};
use dtof_run::compare::page::{self, FILES};

use super::flags::Flags;
use super::job::Recorded;
use super::warn;

#[derive(Args)]
pub struct Compare {
    #[command(flatten)]
    recorded: Recorded,
    /// Scene instead of a recording, a TOML file; docs/scenes.md lists its keys
    #[arg(long, value_name = "FILE", value_parser = path(), conflicts_with_all = ["file", "input"])]
    scene: Option<PathBuf>,
    /// True range of each pixel in millimetres, an .npy array with a number a pixel; 0 for unknown
    /// [default: the file's, if it has one]
    #[arg(long, value_name = "FILE", value_parser = path(), conflicts_with = "scene")]
    truth: Option<PathBuf>,
    /// Folder of the results
    #[arg(long, value_name = "DIR", value_parser = path())]
    out: PathBuf,
    #[command(flatten)]
    options: Flags<Options>,
    /// Print nothing but errors
    #[arg(long)]
    quiet: bool,
}

impl Compare {
    pub fn run(&self) -> Result<()> {
        let name = self.recorded.file().or(self.scene.as_deref());
        let name = name.ok_or_else(|| dtof::missing("input", "is needed, or `scene`"))?;
        let requested = self.options.0.requested(self.scene.is_some())?;
        let input = match &self.scene {
            Some(file) => {
                CompareInput::Scene(Box::new(Scene::read(file)?), file.display().to_string())
            }
            None => CompareInput::Recording(name.into(), self.truth.as_deref().map(Input::from)),
        };
        let is_new = !self.out.exists();
        page::prepare(&self.out, &self.inputs())?;
        let steps = Steps::new(self.quiet);
        let compared = self.options.0.compare(
            input,
            &requested,
            &Callbacks {
                warning: &|warning| steps.suspend(|| warn(name, [warning], self.quiet)),
                step: &|step, share| {
                    steps.at(step, share);
                    Ok(())
                },
            },
        );
        steps.finish();
        if compared.is_err() && is_new {
            // Nothing is in it. If it cannot be removed, it stays.
            let _ = fs::remove_dir(&self.out);
        }
        let CompareResult {
            comparison,
            settings,
            fastest,
        } = compared?;
        page::write(
            &comparison,
            &self.out,
            name,
            [settings.as_ref(), fastest.as_ref()],
            &self.inputs(),
        )?;
        if !self.quiet {
            let mut out = io::stdout().lock();
            let report = self.out.join("report.html");
            write!(out, "{}", aligned(&comparison.rows()))?;
            write!(out, "\n{}", comparison.stress_text())?;
            if settings.is_some() || fastest.is_some() {
                writeln!(out)?;
            }
            let whose = ["the method to take", "the fastest"];
            for ((settings, (file, _)), whose) in [settings, fastest].iter().zip(FILES).zip(whose) {
                if settings.is_some() {
                    let file = self.out.join(file);
                    writeln!(out, "{} has the settings of {whose}.", file.display())?;
                }
            }
            writeln!(out, "Open {} in a browser.", report.display())?;
            out.flush()?;
        }
        Ok(())
    }

    /// The input files.
    fn inputs(&self) -> Vec<&Path> {
        let files = [&self.scene, &self.truth, &self.options.0.given.file];
        let files = files.into_iter().map(Option::as_deref);
        files.chain([self.recorded.file()]).flatten().collect()
    }
}
