//! The input of a calibration: whole histograms, and how long they took.

use std::ops::RangeInclusive;

use anyhow::{Result, bail, ensure};
use dtof_core::Array;

use dtof_data::options::Refused;
use dtof_data::photons::histograms::Histograms;
use dtof_data::photons::recorded::ListTimes;
use dtof_light::counts::dead_time;

/// How long each capture lasted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Length {
    /// So many laser cycles.
    Cycles(u64),
    /// So many that the brightest pixel of the capture averages this many photons a laser cycle:
    /// an assumption.
    PhotonsPerCycle(f64),
    /// Not known. The brightest pixel is taken to have one photon a laser cycle, as in a replay.
    Unknown,
}

impl Length {
    /// Whether laser cycles are known, so that rates are absolute.
    #[must_use]
    pub const fn is_known(self) -> bool {
        matches!(self, Self::Cycles(_))
    }

    /// Laser cycles of a capture whose brightest pixel, hot pixels aside, holds `brightest` photons.
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
    /// A histogram of each pixel, capture by capture.
    pub histograms: &'a Histograms,
    /// Pixels that are left out, numbered through all captures. An empty list says that all are used, hot ones, too.
    pub masked: Option<&'a [u16]>,
    /// How long each capture lasted.
    pub length: Length,
    /// Laser cycles of each pixel of each capture, in the order of the pixels, where they differ.
    /// They replace those of `length`.
    pub cycles: Option<&'a [u64]>,
    /// Picoseconds a bin.
    pub bin_width_ps: f64,
    /// The true distance in millimetres of each pixel of each capture, in the same order, where it
    /// is known.
    pub truth_mm: Option<&'a [Option<f64>]>,
    /// For each pixel of the array how many times as far as straight ahead a flat target is, along its ray. `None` if
    /// the field of view is not known.
    pub slant: Option<&'a [f64]>,
    /// For each pixel of the array the millimetres by which its ranges are and stay too long, as points subtract them.
    pub bias_mm: Option<&'a [f64]>,
    /// The offset that each pixel of the array has already, in millimetres; empty if none has.
    pub offsets_mm: &'a [f64],
    /// What a photon list tells beside the histograms; `None` if the recording has no time.
    pub times: Option<&'a ListTimes>,
}

/// One histogram.
#[derive(Clone, Debug)]
pub struct Trace {
    /// The pixel, counted from 0 in each capture.
    pub pixel: usize,
    /// Laser cycles, known or assumed.
    pub cycles: f64,
    /// Photons of each bin, corrected for pile-up where that is known.
    pub counts: Vec<f64>,
    /// The share of the laser cycles in which the TDC was live in each bin. So many of `counts` were recorded, which
    /// determines their noise.
    pub live: Vec<f64>,
    /// The true distance in millimetres, if it is known, with [`Observed::bias`].
    pub truth_mm: Option<f64>,
}

impl Trace {
    /// Corrects the counts for a TDC that is dead for so many bins after a photon.
    pub fn correct(&mut self, cycles: f64, dead_time: usize) {
        let live = dead_time::live(&self.counts, cycles, dead_time);
        self.live = live.iter().map(|live| (live / cycles).max(0.0)).collect();
        self.counts = dead_time::arrived(&self.counts, cycles, dead_time);
    }

    /// The photons of some bins, and the variance of their number.
    #[must_use]
    pub fn photons(&self, bins: RangeInclusive<usize>) -> [f64; 2] {
        let photons = self.counts[bins.clone()].iter().zip(&self.live[bins]);
        photons.fold([0.0; 2], |[sum, variance], (count, live)| {
            [sum + count, variance + count / live.max(1e-6)]
        })
    }
}

