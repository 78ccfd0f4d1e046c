//! `dtof simulate`: the photons of a scene file through the engine.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use dtof::path;
use dtof::progress::Bar;
use dtof_data::options::rows::Row;
use dtof_data::photons::geometry::FieldOfView;
use dtof_data::photons::source::PhotonSource;
use dtof_engine::settings::SettingsFile;
use dtof_light::scene::Scene;
use dtof_run::report::Section;
use dtof_run::simulate::{Options, Simulation};

use super::flags::Flags;
use super::job::{EngineOptions, Inputs, ResultOptions};
use super::scene_options::SceneOptions;
use super::{check_complete, print_summary, say_kept, warn};

#[derive(Args)]
pub struct Simulate {
    /// Scene, a TOML file; docs/scenes.md lists its keys
    #[arg(long, value_name = "FILE", value_parser = path(), required_unless_present = "depth")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    scene_options: SceneOptions,
    #[command(flatten)]
    results: ResultOptions,
    #[command(flatten)]
    options: Flags<Options>,
    #[command(flatten)]
    engine: EngineOptions,
}

impl Simulate {
    pub fn run(&self) -> Result<()> {
        let requested = self.options.0.requested()?;
        let simulated = self.simulate(requested.clone());
        simulated.map_err(|error| requested.add_file_name(error))
    }

    fn simulate(&self, requested: SettingsFile) -> Result<()> {
        let input = self
            .scene
            .as_deref()
            .or(self.scene_options.depth.as_deref());
        let inputs = [input, self.options.0.given.file.as_deref()];
        self.results.check(inputs)?;
        let scene = self.scene_options.scene(self.scene.as_deref())?;
        let name = input.unwrap_or(Path::new("")).display().to_string();
        let simulation = self.options.0.open(scene, &name, requested)?;
        let files = self.scene_options.files(self.scene.as_deref());
        let [columns, rows] = simulation.scene.size;
        let laser = if self.options.0.laser_off {
            ", the laser off"
        } else {
            ""
        };
        Job {
            inputs,
            scene_rows: self.scene_options.rows(&simulation.scene),
            engine: &self.engine,
            results: &self.results,
            lead: &format!("Simulated photons of {files}, {columns}×{rows} macropixels{laser}."),
            simulation,
        }
        .run()
    }
}

/// A simulation and how its results are written.
pub struct Job<'a> {
    pub simulation: Simulation,
    pub inputs: Inputs<'a>,
    /// Rows of the report on options of the scene.
    pub scene_rows: Vec<Row>,
    pub engine: &'a EngineOptions,
    pub results: &'a ResultOptions,
    /// The first sentence of the report.
    pub lead: &'a str,
}

impl Job<'_> {
    pub fn run(mut self) -> Result<()> {
        let simulation = &mut self.simulation;
        if self.engine.device.is_some() {
            simulation.map = None;
        }
        let (photons, settings) = (&simulation.photons, &simulation.settings);
        let mut engine = self.engine.engine(settings, photons)?;
        let effective = simulation.requested.with_settings(settings);
        let mut output = self
            .results
            .output(settings, photons, effective, self.inputs)?;
        let progress = &mut Bar::new(self.results.quiet);
        let ran = simulation.run(engine.as_mut(), &mut output, progress)?;
        warn(self.inputs[0], ran.warnings, self.results.quiet);
        let mut summary = ran.summary;
        summary.export_with = export_with(&simulation.scene);
        let mut rows = self.scene_rows;
        let against_truth = summary.against_truth.iter();
        rows.extend(against_truth.flat_map(|truth| truth.rows(summary.settings.reports())));
        let sections = [Section {
            heading: "Surfaces",
            rows: &rows,
        }];
        let kept = output.finish(&summary, summary.settings.title(), self.lead, &sections)?;
        say_kept(kept.as_deref(), self.results.quiet)?;
        let folder = self.results.folder(self.inputs[0]);
        if !self.results.quiet {
            print_summary(&summary, &rows, &folder)?;
        }
        check_complete(&summary, simulation.photons.cycles(), &folder)
    }
}

/// The field of view as an option of `dtof export`, unless it is the default.
fn export_with(scene: &Scene) -> Option<String> {
    let view = format!("{:.6}", scene.effective_field_of_view());
    let is_default = view == format!("{:.6}", FieldOfView::default_for(scene.size));
    (!is_default).then(|| format!("--fov {view}"))
}
