//! `dtof simulate`: the photons of a scene file through the engine.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use clap::Args;
use dtof::path;
use dtof::progress::Bar;
use dtof_core::{Array, PixelAddress};
use dtof_device::{Client, DeviceEngine};
use dtof_engine::Engine;
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_engine::settings::SettingsFile;
use dtof_events::echoes::Echo;
use dtof_link::DynamicDepth;
use dtof_options::Refused;
use dtof_options::rows::Row;
use dtof_photons::geometry::FieldOfView;
use dtof_photons::source::PhotonSource;
use dtof_report::Section;
use dtof_run::output::Output;
use dtof_run::simulate::{Options, Simulation};
use dtof_simulate::scene::Scene;

use super::dynamic_depth::Shown;
use super::flags::{Flags, name};
use super::print_summary;
use super::seen::View;

#[derive(Args)]
pub struct Simulate {
    /// The scene, a TOML file; docs/scenes.md lists its keys
    #[arg(long, value_name = "FILE", value_parser = path(), required_unless_present = "depth")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    view: View,
    /// The folder of the results
    #[arg(long, value_name = "DIR", value_parser = path())]
    out: PathBuf,
    #[command(flatten)]
    options: Flags<Options>,
    #[command(flatten)]
    changes: Shown,
    /// The echo of each exposure that maps and report show; the files of events hold all
    /// [default: the strongest in the maps, all in the report]
    #[arg(long, value_parser = name::<Echo>())]
    echo: Option<Echo>,
    /// Decide on a device: tcp:HOST:PORT, a serial port, or `qemu`, which starts an emulated
    /// device [default: this computer]
    #[arg(long, value_name = "DEVICE")]
    device: Option<String>,
    /// Image that `--device qemu` runs [default: what `cargo xtask image mps2-an386` has built]
    #[arg(long, value_name = "FILE", requires = "device")]
    image: Option<PathBuf>,
    /// Do not write events.csv
    #[arg(long)]
    no_csv: bool,
    /// Print nothing but errors
    #[arg(long)]
    quiet: bool,
}

impl Simulate {
    pub fn run(&self) -> Result<()> {
        let said = self.options.0.said()?;
        let simulated = self.simulate(said.clone());
        simulated.map_err(|error| said.blame(error))
    }

    fn simulate(&self, said: SettingsFile) -> Result<()> {
        let scene = self.view.scene(self.scene.as_deref())?;
        let input = self.scene.as_deref().or(self.view.depth.as_deref());
        let name = input.unwrap_or(Path::new("")).display().to_string();
        let simulation = self.options.0.open(scene, &name, said)?;
        let file = self.view.input(self.scene.as_deref());
        let [columns, rows] = simulation.scene.size;
        let laser = if self.options.0.laser_off {
            ", the laser off"
        } else {
            ""
        };
        Results {
            input,
            light: self.view.rows(&simulation.scene),
            file: self.options.0.given.file.as_deref(),
            changes: self.changes.wanted()?,
            echo: self.echo,
            device: self.device.as_deref(),
            image: self.image.as_deref(),
            out: &self.out,
            no_csv: self.no_csv,
            lead: &format!("Simulated photons of {file}, {columns}×{rows} macropixels{laser}."),
            quiet: self.quiet,
        }
        .of(simulation)
    }
}

/// What comes of a scene, and where.
pub struct Results<'a> {
    /// The file the scene comes from, if there is one.
    pub input: Option<&'a Path>,
    /// What is to be said of its light, if it is not in a scene file alone.
    pub light: Vec<Row>,
    /// The settings file.
    pub file: Option<&'a Path>,
    /// Dynamic depth, if the report is to show it.
    pub changes: Option<DynamicDepth>,
    /// The echo that maps and report show.
    pub echo: Option<Echo>,
    pub device: Option<&'a str>,
    /// The image of an emulated device.
    pub image: Option<&'a Path>,
    pub out: &'a Path,
    /// Without `events.csv`.
    pub no_csv: bool,
    /// The first sentence of the report.
    pub lead: &'a str,
    pub quiet: bool,
}

impl Results<'_> {
    pub fn of(self, mut simulation: Simulation) -> Result<()> {
        let Simulation {
            photons, settings, ..
        } = &simulation;
        let mut engine = engine(
            self.device,
            self.image,
            settings,
            photons.array(),
            &photons.addresses(),
        )?;
        let mut output = Output::create(self.out, settings, photons, self.input)?
            .with_settings(simulation.said.with(settings), self.file)?
            .with_changes(self.changes.as_ref())?
            .with_echo(self.echo, settings)
            .without_csv(self.no_csv);
        let progress = &mut Bar::new(self.quiet);
        let ran = simulation.run(engine.as_mut(), &mut output, progress)?;
        let mut summary = ran.summary;
        summary.export_with = export_with(&simulation.scene);
        let mut surfaces = self.light;
        let against_truth = summary.against_truth.iter();
        surfaces.extend(against_truth.flat_map(|truth| truth.rows(summary.settings.reports())));
        let sections = [Section {
            heading: "Surfaces",
            rows: &surfaces,
        }];
        output.finish(&summary, summary.settings.title(), self.lead, &sections)?;
        if !self.quiet {
            print_summary(&summary, &surfaces, self.out)?;
        }
        Ok(())
    }
}

/// The options without which `dtof export` takes the scene for another, if any.
fn export_with(scene: &Scene) -> Option<String> {
    let view = format!("{:.6}", scene.view());
    let is_default = view == format!("{:.6}", FieldOfView::of(scene.size));
    (!is_default).then(|| format!("--fov {view}"))
}

/// The engine of this computer, or that of a device.
fn engine(
    device: Option<&str>,
    image: Option<&Path>,
    settings: &Settings,
    array: Array,
    addresses: &[PixelAddress],
) -> Result<Box<dyn Engine>> {
    let Some(device) = device else {
        return host_engine(settings, array, addresses);
    };
    ensure!(
        settings.frame.is_none(),
        Refused::new("frame", "is not for a device, which reports events")
    );
    let client =
        Client::new(dtof_device::open(device, image)?).with_context(|| device.to_owned())?;
    Ok(Box::new(DeviceEngine::new(
        client, settings, array, addresses,
    )?))
}
