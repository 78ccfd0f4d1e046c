//! `dtof false-event-table`: simulates the table that `dtof tune` interpolates.

use std::io::{self, Write};

use anyhow::Result;
use clap::Args;
use dtof::theory::table;

#[derive(Args)]
pub struct FalseEventTable {
    /// Seed of the simulated photons
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Trials of 500 exposures a point
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u16).range(1..=700))]
    trials: u16,
}

impl FalseEventTable {
    pub fn run(&self) -> Result<()> {
        let table = table::generate(self.seed, self.trials)?;
        let mut out = io::stdout().lock();
        out.write_all(table.as_bytes())?;
        Ok(out.flush()?)
    }
}
