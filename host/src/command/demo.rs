//! `dtof demo`: a simulated static scene at the paper's settings (section
//! III-B).

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use dtof::device::{self, Client, DeviceEngine};
use dtof::engine::{Engine, host_engine};
use dtof::output::Output;
use dtof::report::Section;
use dtof::run::run;
use dtof::scene;
use dtof::settings::Settings;
use dtof::source::{Geometry, PhotonSource};
use dtof_core::PixelAddress;

use super::print_summary;

#[derive(Args)]
pub struct Demo {
    /// Where the results go.
    #[arg(long, default_value = Demo::OUT)]
    out: PathBuf,
    /// Macropixels of the array [default: 64x32; 8x8 with --device]
    #[arg(long, value_name = "COLUMNSxROWS", value_parser = array)]
    array: Option<Geometry>,
    /// Decide on a device, not on this computer: `qemu` starts an emulated one, else
    /// tcp:HOST:PORT or a serial port
    #[arg(long, value_name = "DEVICE")]
    device: Option<String>,
    /// Laser cycles of the scene
    #[arg(long, value_name = "N", default_value_t = Demo::CYCLES, value_parser = clap::value_parser!(u64).range(1..))]
    cycles: u64,
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
            array: None,
            device: None,
            cycles: Self::CYCLES,
            seed: Self::SEED,
            quiet: false,
        }
    }
}

impl Demo {
    const OUT: &str = "out/demo";
    const SEED: u64 = 1;
    const CYCLES: u64 = 10_000;

    pub fn run(&self) -> Result<()> {
        let settings = scene::settings(self.seed);
        let (columns, rows) = if self.device.is_some() {
            (8, 8)
        } else {
            (64, 32)
        };
        let geometry = self.array.unwrap_or(Geometry { columns, rows });
        let mut photons = scene::photons(geometry, &settings, self.cycles)?;
        let mut engine = engine(self.device.as_deref(), &settings, &photons.addresses())?;
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
        let lead = format!(
            "A simulated static scene of {}×{} macropixels: a wall, before it a matt box, before \
             that a bright ball. Every pixel reports a depth event the moment its peak stands \
             clear of the background, then starts over.",
            geometry.columns, geometry.rows
        );
        output.finish(&summary, "Asynchronous depth events", &lead, &sections)?;
        if !self.quiet {
            print_summary(&[summary.rows(), surfaces].concat(), &self.out)?;
        }
        Ok(())
    }
}

/// The engine of this computer, or that of a device.
fn engine(
    device: Option<&str>,
    settings: &Settings,
    addresses: &[PixelAddress],
) -> Result<Box<dyn Engine>> {
    let Some(device) = device else {
        return host_engine(settings, addresses);
    };
    let client = Client::new(device::open(device)?).with_context(|| device.to_owned())?;
    Ok(Box::new(DeviceEngine::new(client, settings, addresses)?))
}

fn array(text: &str) -> Result<Geometry, String> {
    let sides = text.split_once('x').and_then(|(columns, rows)| {
        let sides = (columns.parse::<u16>().ok()?, rows.parse::<u16>().ok()?);
        (sides.0 > 0 && sides.1 > 0).then_some(sides)
    });
    let (columns, rows) = sides.ok_or("must be COLUMNSxROWS, as 64x32")?;
    Ok(Geometry {
        columns: columns.into(),
        rows: rows.into(),
    })
}
