//! `dtof compare`: which method for these photons.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use dtof::path;
use dtof::progress::Steps;
use dtof_compare::page::{self, FILES};
use dtof_options::Refused;
use dtof_options::rows::aligned;
use dtof_photons::medium::Medium;
use dtof_run::compare::{Compared, Input, Options, Told};
use dtof_simulate::scene::Scene;

use super::flags::Flags;
use super::warn;

#[derive(Args)]
pub struct Compare {
    /// A recording, of any format that `replay` reads
    #[arg(long, value_name = "FILE", value_parser = path(), required_unless_present = "scene")]
    input: Option<PathBuf>,
    /// A scene instead, a TOML file; docs/scenes.md lists its keys
    #[arg(long, value_name = "FILE", value_parser = path(), conflicts_with = "input")]
    scene: Option<PathBuf>,
    /// The true range of each pixel in millimetres, an .npy array with as many numbers; 0 is
    /// none [default: that of the file, if it has one]
    #[arg(long, value_name = "FILE", value_parser = path(), conflicts_with = "scene")]
    truth: Option<PathBuf>,
    /// The folder of the results
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
        let name = self.input.as_deref().or(self.scene.as_deref());
        let name = name.ok_or_else(|| Refused::new("input", "is needed, or `scene`"))?;
        page::may_write(&self.out, &self.inputs())?;
        let said = self.options.0.said(self.scene.is_some())?;
        let input = match &self.scene {
            Some(file) => Input::Scene(Box::new(Scene::read(file)?), file.display().to_string()),
            None => Input::Recording(name.into(), self.truth.as_deref().map(Medium::from)),
        };
        let steps = Steps::new(self.quiet);
        let compared = self.options.0.compare(
            input,
            &said,
            &Told {
                warning: &|warning| warn(name, [warning], self.quiet),
                step: &|step| {
                    steps.at(step);
                    Ok(())
                },
            },
        );
        steps.finish();
        let Compared {
            comparison: compared,
            settings: taken,
        } = compared?;
        page::write(&compared, &self.out, name, taken.as_ref(), &self.inputs())?;
        if !self.quiet {
            let mut out = io::stdout().lock();
            let report = self.out.join("report.html");
            write!(out, "{}", aligned(&compared.rows()))?;
            if taken.is_some() {
                writeln!(
                    out,
                    "\n{} has these settings.",
                    self.out.join(FILES[0].0).display()
                )?;
            }
            writeln!(out, "Open {} in a browser.", report.display())?;
            out.flush()?;
        }
        Ok(())
    }

    /// The files that are read.
    fn inputs(&self) -> Vec<&Path> {
        let files = [
            &self.input,
            &self.scene,
            &self.truth,
            &self.options.0.given.file,
        ];
        files.into_iter().flatten().map(PathBuf::as_path).collect()
    }
}
