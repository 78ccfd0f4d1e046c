//! Settings that suit a recording, a scene or a wanted rate of false alarms.

use std::path::PathBuf;

use dtof_calibrate::{remarks, report};
use dtof_engine::settings::SettingsFile;
use dtof_options::rows::Row;
use dtof_photons::medium::Medium;
use dtof_run::calibrate::{Calibrated, Options as CalibrateOptions};
use dtof_run::compare::{Compared, Input, Options as CompareOptions, Told};
use dtof_run::tune::Options as TuneOptions;
use pyo3::prelude::*;
use std::sync::Mutex;

use crate::error::{Keywords, options};
use crate::medium::Given;
use crate::run::SceneGiven;
use crate::work::work;

/// What a calibration found.
#[derive(IntoPyObject)]
pub struct Found {
    toml: String,
    settings: String,
    /// What was found, a row each; what has changed since older settings; what to know of it.
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
    input: Given,
    older: Option<PathBuf>,
    keywords: Keywords,
) -> PyResult<Found> {
    let options: CalibrateOptions = options(keywords)?;
    let input = Medium::from(input);
    work(py, None, move |_| {
        let older = older.as_deref().map(SettingsFile::read).transpose()?;
        let said = options.said(older.as_ref())?;
        let calibrated = options.calibrate(&input, said.clone());
        let Calibrated {
            found,
            settings,
            warnings,
        } = calibrated.map_err(|error| said.blame(error))?;
        let changes = older.map_or(Vec::new(), |older| report::changes(&settings, &older));
        Ok(Found {
            toml: settings.to_toml()?,
            settings: serde_json::to_string(&settings)?,
            rows: report::rows(&found),
            remarks: remarks(&found),
            report: report::page(&found, &settings, &changes, &input.to_string())?,
            changes,
            warnings,
        })
    })
}

/// What a comparison found.
#[derive(IntoPyObject)]
pub struct Answer {
    /// The settings of the method to take.
    toml: Option<String>,
    settings: Option<String>,
    rows: Vec<Row>,
    able: Vec<Row>,
    /// As `methods.csv`, `stress.csv` and `methods.svg`.
    table: String,
    stress: String,
    chart: String,
    warnings: Vec<String>,
}

/// What is compared, as Python gives it.
#[derive(FromPyObject)]
pub struct Photons {
    recording: Option<Given>,
    truth: Option<Given>,
    scene: Option<SceneGiven>,
}

/// Tries all methods on a recording or a scene.
#[pyfunction]
pub fn compare(
    py: Python,
    photons: Photons,
    keywords: Keywords,
    progress: Option<Bound<PyAny>>,
) -> PyResult<Answer> {
    let options: CompareOptions = options(keywords)?;
    work(py, progress, move |watch| {
        let said = options.said(photons.scene.is_some())?;
        let input = match (photons.recording, &photons.scene) {
            (Some(recording), None) => {
                Input::Recording(recording.into(), photons.truth.map(Medium::from))
            }
            (None, Some(scene)) => Input::Scene(Box::new(scene.read()?), scene.name()),
            _ => anyhow::bail!("a recording or a scene is needed"),
        };
        let warnings = Mutex::new(Vec::new());
        let told = Told {
            warning: &|warning| {
                if let Ok(mut warnings) = warnings.lock() {
                    warnings.push(warning);
                }
            },
            step: &|step| watch.step(step),
        };
        let Compared {
            comparison,
            settings,
        } = options.compare(input, &said, &told)?;
        let toml = settings.as_ref().map(SettingsFile::to_toml).transpose()?;
        Ok(Answer {
            toml,
            settings: settings.map(|of| serde_json::to_string(&of)).transpose()?,
            rows: comparison.rows(),
            able: comparison.able_rows(),
            table: comparison.table(),
            stress: comparison.stress_table(),
            chart: comparison.chart()?,
            warnings: warnings.into_inner().unwrap_or_default(),
        })
    })
}

/// The threshold and L1 for a wanted rate of false alarms, as JSON, and the options that say so.
#[pyfunction]
pub fn tune(py: Python, keywords: Keywords) -> PyResult<(String, String)> {
    let options: TuneOptions = options(keywords)?;
    work(py, None, move |_| {
        let tuned = options.tune()?;
        Ok((tuned.json().to_string(), tuned.options().to_owned()))
    })
}
