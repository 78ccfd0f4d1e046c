//! An array of pixels, laser cycle by laser cycle.

use std::sync::{Mutex, PoisonError};

use anyhow::{Context, Result, ensure};
use dtof_core::{BlockLevel, EchoNumber, LaserCycle, PixelAddress};
use dtof_data::options::Refused;
use dtof_data::photons::masked::check;
use dtof_data::photons::ranges::Ranges;
use dtof_data::photons::source::{Photon, PhotonSource, PixelPhotons, Slice};
use dtof_engine::Engine;
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_run::Reported;
use dtof_run::given::Operation;
use dtof_run::output::header;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyByteArray;

use crate::error::{Keywords, catch_panics, checked, options_over, raised};
use crate::events::{Array, push};
use crate::work::pool;

/// The photons of the current laser cycle.
struct Received {
    array: dtof_core::Array,
    pixels: Vec<PixelPhotons>,
    /// Pixels that are left out, and their photons.
    is_masked: Vec<bool>,
    masked: u64,
    /// Laser cycles that have ended.
    cycles: u64,
    laser_hz: Option<u64>,
}

impl Received {
    /// Adds photons: a pixel and a bin of 2 bytes each, little-endian.
    fn add(&mut self, pixels: &[u8], bins: &[u8]) -> Result<()> {
        let (pixels, bins) = (pixels.as_chunks::<2>().0, bins.as_chunks::<2>().0);
        let all = self.pixels.len();
        let pixels: Vec<usize> = pixels
            .iter()
            .map(|bytes| u16::from_le_bytes(*bytes).into())
            .collect();
        if let Some(past) = pixels.iter().find(|&&pixel| pixel >= all) {
            return Err(Refused::value("pixel", past, format!("there are {all} pixels")).into());
        }
        for (&pixel, &code) in pixels.iter().zip(bins) {
            if self.is_masked[pixel] {
                self.masked += 1;
            } else {
                let code = u16::from_le_bytes(code);
                self.pixels[pixel].photons.push(Photon { cycle: 0, code });
            }
        }
        Ok(())
    }
}

impl PhotonSource for Received {
    fn array(&self) -> dtof_core::Array {
        self.array
    }

    fn cycles(&self) -> u64 {
        self.cycles
    }

    fn masked(&self) -> u64 {
        self.masked
    }

    fn laser_hz(&self) -> Option<u64> {
        self.laser_hz
    }

    /// The photons that have been added, of the first of these laser cycles.
    fn next_slice(&mut self, cycles: u16) -> Result<Slice> {
        let first_cycle = self.cycles;
        let end = first_cycle.checked_add(cycles.into());
        self.cycles = end.context("more laser cycles than can be counted")?;
        let pixels = self.pixels.iter_mut().map(|pixel| PixelPhotons {
            cycles,
            ..std::mem::take(pixel)
        });
        Ok(Slice {
            first_cycle,
            pixels: pixels.collect(),
        })
    }
}

struct State {
    engine: Box<dyn Engine>,
    received: Received,
    reported: Reported,
}

/// An array of pixels.
#[pyclass(module = "dtof._native")]
pub struct Pixels {
    state: Mutex<State>,
    ranges: Ranges,
    settings: Settings,
    /// The settings as JSON, and as a settings file.
    #[pyo3(get)]
    settings_json: String,
    #[pyo3(get)]
    toml: String,
    array: Array,
    keeps_histograms: bool,
}

#[pymethods]
impl Pixels {
    #[new]
    fn new(
        rows: u32,
        columns: u32,
        bins: usize,
        keeps_histograms: bool,
        keywords: Keywords,
    ) -> PyResult<Self> {
        let options: Operation = options_over(keywords)?;
        checked(|| Self::create(rows, columns, bins, keeps_histograms, &options))
    }

