//! `dtof tune`: the threshold and L1 for a given rate of false alarms.

use std::io::{self, Write};

use anyhow::Result;
use clap::Args;
use dtof::progress::Bar;
use dtof_run::tune::Options;

use super::flags::Flags;

#[derive(Args)]
pub struct Tune {
    #[command(flatten)]
    options: Flags<Options>,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

impl Tune {
    pub fn run(&self) -> Result<()> {
        let tuned = self.options.0.tune(&mut Bar::new(false))?;
        let mut out = io::stdout().lock();
        if self.json {
            let mut found = tuned.json();
            found["options"] = tuned.options().into();
            writeln!(out, "{}", serde_json::to_string_pretty(&found)?)?;
        } else {
            out.write_all(tuned.text().as_bytes())?;
        }
        Ok(out.flush()?)
    }
}
