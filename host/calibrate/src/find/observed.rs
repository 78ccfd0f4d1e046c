//! The input of a calibration: whole histograms, and how long they took.

use std::ops::RangeInclusive;

use anyhow::{Result, bail, ensure};
use dtof_core::Array;

use dtof_options::Refused;
use dtof_photons::recorded::{Capture, ListTimes};
use dtof_theory::counts::dead_time;

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
    /// Histograms: capture, then pixel, then bin.
    pub captures: &'a [Capture],
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
    /// Fails if there are no captures or too few bins, if captures or histograms differ in size, if a
    /// pixel lasted no laser cycle, or if there is not one true distance for each histogram or one offset for each
    /// pixel.
    pub fn traces(&self, hot: &[usize]) -> Result<Vec<Trace>> {
        let pixels = self.array.pixels() as usize;
        let bins = self.bins();
        ensure!(!self.captures.is_empty(), "no captures");
        ensure!(bins > 8, "{bins} bins are too few to calibrate by");
        let all = self.captures.len() * pixels;
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
        for (index, capture) in self.captures.iter().enumerate() {
            let found = capture.len();
            ensure!(
                found == pixels,
                "capture {index} has {found} pixels, not {pixels}"
            );
            let others = capture.iter().enumerate();
            let others = others.filter(|(pixel, _)| !hot.contains(pixel));
            let others = others.filter(|(pixel, _)| !self.is_masked(index * pixels + pixel));
            let totals = others.map(|(_, counts)| counts.iter().sum::<u64>());
            let cycles = self.length.cycles(totals.max().unwrap_or(0));
            for (pixel, counts) in capture.iter().enumerate() {
                let number = index * pixels + pixel;
                let own = self.cycles.map(|cycles| cycles.get(number).copied());
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
                if self.is_masked(number) {
                    continue;
                }
                let truth_mm = self.truth_mm.and_then(|truth| truth[number]);
                let truth_mm = truth_mm.map(|truth| truth + self.bias(pixel));
                traces.push(Trace {
                    pixel,
                    cycles,
                    truth_mm,
                    live: vec![1.0; bins],
                    counts: counts.iter().map(|&count| count as f64).collect(),
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

    /// Bins of a histogram; 0 if there is none.
    #[must_use]
    pub fn bins(&self) -> usize {
        let first = self.captures.first().and_then(|capture| capture.first());
        first.map_or(0, Vec::len)
    }
}
