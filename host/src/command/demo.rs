//! `dtof demo`: a simulated static scene at the paper's settings (section
//! III-B).

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use dtof::engine::host_engine;
use dtof::output::Output;
use dtof::report::Section;
use dtof::run::run;
use dtof::scene;
use dtof::settings::{I24F8Number, Settings, U8F8Number, U16F16Number};
use dtof::source::PhotonSource;
use dtof_core::fixed::types::{I24F8, U8F8, U16F16};

use super::print_summary;

const CYCLES: u64 = 10_000;

#[derive(Args)]
pub struct Demo {
    /// Where the results go.
    #[arg(long, default_value = Demo::OUT)]
    out: PathBuf,
    /// Seed of the simulated photons.
    #[arg(long, default_value_t = Demo::SEED)]
    seed: u64,
    /// Print nothing but errors.
    #[arg(long)]
    quiet: bool,
}

impl Default for Demo {
    fn default() -> Self {
        Self {
            out: Self::OUT.into(),
            seed: Self::SEED,
            quiet: false,
        }
    }
}

impl Demo {
    const OUT: &str = "out/demo";
    const SEED: u64 = 1;

    pub fn run(&self) -> Result<()> {
        let settings = Settings {
            bins: 128,
            bin_width_ps: U16F16Number(U16F16::lit("250")),
            offset_mm: I24F8Number(I24F8::ZERO),
            gate: None,
            alpha: U8F8Number(U8F8::lit("8")),
            min_count: 5,
            l1: 100,
            l2: 2000,
            x: 10,
            seed: self.seed,
        };
        let mut photons = scene::photons(&settings, CYCLES)?;
        let mut engine = host_engine(&settings, &photons.addresses())?;
        let mut output = Output::create(&self.out, &settings, photons.geometry())?;
        let summary = run(
            &mut photons,
            engine.as_mut(),
            &mut output,
            &settings,
            self.quiet,
        )?;

        let surfaces = scene::against_truth(output.maps(), &settings);
        let sections = [Section {
            heading: "Surfaces",
            rows: &surfaces,
        }];
        let lead = "A simulated static scene of 64×32 macropixels: a wall, before it a matt box, \
                    before that a bright ball. Every pixel reports a depth event the moment its \
                    peak stands clear of the background, then starts over.";
        output.finish(&summary, "Asynchronous depth events", lead, &sections)?;
        if !self.quiet {
            print_summary(&[summary.rows(), surfaces].concat(), &self.out)?;
        }
        Ok(())
    }
}
