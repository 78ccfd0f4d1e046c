//! One pixel, step by step.

use anyhow::{Context, Result, ensure};
use dtof_core::{
    AnyRule, Array, AsyncPixel, Count8, Count10, CounterWidth, DepthEvent, LaserCycle, OncePerBin,
    PixelAddress, PixelConfig, Statistics,
};
use dtof_data::options::Refused;
use dtof_data::photons::ranges::Ranges;
use dtof_engine::settings::Settings;
use dtof_engine::with_bins;
use dtof_run::given::Operation;
use pyo3::prelude::*;
use pyo3::types::PyByteArray;

use crate::error::{Keywords, checked, options_over};
use crate::events::push;

/// A pixel of any number of bins.
trait AnyPixel: Send + Sync {
    fn count(&mut self, bins: &[u16]);
    fn end(&mut self, last: LaserCycle, cycles: u16) -> Option<DepthEvent>;
    fn counts(&self) -> Vec<u32>;
    fn exposure(&self) -> u16;
    fn statistics(&self) -> Statistics;
}

/// Those of the widest histogram.
type Bins = OncePerBin<{ OncePerBin::words(1024) }>;

struct PixelOf<const BINS: usize, W: CounterWidth> {
    config: PixelConfig<BINS, AnyRule>,
    pixel: AsyncPixel<BINS, W>,
    /// If photons count once per bin.
    bins: Option<Bins>,
    statistics: Statistics,
}

impl<const BINS: usize, W: CounterWidth> PixelOf<BINS, W> {
    fn boxed(settings: &Settings, address: PixelAddress) -> Result<Box<dyn AnyPixel>> {
        Ok(Box::new(Self {
            config: settings.config()?,
            pixel: AsyncPixel::new(address),
            bins: settings.configuration.once_per_bin.then(Bins::new),
            statistics: Statistics::new(),
        }))
    }
}

impl<const BINS: usize, W: CounterWidth> AnyPixel for PixelOf<BINS, W> {
    fn count(&mut self, bins: &[u16]) {
        let Some(seen) = &mut self.bins else {
            self.pixel.count_batch(&self.config, bins);
            return;
        };
        // Photons past the last bin are all rejected.
        let photons = bins.iter().copied();
        let first: Vec<u16> = photons
            .filter(|&bin| usize::from(bin) >= BINS || seen.is_first(bin))
            .collect();
        self.pixel.count_batch(&self.config, &first);
        self.statistics.repeated += (bins.len() - first.len()) as u64;
    }

    fn end(&mut self, last: LaserCycle, cycles: u16) -> Option<DepthEvent> {
        if let Some(seen) = &mut self.bins {
            seen.end_laser_cycle();
        }
        let statistics = &mut self.statistics;
        self.pixel
            .end_laser_cycles(&self.config, statistics, last, cycles);
        self.pixel.take_event()
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
    pixel: Box<dyn AnyPixel>,
    ranges: Ranges,
    settings: String,
    /// Laser cycles that have ended.
    #[pyo3(get)]
    cycle: u64,
}

#[pymethods]
impl Pixel {
    #[new]
    fn new(bins: usize, address: u16, keywords: Keywords) -> PyResult<Self> {
        let options: Operation = options_over(keywords)?;
        checked(|| Self::create(bins, address, &options))
    }

    /// Counts photons by their bins.
    #[allow(clippy::needless_pass_by_value, reason = "Python's list becomes one")]
    fn count(&mut self, bins: Vec<u16>) -> PyResult<()> {
        checked(|| {
            self.pixel.count(&bins);
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
            Ok(self.pixel.end(LaserCycle::new(self.cycle - 1), cycles))
        })?;
        Ok(event.map(|event| {
            let mut record = Vec::new();
            push(&mut record, &event, &self.ranges);
            PyByteArray::new(py, &record)
        }))
    }

    /// The photons of each bin.
    fn counts(&self) -> Vec<u32> {
        self.pixel.counts()
    }

    /// Laser cycles since the histogram was cleared.
    #[getter]
    fn exposure(&self) -> u16 {
        self.pixel.exposure()
    }

    /// Statistics of the pixel by name.
    fn statistics(&self) -> Vec<(&'static str, u64)> {
        let of = self.pixel.statistics();
        vec![
            ("photons", of.photons()),
            ("counted", of.counted),
            ("held", of.excluded),
            ("saturated", of.saturated),
            ("rejected", of.rejected),
            ("gated_out", of.gated_out),
            ("repeated", of.repeated),
            ("events", of.events),
            ("expired", of.expired),
            ("ended_full", of.ended_full),
            ("blind_looks", of.blind_looks),
        ]
    }

    /// The settings as JSON.
    #[getter]
    fn settings(&self) -> &str {
        &self.settings
    }
}

impl Pixel {
    fn create(bins: usize, address: u16, options: &Operation) -> Result<Self> {
        let requested = options.given.merged_with_looks()?;
        let create = || {
            let settings = requested.settings(bins)?;
            let of_arrays = [
                ("binning", settings.configuration.binning.is_some()),
                ("neighbours", settings.configuration.neighbours.is_some()),
                ("frame", settings.frame.is_some()),
                ("masked", !settings.masked.is_empty()),
                ("offsets_mm", !settings.offsets_mm.is_empty()),
            ];
            for (key, is_given) in of_arrays {
                ensure!(!is_given, Refused::new(key, "is for arrays of pixels"));
            }
            let address = PixelAddress::new(address);
            let pixel = with_bins!(settings.bins, BINS => match settings.counter_bits {
                8 => PixelOf::<BINS, Count8>::boxed(&settings, address),
                _ => PixelOf::<BINS, Count10>::boxed(&settings, address),
            })??;
            let array = Array::new(1, 1).context("one pixel")?;
            let ranges = settings.ranges(array)?;
            Ok((pixel, settings, ranges))
        };
        let (pixel, settings, ranges) = create().map_err(|error| requested.add_file_name(error))?;
        Ok(Self {
            pixel,
            ranges,
            settings: serde_json::to_string(&requested.with_settings(&settings))?,
            cycle: 0,
        })
    }
}
