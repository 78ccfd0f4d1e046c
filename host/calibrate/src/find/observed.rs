//! What calibration looks at: whole histograms, and what is known of them.

use anyhow::{Result, bail, ensure};
use dtof_core::Array;

use dtof_photons::recorded::Capture;

/// How long each capture lasted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Length {
    /// So many laser cycles.
    Cycles(u64),
    /// So many that the brightest pixel of the capture averages this many photons a laser cycle:
    /// an assumption.
    PhotonsPerCycle(f64),
    /// Nobody said. Taken as one photon a laser cycle, as a replay does.
    Unknown,
}

impl Length {
    /// Whether rates are true rates.
    #[must_use]
    pub const fn is_known(self) -> bool {
        matches!(self, Self::Cycles(_))
    }

    /// Laser cycles of a capture whose brightest pixel, of those that are not hot, holds `brightest` photons.
    fn cycles(self, brightest: u64) -> f64 {
        let brightest = brightest.max(1) as f64;
        match self {
            Self::Cycles(cycles) => cycles.max(1) as f64,
            Self::PhotonsPerCycle(rate) => (brightest / rate).round().max(1.0),
            Self::Unknown => brightest,
        }
    }
}

/// A recording.
#[derive(Clone, Copy, Debug)]
pub struct Observed<'a> {
    /// The array of one capture.
    pub array: Array,
    /// Histograms: capture, then pixel, then bin.
    pub captures: &'a [Capture],
    /// How long each capture lasted.
    pub length: Length,
    /// Laser cycles of each pixel of each capture, where they differ, in the order of the pixels:
    /// then they count, and `length` is what is said of them.
    pub cycles: Option<&'a [u64]>,
    /// Picoseconds a bin.
    pub bin_width_ps: f64,
    /// The true distance of each pixel of each capture in millimetres, where it is known: the
    /// pixels of the first capture, then those of the next.
    pub truth_mm: Option<&'a [Option<f64>]>,
}

/// One histogram.
#[derive(Clone, Debug)]
pub struct Trace {
    /// Which capture.
    pub capture: usize,
    /// Which pixel of it.
    pub pixel: usize,
    /// Laser cycles it lasted, or is taken to have lasted.
    pub cycles: f64,
    /// Photons of each bin, corrected for pile-up where that is known.
    pub counts: Vec<f64>,
}

impl Observed<'_> {
    /// Every histogram, checked. The `hot` pixels say nothing of how long a capture lasted.
    ///
    /// # Errors
    /// If captures or histograms differ in size, or there is none.
    pub fn traces(&self, hot: &[usize]) -> Result<Vec<Trace>> {
        let pixels = self.array.pixels() as usize;
        let bins = self.bins();
        ensure!(!self.captures.is_empty(), "no captures");
        ensure!(bins > 8, "{bins} bins are too few to calibrate by");
        let mut traces = Vec::with_capacity(self.captures.len() * pixels);
        for (index, capture) in self.captures.iter().enumerate() {
            let found = capture.len();
            ensure!(
                found == pixels,
                "capture {index} has {found} pixels, not {pixels}"
            );
            let looked_at = capture.iter().enumerate();
            let looked_at = looked_at.filter(|(pixel, _)| !hot.contains(pixel));
            let totals = looked_at.map(|(_, counts)| counts.iter().sum::<u64>());
            let cycles = self.length.cycles(totals.max().unwrap_or(0));
            for (pixel, counts) in capture.iter().enumerate() {
                let own = self.cycles.map(|cycles| cycles.get(traces.len()).copied());
                let cycles = match own {
                    None => cycles,
                    Some(Some(own @ 1..)) => own as f64,
                    Some(_) => bail!("capture {index}, pixel {pixel} lasted no laser cycle"),
                };
                let found = counts.len();
                ensure!(
                    found == bins,
                    "capture {index}, pixel {pixel} has {found} bins, not {bins}"
                );
                traces.push(Trace {
                    capture: index,
                    pixel,
                    cycles,
                    counts: counts.iter().map(|&count| count as f64).collect(),
                });
            }
        }
        if let Some(truth) = self.truth_mm {
            ensure!(
                truth.len() == traces.len(),
                "{} true distances for {} histograms",
                truth.len(),
                traces.len()
            );
        }
        Ok(traces)
    }

    /// Bins of a histogram; 0 of none.
    #[must_use]
    pub fn bins(&self) -> usize {
        let first = self.captures.first().and_then(|capture| capture.first());
        first.map_or(0, Vec::len)
    }
}
