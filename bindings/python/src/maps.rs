//! What events say of each pixel, and where they are in space.

use dtof_core::{EchoNumber, RangeScale};
use dtof_engine::settings::SettingsFile;
use dtof_events::aer_file::Event;
use dtof_events::echoes::{Echo, Selection};
use dtof_events::maps::Maps;
use dtof_export::Projected;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyByteArray;

use crate::error::{Keywords, options};
use crate::events::{Array, events};
use crate::work::work;

/// Numbers of each pixel, row by row; NaN where there is none.
#[derive(IntoPyObject)]
pub struct OfPixels {
    last_mm: Vec<f64>,
    mean_mm: Vec<f64>,
    reflectivity_of_events: Vec<f64>,
    reflectivity_of_signal: Vec<f64>,
    events: Vec<u64>,
}

/// What events say of each pixel, as the maps of a run have it.
#[pyfunction]
pub fn maps(
    py: Python,
    records: PyBackedBytes,
    array: Array,
    keywords: Keywords,
) -> PyResult<OfPixels> {
    let options: Projected = options(keywords)?;
    work(py, None, move |_| {
        let header = array.header()?;
        let scale = RangeScale::new(header.bin_width_ps, header.offset_mm)?;
        let mut maps = Maps::new(header.array);
        for event in chosen(events(&records, &header)?, options.echo) {
            if let Event::Depth(event) = event {
                maps.add(&event, &scale);
            }
        }
        let pixels = maps.pixels.iter();
        let number = |of: Option<f64>| of.unwrap_or(f64::NAN);
        Ok(OfPixels {
            last_mm: pixels.clone().map(|of| number(of.last_mm())).collect(),
            mean_mm: pixels.clone().map(|of| number(of.mean_mm())).collect(),
            reflectivity_of_events: pixels
                .clone()
                .map(|of| number(of.reflectivity_of_events()))
                .collect(),
            reflectivity_of_signal: pixels
                .clone()
                .map(|of| number(of.reflectivity_of_signal()))
                .collect(),
            events: pixels.map(|of| of.events).collect(),
        })
    })
}

/// Events as points: records of `dtof.POINT`.
#[pyfunction]
pub fn points<'py>(
    py: Python<'py>,
    records: PyBackedBytes,
    array: Array,
    keywords: Keywords,
) -> PyResult<Bound<'py, PyByteArray>> {
    let options: Projected = options(keywords)?;
    let points = work(py, None, move |_| {
        let header = array.header()?;
        let events = chosen(events(&records, &header)?, options.echo.or(Some(Echo::All)));
        let options = options.options(&SettingsFile::default())?;
        dtof_export::points(&events, &header, &options)
    })?;
    Ok(PyByteArray::new(py, &points))
}

/// The strongest echo of each exposure unless said otherwise.
fn chosen(events: Vec<Event>, echo: Option<Echo>) -> Vec<Event> {
    let echo = echo.unwrap_or(Echo::Strongest);
    let is_single = |event: &Event| event.echo() == EchoNumber::FIRST;
    if echo == Echo::All || events.iter().all(is_single) {
        return events;
    }
    let mut selection = Selection::new(echo, EchoNumber::LAST, u16::MAX);
    for event in events {
        if let Event::Depth(event) = event {
            selection.push(event);
        }
    }
    selection.finish();
    selection.map(Event::Depth).collect()
}
