//! `dtof demo`: a simulated scene that shows the use of pixel blocks and of several echoes.

use std::path::PathBuf;

use anyhow::Result;
use clap::Parser;
use dtof::path;
use dtof_data::options::numbers::{MAX_INTEGER, integer};
use dtof_engine::settings::{RunSettings, Settings, SettingsFile};
use dtof_light::demo;
use dtof_run::simulate::{Simulation, array, settings_of_scene};

use super::dynamic_depth::DynamicDepthOptions;
use super::job::{EngineOptions, ResultOptions};
use super::simulate::Job;

#[derive(Parser)]
pub struct Demo {
    /// Folder of the results
    #[arg(long, default_value = "out/demo", value_parser = path())]
    out: PathBuf,
    /// Macropixels of the array [default: 64x32; 8x8 with --device]
    #[arg(long, value_name = "COLUMNSxROWS", value_parser = array)]
    array: Option<[u32; 2]>,
    #[command(flatten)]
    engine: EngineOptions,
    /// Laser cycles to simulate
    #[arg(long, value_name = "N", default_value_t = 4000, value_parser = integer(1..=MAX_INTEGER))]
    cycles: u64,
    /// Seed of the simulated photons
    #[arg(long, default_value_t = 1, value_parser = integer(0..=MAX_INTEGER))]
    seed: u64,
    /// Print nothing but errors
    #[arg(long)]
    quiet: bool,
}

impl Demo {
    pub fn run(&self) -> Result<()> {
        let settings = Settings::demo(self.seed)?;
        let mut scene = demo::scene()?;
        if let Some(size) = self.array {
            scene.size = size;
        } else if self.engine.device.is_some() {
            scene.size = [8, 8];
        }
        let requested = SettingsFile {
            run: RunSettings {
                cycles: Some(self.cycles),
                seed: Some(self.seed),
                ..RunSettings::default()
            },
            ..SettingsFile::default()
        };
        let requested = settings_of_scene(requested, &scene)?;
        let lead = format!(
            "A simulated scene of {}×{} macropixels. Every pixel reports a depth event the moment \
             its peak stands clear of the background, then starts over: that of the bright ball \
             often, that of the wall later. Pixels on the dark curtain are too dim to report soon alone, so they \
             report in blocks. Through the pane of glass a pixel reports two echoes. A ball is thrown \
             across.",
            scene.size[0], scene.size[1]
        );
        let results = ResultOptions {
            out: Some(self.out.clone()),
            dynamic_depth: DynamicDepthOptions::default(),
            echo: None,
            no_csv: false,
            quiet: self.quiet,
        };
        Job {
            simulation: Simulation::new(scene, settings, requested, None)?,
            inputs: [None; 2],
            scene_rows: Vec::new(),
            engine: &self.engine,
            results: &results,
            lead: &lead,
        }
        .run()
    }
}
