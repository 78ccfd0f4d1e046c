//! `cargo lab figures`: the figures and verdicts of the documentation.

use anyhow::{Result, bail};
use clap::Args;
use dtof::path;
use dtof_lab::pages::{self, Rerun};
use std::io::{self, Write};
use std::path::PathBuf;

#[derive(Args)]
pub struct Figures {
    /// The folder of the documentation
    #[arg(long, value_name = "DIR", default_value = "docs", value_parser = path())]
    docs: PathBuf,
    /// Run all seeds, not only those of a quick look
    #[arg(long)]
    all: bool,
    /// Draw again from the stored data, without new trials
    #[arg(long, conflicts_with = "all")]
    kept: bool,
    /// Change nothing; fail if a document would change
    #[arg(long)]
    check: bool,
}

impl Figures {
    pub fn run(&self) -> Result<()> {
        let rerun = match (self.all, self.kept) {
            (true, _) => Rerun::All,
            (_, true) => Rerun::None,
            _ => Rerun::Quick,
        };
        let documents = pages::documents(&self.docs, rerun, |study| {
            // Progress is optional: standard error may be closed.
            let _ = writeln!(io::stderr(), "{}", study.name);
        })?;
        let changed = if self.check {
            pages::outdated(&self.docs, &documents)
        } else {
            pages::write(&self.docs, &documents)?
        };
        let names: Vec<String> = changed
            .iter()
            .map(|path| path.display().to_string())
            .collect();
        match (self.check, &names[..]) {
            (_, []) => writeln!(io::stdout(), "{} documents: current", documents.len())?,
            (false, names) => writeln!(io::stdout(), "changed: {}", names.join(", "))?,
            (true, names) => bail!("not current: {}", names.join(", ")),
        }
        Ok(())
    }
}
