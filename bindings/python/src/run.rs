//! Photons through the engine, into memory.

use std::path::PathBuf;

use anyhow::{Context, Result};
use dtof_core::{DepthEvent, RangeScale};
use dtof_engine::host::host_engine;
use dtof_engine::settings::{Settings, SettingsFile};
use dtof_photons::medium::Medium;
use dtof_photons::recorded::Whole;
use dtof_photons::source::{PhotonSource, Slice};
use dtof_run::Sink;
use dtof_run::output::header;
use dtof_run::recording::{opening, warnings};
use dtof_run::replay::Options;
use dtof_run::simulate::Options as SimulateOptions;
use dtof_simulate::scene::Scene;
use pyo3::prelude::*;
use pyo3::types::PyByteArray;

use crate::error::{Keywords, checked, options};
use crate::events::{Array, RECORD, push};
use crate::medium::Given;
use crate::part::WholeGiven;
use crate::work::{Watch, work};

/// What came of a run.
#[derive(IntoPyObject)]
pub struct Ran<'py> {
    /// Records, of `dtof.EVENT`.
    events: Bound<'py, PyByteArray>,
    /// As in `summary.json`.
    summary: String,
    /// As in `dtof.toml`, and the same as JSON.
    toml: String,
    settings: String,
    array: Array,
    warnings: Vec<String>,
    /// Photons bin by bin, where the cover glass is watched.
    bins: Option<Vec<u64>>,
}

/// The same, before Python has it.
struct Done {
    records: Records,
    ran: dtof_run::Ran,
    said: SettingsFile,
    warnings: Vec<String>,
}

/// Replays a recording, a file or an array; one that is a part as it is replayed in the whole.
/// `cycles` are those of a recording that is replayed to its end unless said otherwise.
#[pyfunction]
#[pyo3(signature = (input, keywords, progress, whole, cycles=None))]
pub fn replay<'py>(
    py: Python<'py>,
    input: Given,
    keywords: Keywords,
    progress: Option<Bound<'py, PyAny>>,
    whole: Option<WholeGiven>,
    cycles: Option<u64>,
) -> PyResult<Ran<'py>> {
    let options: Options = options(keywords)?;
    let input = Medium::from(input);
    let done = work(py, progress, move |watch| {
        let mut said = options.said()?;
        // Fewer than are replayed anyhow need not be said.
        let cycles = cycles.filter(|&cycles| cycles > opening(&said).cycles);
        said.run.cycles = said.run.cycles.or(cycles);
        let whole = whole.map(|whole| whole.read(&input)).transpose()?;
        replayed(&options, &input, &said, whole, watch).map_err(|error| said.blame(error))
    })?;
    done.into_python(py)
}

fn replayed(
    options: &Options,
    input: &Medium,
    said: &SettingsFile,
    whole: Option<Whole>,
    watch: &Watch,
) -> Result<Done> {
    let mut replay = options.open_part(input, said, whole)?;
    let mut records = Records::of(&replay.settings, &replay.photons)?;
    let ran = replay.run(input, &mut records, &mut { watch })?;
    Ok(Done {
        records,
        ran,
        said: replay.said.with(&replay.settings),
        warnings: warnings(&replay.known).collect(),
    })
}

/// Simulates a scene: the name of a file, or the text of one.
#[pyfunction]
pub fn simulate<'py>(
    py: Python<'py>,
    scene: SceneGiven,
    keywords: Keywords,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Ran<'py>> {
    let options: SimulateOptions = options(keywords)?;
    let done = work(py, progress, move |watch| {
        let said = options.said()?;
        let simulated = simulated(&options, &scene, said.clone(), watch);
        simulated.map_err(|error| said.blame(error))
    })?;
    done.into_python(py)
}

fn simulated(
    options: &SimulateOptions,
    scene: &SceneGiven,
    said: SettingsFile,
    watch: &Watch,
) -> Result<Done> {
    let mut simulation = options.open(scene.read()?, &scene.name(), said)?;
    let (photons, settings) = (&simulation.photons, &simulation.settings);
    let mut engine = host_engine(settings, photons.array(), &photons.addresses())?;
    let mut records = Records::of(settings, photons)?;
    let ran = simulation.run(engine.as_mut(), &mut records, &mut { watch })?;
    Ok(Done {
        records,
        ran,
        said: simulation.said.with(&simulation.settings),
        warnings: Vec::new(),
    })
}

/// A scene as Python gives it.
#[derive(FromPyObject)]
pub enum SceneGiven {
    /// The name of a file.
    File(PathBuf),
    /// Its name for errors, and its text.
    Text(String, String),
}

impl SceneGiven {
    /// As errors call it.
    pub fn name(&self) -> String {
        match self {
            Self::File(path) => path.display().to_string(),
            Self::Text(name, _) => name.clone(),
        }
    }

    /// The scene.
    ///
    /// # Errors
    /// What is wrong with it, its name first.
    pub fn read(&self) -> Result<Scene> {
        match self {
            Self::File(path) => Scene::read(path),
            Self::Text(name, text) => Scene::parse(text).with_context(|| name.clone()),
        }
    }
}

/// Events as records, in memory.
struct Records {
    scale: RangeScale,
    array: Array,
    /// Those of some slices each.
    events: Vec<Vec<u8>>,
}

impl Records {
    fn of(settings: &Settings, source: &dyn PhotonSource) -> Result<Self> {
        Ok(Self {
            scale: settings.range_scale()?,
            array: Array::of(&header(settings, source)?),
            events: Vec::new(),
        })
    }
}

impl Sink for Records {
    fn take(&mut self, _slice: &Slice, events: &[DepthEvent]) -> Result<()> {
        let mut records = Vec::with_capacity(events.len() * RECORD);
        for event in events {
            push(&mut records, event, &self.scale);
        }
        self.events.push(records);
        Ok(())
    }
}

impl Done {
    fn into_python(self, py: Python) -> PyResult<Ran> {
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
                serde_json::to_string(&self.ran.summary)?,
                self.said.to_toml()?,
                serde_json::to_string(&self.said)?,
            ))
        })?;
        Ok(Ran {
            events,
            summary,
            toml,
            settings,
            array: self.records.array,
            warnings: self.warnings,
            bins: self.ran.bins,
        })
    }
}
