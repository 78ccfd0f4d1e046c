//! Photons through the engine, into memory.

use std::path::PathBuf;

use anyhow::{Context, Result};
use dtof_core::DepthEvent;
use dtof_data::options::rows::grouped;
use dtof_data::photons::input::Input;
use dtof_data::photons::ranges::Ranges;
use dtof_data::photons::source::{PhotonSource, Slice};
use dtof_engine::Engine;
use dtof_engine::host::host_engine;
use dtof_engine::settings::{Settings, SettingsFile};
use dtof_light::scene::Scene;
use dtof_run::depth_map::DepthMap;
use dtof_run::output::header;
use dtof_run::recording::warnings;
use dtof_run::replay::Options;
use dtof_run::simulate::Options as SimulateOptions;
use dtof_run::{RunResult, Sink};
use pyo3::prelude::*;
use pyo3::types::PyByteArray;

use crate::error::{Keywords, checked, options_over};
use crate::events::{Array, RECORD, push};
use crate::input::PyInput;
use crate::work::{Control, work};

/// The result of a run, as Python gets it.
#[derive(IntoPyObject)]
pub struct PyRunResult<'py> {
    /// Records of `dtof.EVENT`.
    events: Bound<'py, PyByteArray>,
    /// The content of `summary.json`.
    summary: String,
    /// The content of `dtof.toml`, and the same as JSON.
    toml: String,
    settings: String,
    array: Array,
    warnings: Vec<String>,
    /// The depth of each pixel, decided on all photons, in millimetres, and how clear its peak stands.
    depth: Option<Vec<f64>>,
    confidence: Option<Vec<f64>>,
}

/// The same before the conversion.
struct Finished {
    records: Records,
    result: RunResult,
    requested: SettingsFile,
    warnings: Vec<String>,
}

/// Checks the options of a replay.
#[pyfunction]
pub fn check_options(keywords: Keywords) -> PyResult<()> {
    options_over::<Options>(keywords).map(drop)
}

/// Replays a recording, a file or an array.
#[pyfunction]
pub fn replay<'py>(
    py: Python<'py>,
    input: PyInput,
    keywords: Keywords,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<PyRunResult<'py>> {
    let options: Options = options_over(keywords)?;
    let input = Input::from(input);
    let finished = work(py, progress, move |control| {
        let requested = options.requested()?;
        run_replay(&options, &input, &requested, control)
            .map_err(|error| requested.add_file_name(error))
    })?;
    finished.into_python(py)
}

fn run_replay(
    options: &Options,
    input: &Input,
    requested: &SettingsFile,
    control: &Control,
) -> Result<Finished> {
    let mut replay = options.open(input, requested)?;
    let mut records = Records::of(&replay.settings, &replay.photons)?;
    let result = replay.run(input, &mut records, &mut { control })?;
    let of_run = result.warnings.clone();
    let is_default = requested.run.cycles.is_none();
    let left_out = is_default.then(|| not_replayed(&result)).flatten();
    Ok(Finished {
        records,
        result,
        requested: replay.requested.with_settings(&replay.settings),
        warnings: warnings(&replay.metadata)
            .chain(of_run)
            .chain(left_out)
            .collect(),
    })
}

/// A warning about photons after the laser cycles that are replayed by default.
fn not_replayed(result: &RunResult) -> Option<String> {
    let summary = &result.summary;
    let all = summary.photons + summary.masked + summary.not_replayed;
    (summary.not_replayed > 0).then(|| {
        format!(
            "{} of {} recorded photons were left out: --cycles N takes more",
            grouped(summary.not_replayed),
            grouped(all)
        )
    })
}

/// Simulates a scene: the name of a file, or the text of one.
#[pyfunction]
pub fn simulate<'py>(
    py: Python<'py>,
    scene: SceneInput,
    keywords: Keywords,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<PyRunResult<'py>> {
    let options: SimulateOptions = options_over(keywords)?;
    let finished = work(py, progress, move |control| {
        let requested = options.requested()?;
        let finished = run_simulation(&options, &scene, requested.clone(), control);
        finished.map_err(|error| requested.add_file_name(error))
    })?;
    finished.into_python(py)
}

fn run_simulation(
    options: &SimulateOptions,
    scene: &SceneInput,
    requested: SettingsFile,
    control: &Control,
) -> Result<Finished> {
    let mut simulation = options.open(scene.read()?, &scene.name(), requested)?;
    let (photons, settings) = (&simulation.photons, &simulation.settings);
    let mut engine = host_engine(settings, photons.array(), &photons.addresses())?;
    let mut records = Records::of(settings, photons)?;
    let result = simulation.run(engine.as_mut(), &mut records, &mut { control })?;
    Ok(Finished {
        warnings: result.warnings.clone(),
        records,
        result,
        requested: simulation.requested.with_settings(&simulation.settings),
    })
}

/// A scene as Python gives it.
#[derive(FromPyObject)]
pub enum SceneInput {
    /// The name of a file.
    File(PathBuf),
    /// The name of a scene for errors, and its text.
    Text(String, String),
}

impl SceneInput {
    /// Its name for errors.
    pub fn name(&self) -> String {
        match self {
            Self::File(path) => path.display().to_string(),
            Self::Text(name, _) => name.clone(),
        }
    }

    /// Reads the scene.
    ///
    /// # Errors
    /// Fails if it cannot be read; the error begins with its name.
    pub fn read(&self) -> Result<Scene> {
        match self {
            Self::File(path) => Scene::read(path),
            Self::Text(name, text) => Scene::parse(text).with_context(|| name.clone()),
        }
    }
}

/// Events as records, in memory.
struct Records {
    ranges: Ranges,
    array: Array,
    /// One vector for each slice.
    events: Vec<Vec<u8>>,
    map: Option<DepthMap>,
}

impl Records {
    fn of(settings: &Settings, source: &dyn PhotonSource) -> Result<Self> {
        Ok(Self {
            ranges: settings.ranges(source.array())?,
            array: Array::of(&header(settings, source)?),
            events: Vec::new(),
            map: None,
        })
    }
}

impl Sink for Records {
    fn take(&mut self, _slice: &Slice, events: &[DepthEvent]) -> Result<()> {
        let mut records = Vec::with_capacity(events.len() * RECORD);
        for event in events {
            push(&mut records, event, &self.ranges);
        }
        self.events.push(records);
        Ok(())
    }

    fn end(&mut self, _engine: &dyn Engine, map: Option<&DepthMap>) {
        self.map = map.cloned();
    }
}

impl Finished {
    fn into_python(self, py: Python) -> PyResult<PyRunResult> {
        let all_records = self.records.events;
        let bytes = all_records.iter().map(Vec::len).sum();
        let events = PyByteArray::new_with(py, bytes, |mut all| {
            for records in &all_records {
                let (these, rest) = all.split_at_mut(records.len());
                these.copy_from_slice(records);
                all = rest;
            }
            Ok(())
        })?;
        let (summary, toml, settings) = checked(|| {
            Ok((
                serde_json::to_string(&self.result.summary)?,
                self.requested.to_toml()?,
                serde_json::to_string(&self.requested)?,
            ))
        })?;
        let map = self.records.map.map(|map| (map.depth_mm, map.confidence));
        let (depth, confidence) = map.unzip();
        Ok(PyRunResult {
            events,
            summary,
            toml,
            settings,
            array: self.records.array,
            warnings: self.warnings,
            depth,
            confidence,
        })
    }
}
