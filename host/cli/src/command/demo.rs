//! `dtof demo`: a simulated scene that shows what blocks of pixels and several echoes are for.

use std::path::PathBuf;

use anyhow::Result;
use clap::Parser;
use dtof::path;
use dtof_engine::settings::Run;
use dtof_options::numbers::{MOST_WHOLE, whole};
use dtof_run::simulate::{Simulation, array, of_scene};
use dtof_simulate::demo;

use super::simulate::Results;

#[derive(Parser)]
pub struct Demo {
    /// The folder of the results
    #[arg(long, default_value = "out/demo", value_parser = path())]
    out: PathBuf,
    /// Macropixels of the array [default: 64x32; 8x8 with --device]
    #[arg(long, value_name = "COLUMNSxROWS", value_parser = array)]
    array: Option<[u32; 2]>,
    /// Decide on a device: tcp:HOST:PORT, a serial port, or `qemu`, which starts an emulated
    /// device [default: this computer]
    #[arg(long, value_name = "DEVICE")]
    device: Option<String>,
    /// Image that `--device qemu` runs [default: what `cargo xtask image mps2-an386` has built]
    #[arg(long, value_name = "FILE", requires = "device")]
    image: Option<PathBuf>,
    /// Laser cycles of the scene
    #[arg(long, value_name = "N", default_value_t = 4000, value_parser = whole(1..=MOST_WHOLE))]
    cycles: u64,
    /// Seed of the simulated photons.
    #[arg(long, default_value_t = 1, value_parser = whole(0..=MOST_WHOLE))]
    seed: u64,
    /// Print nothing but errors.
    #[arg(long)]
    quiet: bool,
}

impl Demo {
    pub fn run(&self) -> Result<()> {
        let settings = demo::settings(self.seed)?;
        let mut scene = demo::scene()?;
        if let Some(size) = self.array {
            scene.size = size;
        } else if self.device.is_some() {
            scene.size = [8, 8];
        }
        let said = Run {
            cycles: Some(self.cycles),
            seed: Some(self.seed),
            ..Run::default()
        };
        let said = of_scene(said.into(), &scene)?;
        let lead = format!(
            "A simulated scene of {}×{} macropixels. Every pixel reports a depth event the moment \
             its peak stands clear of the background, then starts over: that of the bright ball \
             often, that of the wall later. Pixels on the dark curtain are too dim to report soon alone, so they \
             report in blocks. Through the pane of glass a pixel reports two echoes. A ball is thrown \
             across.",
            scene.size[0], scene.size[1]
        );
        let simulation = Simulation::new(scene, settings, said, None)?;
        Results {
            input: None,
            light: Vec::new(),
            file: None,
            changes: None,
            echo: None,
            device: self.device.as_deref(),
            image: self.image.as_deref(),
            no_csv: false,
            out: &self.out,
            lead: &lead,
            quiet: self.quiet,
        }
        .of(simulation)
    }
}