    /// Runs laser cycles; all these photons are of the first. The records of the events.
    #[allow(clippy::needless_pass_by_value, reason = "as Python gives it")]
    fn cycle<'py>(
        &self,
        py: Python<'py>,
        pixels: PyBackedBytes,
        bins: PyBackedBytes,
        cycles: u16,
    ) -> PyResult<Bound<'py, PyByteArray>> {
        let pool = pool().map_err(|error| raised(&error))?;
        let records = py.detach(|| {
            let job = || self.run(&pixels, &bins, cycles);
            pool.install(|| catch_panics(job))
        });
        let records = records.map_err(|error| raised(&error))?;
        Ok(PyByteArray::new(py, &records))
    }

    /// The histogram from which the last event of a pixel or block was decided, as counts of 2 bytes, if
    /// it ended with laser cycle `cycle` and has this number among its echoes.
    fn histogram<'py>(
        &self,
        py: Python<'py>,
        pixel: u16,
        level: u8,
        cycle: u64,
        echo: u8,
    ) -> PyResult<Bound<'py, PyByteArray>> {
        let counts = checked(|| {
            let reason = "True is needed to keep the histograms of events";
            ensure!(
                self.keeps_histograms,
                Refused::new("keep_histograms", reason)
            );
            let (pixel, level) = (PixelAddress::new(pixel), BlockLevel::new(level));
            let (cycle, echo) = (LaserCycle::new(cycle), EchoNumber::new(echo));
            let decisions = self.with(|state| state.engine.decisions());
            let decision = decisions.into_iter().find(|decision| {
                let event = &decision.event;
                (
                    event.pixel,
                    Some(event.level),
                    event.cycle,
                    Some(event.echo),
                ) == (pixel, level, cycle, echo)
            });
            let decision = decision.context(
                "the event: is not the last of its pixel: only the histogram of that is kept",
            )?;
            let counts = decision.counts.iter().flat_map(|count| count.to_le_bytes());
            Ok(counts.collect::<Vec<u8>>())
        })?;
        Ok(PyByteArray::new(py, &counts))
    }

    /// Laser cycles that have ended.
    #[getter]
    fn cycles(&self) -> u64 {
        self.with(|state| state.received.cycles)
    }

    /// The content of `summary.json`.
    fn summary(&self) -> PyResult<String> {
        checked(|| {
            let summary = self.with(|state| {
                let engine = state.engine.as_ref();
                state
                    .reported
                    .summary(engine, &state.received, &self.settings)
            });
            Ok(serde_json::to_string(&summary)?)
        })
    }

    #[getter]
    fn array(&self) -> Array {
        self.array.clone()
    }
}

impl Pixels {
    fn create(
        rows: u32,
        columns: u32,
        bins: usize,
        keeps_histograms: bool,
        options: &Operation,
    ) -> Result<Self> {
        let array = dtof_core::Array::new(columns, rows).with_context(|| {
            format!("{rows} rows and {columns} columns: must be 1 to 65,536 pixels")
        })?;
        let requested = options.given.merged_with_looks()?;
        let create = || {
            let settings = requested.settings(bins)?;
            check(&settings.masked, array.pixels() as usize)?;
            let mut is_masked = vec![false; array.pixels() as usize];
            for &pixel in &settings.masked {
                is_masked[usize::from(pixel)] = true;
            }
            let received = Received {
                array,
                pixels: vec![PixelPhotons::default(); is_masked.len()],
                is_masked,
                masked: 0,
                cycles: 0,
                laser_hz: requested.sensor.laser_hz,
            };
            let mut engine = host_engine(&settings, array, &received.addresses())?;
            if keeps_histograms {
                engine.keep_decisions(&|_| true);
            }
            let ranges = settings.ranges(array)?;
            Ok((engine, received, settings, ranges))
        };
        let (engine, received, settings, ranges) =
            create().map_err(|error| requested.add_file_name(error))?;
        let used = requested.with_settings(&settings);
        Ok(Self {
            ranges,
            settings_json: serde_json::to_string(&used)?,
            toml: used.to_toml()?,
            array: Array::of(&header(&settings, &received)?),
            state: Mutex::new(State {
                engine,
                reported: Reported::new(received.array),
                received,
            }),
            settings,
            keeps_histograms,
        })
    }

    fn with<T>(&self, use_it: impl FnOnce(&mut State) -> T) -> T {
        use_it(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn run(&self, pixels: &[u8], bins: &[u8], cycles: u16) -> Result<Vec<u8>> {
        self.with(|state| {
            state.received.add(pixels, bins)?;
            let slice = state.received.next_slice(cycles)?;
            let mut records = Vec::new();
            for event in state.engine.run(&slice)? {
                state.reported.add(&event);
                push(&mut records, &event, &self.ranges);
            }
            Ok(records)
        })
    }
}
