//! `cargo lab sweep` and `cargo lab merge`: Monte-Carlo trials in parts.

use std::io::{self, Write};
use std::ops::Range;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use dtof::path;
use dtof_data::options::numbers::integer;
use dtof_data::options::rows::grouped;
use dtof_lab::studies;
use dtof_lab::sweep::{self, Part};
use indicatif::{ProgressBar, ProgressStyle};

#[derive(Args)]
pub struct Sweep {
    /// The study to run; lists all studies if omitted
    study: Option<String>,
    /// First seed, and the last plus one
    #[arg(long, value_name = "A..B", value_parser = seeds, requires = "out")]
    seeds: Option<Range<u64>>,
    /// The part: a new file, or one from an earlier run with these seeds
    #[arg(long, value_name = "FILE", requires = "seeds", value_parser = path())]
    out: Option<PathBuf>,
    /// Seconds between saves, for runs that may be interrupted
    #[arg(long, value_name = "S", default_value_t = 10, value_parser = integer(0..=u64::MAX))]
    save_every: u64,
    /// Show no progress
    #[arg(long)]
    quiet: bool,
}

fn seeds(text: &str) -> Result<Range<u64>> {
    let (first, end) = text.split_once("..").context("must be A..B")?;
    let seed = |text: &str| integer(0..=u64::MAX)(text).ok();
    let first = seed(first).context("the first seed is invalid")?;
    let end = seed(end).context("the last seed is invalid")?;
    ensure!(first < end, "the range is empty");
    Ok(first..end)
}

impl Sweep {
    pub fn run(&self) -> Result<()> {
        let Some(name) = &self.study else {
            return list();
        };
        let study = studies::named(name)?;
        let (Some(seeds), Some(out)) = (self.seeds.clone(), &self.out) else {
            bail!("{name}: --seeds A..B and --out FILE are required");
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
    /// Parts of one study with disjoint seeds
    #[arg(required = true, value_name = "PART", value_parser = path())]
    parts: Vec<PathBuf>,
    /// The merged part, a new file
    #[arg(long, value_name = "FILE", value_parser = path())]
    out: PathBuf,
}

impl Merge {
    pub fn run(&self) -> Result<()> {
        ensure!(
            !self.out.exists(),
            "{}: already exists; --out must be a new file",
            self.out.display()
        );
        let part = sweep::merge(&self.parts, studies::named)?;
        part.save(&self.out)?;
        show(&part)
    }
}
