//! `cargo lab sweep` and `cargo lab merge`: Monte-Carlo trials in parts.

use std::io::{self, Write};
use std::ops::Range;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use dtof::path;
use dtof_lab::studies;
use dtof_lab::sweep::{self, Part};
use dtof_options::numbers::whole;
use dtof_options::rows::grouped;
use indicatif::{ProgressBar, ProgressStyle};

#[derive(Args)]
pub struct Sweep {
    /// What is swept; without it, a list
    study: Option<String>,
    /// First seed, and one past the last
    #[arg(long, value_name = "A..B", value_parser = seeds, requires = "out")]
    seeds: Option<Range<u64>>,
    /// The part: a new file, or one that an earlier run with the same seeds left
    #[arg(long, value_name = "FILE", requires = "seeds", value_parser = path())]
    out: Option<PathBuf>,
    /// Save the part after so many seconds, for a run that is ended early
    #[arg(long, value_name = "S", default_value_t = 10, value_parser = whole(0..=u64::MAX))]
    save_every: u64,
    /// Show no progress
    #[arg(long)]
    quiet: bool,
}

fn seeds(text: &str) -> Result<Range<u64>> {
    let (first, end) = text.split_once("..").context("not A..B")?;
    let seed = |text: &str| whole(0..=u64::MAX)(text).ok();
    let first = seed(first).context("the first is no seed")?;
    let end = seed(end).context("the last is no seed")?;
    ensure!(first < end, "no seed lies between them");
    Ok(first..end)
}

impl Sweep {
    pub fn run(&self) -> Result<()> {
        let Some(name) = &self.study else {
            return list();
        };
        let study = studies::named(name)?;
        let (Some(seeds), Some(out)) = (self.seeds.clone(), &self.out) else {
            bail!("{name}: --seeds A..B and --out FILE say what to do");
        };
        let bar = if self.quiet {
            ProgressBar::hidden()
        } else {
            // Hidden where standard error is not a terminal.
            ProgressBar::new(seeds.end - seeds.start)
        };
        bar.set_style(ProgressStyle::with_template(
            "{bar:40} {human_pos} of {human_len} seeds, {eta} left",
        )?);
        let save_every = Duration::from_secs(self.save_every);
        let part = sweep::run(study, seeds, out, save_every, |done| bar.set_position(done))?;
        bar.finish_and_clear();
        show(&part)
    }
}

fn list() -> Result<()> {
    let mut lines = io::stdout().lock();
    for study in studies::ALL {
        let points = (study.points)().len();
        writeln!(
            lines,
            "{:<24} {} ({points} points; {} seeds for a quick look, {} for the figures)",
            study.name,
            study.about,
            grouped(study.few_seeds),
            grouped(study.all_seeds)
        )?;
    }
    Ok(())
}

fn show(part: &Part) -> Result<()> {
    let seeds: Vec<String> = part
        .seeds()
        .iter()
        .map(|(first, end)| format!("{first}..{end}"))
        .collect();
    writeln!(
        io::stdout(),
        "{}: {} points, seeds {}",
        part.study(),
        part.points().len(),
        seeds.join(", ")
    )?;
    Ok(())
}

#[derive(Args)]
pub struct Merge {
    /// Parts of one study without a seed in common
    #[arg(required = true, value_name = "PART", value_parser = path())]
    parts: Vec<PathBuf>,
    /// The part that holds all of them, a new file
    #[arg(long, value_name = "FILE", value_parser = path())]
    out: PathBuf,
}

impl Merge {
    pub fn run(&self) -> Result<()> {
        ensure!(
            !self.out.exists(),
            "{}: is there already; --out is a new file",
            self.out.display()
        );
        let part = sweep::merge(&self.parts, studies::named)?;
        part.save(&self.out)?;
        show(&part)
    }
}
