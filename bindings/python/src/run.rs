//! Photons through the engine, into memory.

use std::path::PathBuf;

use anyhow::{Context, Result};
use dtof_core::DepthEvent;
use dtof_engine::Engine;
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_engine::settings::SettingsFile;
use dtof_engine::slices::each_slice;
use dtof_events::aer_file::Header;
use dtof_photons::masked::Masked;
use dtof_photons::medium::Medium;
use dtof_photons::recorded::Whole;
use dtof_photons::source::PhotonSource;
use dtof_run::glass::watch_glass;
use dtof_run::recording::{opening, warnings};
use dtof_run::replay::{Options, Replay};
use dtof_run::simulate::{Options as SimulateOptions, of_scene};
use dtof_run::summary::Summary;
use dtof_run::truth::Comparison;
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
    /// Records of some slices each.
    events: Vec<Vec<u8>>,
    summary: Summary,
    said: SettingsFile,
    array: Array,
    warnings: Vec<String>,
    bins: Option<Vec<u64>>,
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
        let whole = whole.map(WholeGiven::read).transpose()?;
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
    let Replay {
        mut photons,
        mut engine,
        settings,
        said,
        known,
    } = options.open_part(input, said, whole)?;
    let mut done = run(
        &mut photons,
        engine.as_mut(),
        &settings,
        &said,
        watch,
        |_| (),
    )?;
    done.warnings = warnings(&known).collect();
    done.summary.input = Some(input.to_string());
    done.summary.cut_off = known.cut_off;
    done.summary.recording = known.rows;
    done.summary.warnings = known.warnings;
    Ok(done)
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
    let name = scene.name();
    let scene = options.seen(scene.read()?);
    let said = of_scene(said, &scene).with_context(|| {
        let file = options.given.file.as_deref();
        file.map_or("the scene".to_owned(), |file| file.display().to_string())
    })?;
    let settings = said.settings(scene.bins.into())?;
    let cycles = said.run.cycles.unwrap_or(scene.cycles);
    let photons = scene.photons(settings.seed, cycles);
    let photons = photons.with_context(|| name.clone())?;
    let mut photons = Masked::new(Box::new(photons), &settings.masked)?;
    let mut engine = host_engine(&settings, photons.geometry(), &photons.addresses())?;
    let mut comparison = Comparison::new(&scene, &settings, cycles)?;
    let mut done = run(
        &mut photons,
        engine.as_mut(),
        &settings,
        &said,
        watch,
        |events| comparison.add(events),
    )?;
    done.summary.input = Some(name);
    done.summary.field_of_view_degrees = Some(scene.view().degrees());
    done.summary.against_truth = Some(comparison.finish());
    Ok(done)
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

/// Runs all of `source`, as is `said`.
fn run(
    source: &mut dyn PhotonSource,
    engine: &mut dyn Engine,
    settings: &Settings,
    said: &SettingsFile,
    watch: &Watch,
    mut see: impl FnMut(&[DepthEvent]),
) -> Result<Done> {
    let (scale, geometry) = (settings.range_scale()?, source.geometry());
    let cycles = source.cycles();
    let mut bins = said
        .sensor
        .glass_bins
        .as_ref()
        .map(|_| vec![0u64; settings.bins]);
    let mut has_reported = vec![false; geometry.addresses()];
    let mut records = Vec::new();
    watch.at(0, cycles)?;
    each_slice(
        source,
        |slice| engine.run(slice),
        |slice, events, done| {
            let mut of_slice = Vec::with_capacity(events.len() * RECORD);
            for event in &events {
                push(&mut of_slice, event, &scale);
                for pixel in geometry.block(event.pixel, event.level) {
                    has_reported[usize::from(pixel.0)] = true;
                }
            }
            records.push(of_slice);
            if let Some(bins) = &mut bins {
                let photons = slice.pixels.iter().flat_map(|pixel| &pixel.photons);
                for photon in photons {
                    if let Some(count) = bins.get_mut(usize::from(photon.code)) {
                        *count += 1;
                    }
                }
            }
            see(&events);
            watch.at(done, cycles)
        },
    )?;
    let reporting = has_reported.into_iter().filter(|&has| has).count();
    let header = Header {
        bins: u32::try_from(settings.bins)?,
        geometry,
        bin_width_ps: settings.bin_width_ps,
        offset_mm: settings.offset_mm,
        laser_millihertz: source.laser_hz().map_or(0, |hz| hz.saturating_mul(1000)),
        start_us: 0,
    };
    let mut summary = Summary::new(engine.statistics(), source, reporting, settings);
    watch_glass(said, bins.as_deref(), &mut summary);
    Ok(Done {
        events: records,
        summary,
        said: said.with(settings),
        array: Array::of(&header),
        warnings: Vec::new(),
        bins,
    })
}

impl Done {
    fn into_python(self, py: Python) -> PyResult<Ran> {
        let bytes = self.events.iter().map(Vec::len).sum();
        let events = PyByteArray::new_with(py, bytes, |mut all| {
            for records in &self.events {
                let (these, rest) = all.split_at_mut(records.len());
                these.copy_from_slice(records);
                all = rest;
            }
            Ok(())
        })?;
        let (summary, toml, settings) = checked(|| {
            Ok((
                serde_json::to_string(&self.summary)?,
                self.said.to_toml()?,
                serde_json::to_string(&self.said)?,
            ))
        })?;
        Ok(Ran {
            events,
            summary,
            toml,
            settings,
            array: self.array,
            warnings: self.warnings,
            bins: self.bins,
        })
    }
}
