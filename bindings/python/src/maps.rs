//! Maps of pixels from events, and events as points.

use dtof_core::EchoNumber;
use dtof_data::events::aer_file::Event;
use dtof_data::events::echoes::{Echo, EchoSelection};
use dtof_data::events::histories::{PixelHistories, PixelHistory};
use dtof_engine::settings::SettingsFile;
use dtof_run::export::ProjectionOptions;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyByteArray;

use crate::error::{Keywords, options};
use crate::events::{Array, events};
use crate::work::work;

/// Maps row by row; NaN where a pixel has no value.
#[derive(IntoPyObject)]
pub struct PixelMaps {
    last_mm: Vec<f64>,
    mean_mm: Vec<f64>,
    reflectivity_of_events: Vec<f64>,
    reflectivity_of_signal: Vec<f64>,
    events: Vec<u64>,
}

/// The maps of events, as a run draws them.
#[pyfunction]
pub fn maps(
    py: Python,
    records: PyBackedBytes,
    array: Array,
    keywords: Keywords,
) -> PyResult<PixelMaps> {
    let options: ProjectionOptions = options(keywords)?;
    work(py, None, move |_| {
        let header = array.header()?;
        let ranges = header.ranges()?;
        let mut maps = PixelHistories::new(header.array);
        for event in select(events(&records, &header)?, options.echo) {
            if let Event::Depth(event) = event {
                maps.add(&event, &ranges);
            }
        }
        let all = |value: fn(&PixelHistory) -> Option<f64>| {
            let values = maps.pixels.iter().map(value);
            values.map(|value| value.unwrap_or(f64::NAN)).collect()
        };
        Ok(PixelMaps {
            last_mm: all(PixelHistory::last_mm),
            mean_mm: all(PixelHistory::mean_mm),
            reflectivity_of_events: all(PixelHistory::reflectivity_of_events),
            reflectivity_of_signal: all(PixelHistory::reflectivity_of_signal),
            events: maps.pixels.iter().map(|pixel| pixel.events).collect(),
        })
    })
}

/// Events as points, records of `dtof.POINT`.
#[pyfunction]
pub fn points<'py>(
    py: Python<'py>,
    records: PyBackedBytes,
    array: Array,
    keywords: Keywords,
) -> PyResult<Bound<'py, PyByteArray>> {
    let options: ProjectionOptions = options(keywords)?;
    let points = work(py, None, move |_| {
        let header = array.header()?;
        let echo = match options.one_per_pixel {
            true => options.echo, // as maps
            false => options.echo.or(Some(Echo::All)),
        };
        let events = select(events(&records, &header)?, echo);
        let options = options.options(SettingsFile::default())?;
        dtof_run::export::points(&events, &header, &options)
    })?;
    Ok(PyByteArray::new(py, &points))
}

/// Selects one echo of each exposure: the strongest by default.
fn select(events: Vec<Event>, echo: Option<Echo>) -> Vec<Event> {
    let echo = echo.unwrap_or(Echo::Strongest);
    let is_single = |event: &Event| event.echo() == EchoNumber::FIRST;
    if echo == Echo::All || events.iter().all(is_single) {
        return events;
    }
    let mut selection = EchoSelection::new(echo, EchoNumber::LAST, u16::MAX);
    for event in events {
        if let Event::Depth(event) = event {
            selection.push(event);
        }
    }
    selection.finish();
    selection.map(Event::Depth).collect()
}
