//! `cargo lab figures`: the figures and verdicts of the documentation.

use anyhow::{Result, bail};
use clap::Args;
use dtof::path;
use dtof_lab::pages::{self, Anew};
use std::io::{self, Write};
use std::path::PathBuf;

#[derive(Args)]
pub struct Figures {
    /// The folder of the documentation
    #[arg(long, value_name = "DIR", default_value = "docs", value_parser = path())]
    docs: PathBuf,
    /// Work out all seeds, not only those of a quick look
    #[arg(long)]
    all: bool,
    /// Draw again from what is kept; work out no seed
    #[arg(long, conflicts_with = "all")]
    kept: bool,
    /// Change nothing; fail if something would change
    #[arg(long)]
    check: bool,
}

impl Figures {
    pub fn run(&self) -> Result<()> {
        let anew = match (self.all, self.kept) {
            (true, _) => Anew::All,
            (_, true) => Anew::None,
            _ => Anew::Few,
        };
        let documents = pages::documents(&self.docs, anew, |study| {
            // Nobody may be reading it.
            let _ = writeln!(io::stderr(), "{}", study.name);
        })?;
        let changed = if self.check {
            pages::different(&self.docs, &documents)
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
