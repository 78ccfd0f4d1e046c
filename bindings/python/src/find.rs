//! Settings for a recording, a scene or a rate of false alarms.

use dtof_calibrate::remarks;
use dtof_data::options::rows::Row;
use dtof_data::photons::input::Input;
use dtof_engine::settings::SettingsFile;
use dtof_run::calibrate::report;
use dtof_run::calibrate::{CalibrateResult, Options as CalibrateOptions};
use dtof_run::compare::job::{Callbacks, CompareInput, CompareResult, Options as CompareOptions};
use dtof_run::tune::Options as TuneOptions;
use pyo3::prelude::*;
use std::sync::Mutex;

use crate::error::{Keywords, options, options_over, settings};
use crate::input::PyInput;
use crate::run::SceneInput;
use crate::work::work;

/// The result of a calibration.
#[derive(IntoPyObject)]
pub struct Found {
    toml: String,
    settings: String,
    /// Findings, changes since older settings, and remarks, one a row.
    rows: Vec<Row>,
    changes: Vec<Row>,
    remarks: Vec<Row>,
    report: String,
    warnings: Vec<String>,
}

/// Finds the settings of a sensor in a recording.
#[pyfunction]
pub fn calibrate(
    py: Python,
    input: PyInput,
    older: Option<String>,
    keywords: Keywords,
    progress: Option<Bound<PyAny>>,
) -> PyResult<Found> {
    let options: CalibrateOptions = options(keywords)?;
    let input = Input::from(input);
    work(py, progress, move |mut control| {
        let older = older.as_deref().map(settings).transpose()?;
        let requested = options.requested(older.as_ref())?;
        let calibrated = options.calibrate(&input, requested.clone(), &mut control);
        let CalibrateResult {
            found,
            settings,
            warnings,
        } = calibrated.map_err(|error| requested.add_file_name(error))?;
        let changes = older.map_or(Vec::new(), |older| report::changes(&settings, &older));
        Ok(Found {
            toml: settings.to_toml()?,
            settings: serde_json::to_string(&settings)?,
            rows: report::rows(&found),
            remarks: remarks(&found, &settings),
            report: report::page(&found, &settings, &changes, &input.to_string())?,
            changes,
            warnings,
        })
    })
}

/// The result of a comparison.
#[derive(IntoPyObject)]
pub struct Answer {
    /// Settings of the method to take.
    toml: Option<String>,
    settings: Option<String>,
    /// Settings of the fastest method, if that is another.
    fastest_toml: Option<String>,
    rows: Vec<Row>,
    able: Vec<Row>,
    /// The content of `methods.csv`, `stress.csv` and `compare.svg`.
    table: String,
    stress: String,
    chart: String,
    warnings: Vec<String>,
}

/// The input of a comparison, as Python gives it.
#[derive(FromPyObject)]
pub struct Photons {
    recording: Option<PyInput>,
    truth: Option<PyInput>,
    scene: Option<SceneInput>,
}

/// Compares all methods on a recording or a scene.
#[pyfunction]
pub fn compare(
    py: Python,
    photons: Photons,
    keywords: Keywords,
    progress: Option<Bound<PyAny>>,
) -> PyResult<Answer> {
    let options: CompareOptions = options_over(keywords)?;
    work(py, progress, move |control| {
        let requested = options.requested(photons.scene.is_some())?;
        let input = match (photons.recording, &photons.scene) {
            (Some(recording), None) => {
                CompareInput::Recording(recording.into(), photons.truth.map(Input::from))
            }
            (None, Some(scene)) => CompareInput::Scene(Box::new(scene.read()?), scene.name()),
            _ => anyhow::bail!("a recording or a scene is needed"),
        };
        let warnings = Mutex::new(Vec::new());
        let callbacks = Callbacks {
            warning: &|warning| {
                if let Ok(mut warnings) = warnings.lock() {
                    warnings.push(warning);
                }
            },
            step: &|step, share| control.step(step, share),
        };
        let CompareResult {
            comparison,
            settings,
            fastest,
        } = options.compare(input, &requested, &callbacks)?;
        let toml = |of: &Option<SettingsFile>| of.as_ref().map(SettingsFile::to_toml).transpose();
        Ok(Answer {
            toml: toml(&settings)?,
            fastest_toml: toml(&fastest)?,
            settings: settings.map(|of| serde_json::to_string(&of)).transpose()?,
            rows: comparison.rows(),
            able: comparison.candidate_rows(),
            table: comparison.table(),
            stress: comparison.stress_table(),
            chart: comparison.chart()?,
            warnings: warnings.into_inner().unwrap_or_default(),
        })
    })
}

/// Threshold and L1 for a rate of false alarms, as JSON, and the options for them.
#[pyfunction]
pub fn tune(
    py: Python,
    keywords: Keywords,
    progress: Option<Bound<PyAny>>,
) -> PyResult<(String, String)> {
    let options: TuneOptions = options(keywords)?;
    work(py, progress, move |mut control| {
        let tuned = options.tune(&mut control)?;
        Ok((tuned.json().to_string(), tuned.options().to_owned()))
    })
}
