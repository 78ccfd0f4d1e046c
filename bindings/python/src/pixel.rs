//! One pixel, step by step.

use anyhow::{Context, Result, ensure};
use dtof_core::{
    AnyRule, AsyncPixel, DepthEvent, LaserCycle, PixelAddress, PixelConfig, RangeScale, Statistics,
};
use dtof_engine::settings::Settings;
use dtof_engine::with_bins;
use dtof_options::Refused;
use dtof_run::given::Operation;
use pyo3::prelude::*;
use pyo3::types::PyByteArray;

use crate::error::{Keywords, checked};
use crate::events::push;

/// A pixel of any number of bins.
trait Steps: Send + Sync {
    fn count(&mut self, bins: &[u16]);
    fn end(&mut self, last: LaserCycle, cycles: u16) -> Option<DepthEvent>;
    fn counts(&self) -> Vec<u32>;
    fn exposure(&self) -> u16;
    fn statistics(&self) -> Statistics;
}

struct OfBins<const BINS: usize> {
    config: PixelConfig<BINS, AnyRule>,
    pixel: AsyncPixel<BINS>,
    statistics: Statistics,
}

impl<const BINS: usize> OfBins<BINS> {
    fn boxed(settings: &Settings, address: PixelAddress) -> Result<Box<dyn Steps>> {
        Ok(Box::new(Self {
            config: settings.config()?,
            pixel: AsyncPixel::new(address),
            statistics: Statistics::new(),
        }))
    }
}

impl<const BINS: usize> Steps for OfBins<BINS> {
    fn count(&mut self, bins: &[u16]) {
        self.pixel.count_batch(&self.config, bins);
    }

    fn end(&mut self, last: LaserCycle, cycles: u16) -> Option<DepthEvent> {
        let statistics = &mut self.statistics;
        self.pixel
            .end_laser_cycles(&self.config, statistics, last, cycles);
        self.pixel.acknowledge()
    }

    fn counts(&self) -> Vec<u32> {
        let bins = 0..BINS;
        let count = |bin| self.pixel.histogram().count(bin).unwrap_or(0);
        bins.map(count).collect()
    }

    fn exposure(&self) -> u16 {
        self.pixel.exposure()
    }

    fn statistics(&self) -> Statistics {
        let mut statistics = self.statistics;
        self.pixel.add_photons_to(&mut statistics);
        statistics
    }
}

/// One pixel, as firmware has it.
#[pyclass(module = "dtof._native")]
pub struct Pixel {
    steps: Box<dyn Steps>,
    scale: RangeScale,
    settings: String,
    /// Laser cycles that have ended.
    #[pyo3(get)]
    cycle: u64,
}

#[pymethods]
impl Pixel {
    #[new]
    fn new(bins: usize, address: u16, keywords: Keywords) -> PyResult<Self> {
        checked(|| Self::of(bins, address, keywords))
    }

    /// Counts photons by their bins.
    #[allow(clippy::needless_pass_by_value, reason = "Python's list becomes one")]
    fn count(&mut self, bins: Vec<u16>) -> PyResult<()> {
        checked(|| {
            self.steps.count(&bins);
            Ok(())
        })
    }

    /// Ends so many laser cycles; the record of an event, if there is one.
    fn end_laser_cycles<'py>(
        &mut self,
        py: Python<'py>,
        cycles: u16,
    ) -> PyResult<Option<Bound<'py, PyByteArray>>> {
        let event = checked(|| {
            ensure!(cycles > 0, "cycles 0: must be at least 1");
            let end = self.cycle.checked_add(cycles.into());
            self.cycle = end.context("more laser cycles than can be counted")?;
            Ok(self.steps.end(LaserCycle(self.cycle - 1), cycles))
        })?;
        Ok(event.map(|event| {
            let mut record = Vec::new();
            push(&mut record, &event, &self.scale);
            PyByteArray::new(py, &record)
        }))
    }

    /// The photons of each bin.
    fn counts(&self) -> Vec<u32> {
        self.steps.counts()
    }

    /// Laser cycles since the histogram was cleared.
    #[getter]
    fn exposure(&self) -> u16 {
        self.steps.exposure()
    }

    /// What the pixel has done, by name.
    fn statistics(&self) -> Vec<(&'static str, u64)> {
        let of = self.steps.statistics();
        vec![
            ("photons", of.photons()),
            ("counted", of.counted),
            ("held", of.held),
            ("saturated", of.saturated),
            ("rejected", of.rejected),
            ("gated_out", of.gated_out),
            ("events", of.events),
            ("expired", of.expired),
        ]
    }

    /// How it operates, as JSON.
    #[getter]
    fn settings(&self) -> &str {
        &self.settings
    }
}

impl Pixel {
    fn of(bins: usize, address: u16, keywords: Keywords) -> Result<Self> {
        let options: Operation = dtof_options::read(keywords)?;
        let said = options.given.merged()?;
        let made = || {
            let settings = said.settings(bins)?;
            ensure!(
                settings.binning.is_none(),
                Refused::new("binning", "is for arrays of pixels")
            );
            ensure!(
                settings.frame.is_none(),
                Refused::new("frame", "is for arrays of pixels")
            );
            ensure!(
                settings.masked.is_empty(),
                Refused::new("masked", "is for arrays of pixels")
            );
            let steps = steps(&settings, PixelAddress(address))?;
            Ok((steps, settings))
        };
        let (steps, settings) = made().map_err(|error| said.blame(error))?;
        Ok(Self {
            steps,
            scale: settings.range_scale()?,
            settings: serde_json::to_string(&said.with(&settings))?,
            cycle: 0,
        })
    }
}

fn steps(settings: &Settings, address: PixelAddress) -> Result<Box<dyn Steps>> {
    with_bins!(settings.bins, BINS => OfBins::<BINS>::boxed(settings, address))?
}