impl Observed<'_> {
    /// All histograms but those of masked pixels. The `hot` pixels do not count where the brightest pixel gives the laser
    /// cycles.
    ///
    /// # Errors
    /// Fails if there are no captures or too few bins, if a capture has other pixels than the array, if a
    /// pixel lasted no laser cycle, or if there is not one true distance for each histogram or one offset for each
    /// pixel.
    pub fn traces(&self, hot: &[usize]) -> Result<Vec<Trace>> {
        let pixels = self.array.pixels() as usize;
        let bins = self.bins();
        let all = self.histograms.len();
        ensure!(all > 0, "no captures");
        ensure!(bins > 8, "{bins} bins are too few to calibrate by");
        ensure!(
            all.is_multiple_of(pixels),
            "{all} histograms are no captures of {pixels} pixels"
        );
        if let Some(truth) = self.truth_mm {
            let found = truth.len();
            ensure!(found == all, "{found} true distances for {all} histograms");
        }
        let offsets = self.offsets_mm.len();
        ensure!(
            offsets == 0 || offsets == pixels,
            Refused::new(
                "offsets_mm",
                format!("has {offsets} numbers, but a capture has {pixels} pixels")
            )
        );
        let mut traces = Vec::with_capacity(all);
        for index in 0..self.captures() {
            let first = index * pixels;
            let others = (0..pixels).filter(|pixel| !hot.contains(pixel));
            let others = others.filter(|pixel| !self.is_masked(first + pixel));
            let totals = others.map(|pixel| self.photons(first + pixel));
            let cycles = self.length.cycles(totals.max().unwrap_or(0));
            for pixel in 0..pixels {
                let number = first + pixel;
                let own = self.cycles.map(|cycles| cycles.get(number).copied());
                let cycles = match own {
                    None => cycles,
                    Some(Some(own @ 1..)) => own as f64,
                    Some(_) => bail!("capture {index}, pixel {pixel} lasted no laser cycle"),
                };
                if self.is_masked(number) {
                    continue;
                }
                let counts = self.histograms.histogram(number).into_iter();
                let truth_mm = self.truth_mm.and_then(|truth| truth[number]);
                let truth_mm = truth_mm.map(|truth| truth + self.bias(pixel));
                traces.push(Trace {
                    pixel,
                    cycles,
                    truth_mm,
                    live: vec![1.0; bins],
                    counts: counts.map(|count| count as f64).collect(),
                });
            }
        }
        Ok(traces)
    }

    /// Whether a pixel, numbered through all captures, is left out.
    #[must_use]
    pub fn is_masked(&self, number: usize) -> bool {
        let masked = self.masked.unwrap_or(&[]);
        u16::try_from(number).is_ok_and(|number| masked.contains(&number))
    }

    /// The range bias of a pixel in millimetres, less the offset that it has already: ranges without that offset are
    /// so much too long.
    #[must_use]
    pub fn bias(&self, pixel: usize) -> f64 {
        let own = self.offsets_mm.get(pixel).unwrap_or(&0.0);
        self.bias_mm.map_or(0.0, |bias| bias[pixel]) - own
    }

    /// Bins of a histogram.
    #[must_use]
    pub const fn bins(&self) -> usize {
        self.histograms.bins()
    }

    /// Captures.
    #[must_use]
    pub fn captures(&self) -> usize {
        self.histograms.len() / self.array.pixels() as usize
    }

    /// The photons of a pixel, numbered through all captures.
    #[must_use]
    pub fn photons(&self, number: usize) -> u64 {
        self.histograms.histogram(number).iter().sum()
    }
}

#[cfg(test)]
impl<'a> Observed<'a> {
    /// Histograms of which nothing else is known.
    pub(crate) const fn plain(array: Array, histograms: &'a Histograms) -> Self {
        Self {
            array,
            histograms,
            masked: None,
            length: Length::Unknown,
            cycles: None,
            bin_width_ps: 250.0,
            truth_mm: None,
            slant: None,
            bias_mm: None,
            offsets_mm: &[],
            times: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn histograms_of_no_whole_capture_are_refused() {
        let refused = |histograms: Vec<Vec<u64>>| {
            let histograms = Histograms::of(histograms).unwrap();
            let observed = Observed::plain(Array::new(2, 2).unwrap(), &histograms);
            observed.traces(&[]).err().map(|error| error.to_string())
        };
        for (pixels, bins, expected) in [
            (8, 16, None),
            (0, 16, Some("no captures")),
            (6, 16, Some("6 histograms are no captures of 4 pixels")),
            (4, 8, Some("8 bins are too few to calibrate by")),
        ] {
            assert_eq!(refused(vec![vec![1; bins]; pixels]).as_deref(), expected);
        }
    }
}
