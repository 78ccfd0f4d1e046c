//! Recorded histograms as a stream of photons.
//!
//! Poisson counts split exactly: every recorded photon gets one uniformly random laser cycle of the
//! recording. Photons are drawn a chunk of laser cycles at a time. Each remaining photon falls into
//! the chunk with equal probability, so their number is binomial. Which photons they are is a draw
//! without replacement, and each gets a random laser cycle of the chunk. The chunk length depends
//! on the recording alone, so slices of any length hold the same photons.
//!
//! The photons of a TDC with a dead time are drawn laser cycle by laser cycle: see
//! [`RecordedHistograms::with_dead_time`].

mod hits;
mod remaining;
#[cfg(test)]
mod tests;

use std::iter::repeat_n;

use anyhow::{Context, Result, bail, ensure};
use dtof_core::{Array, PixelAddress};
use rand_distr::uniform::{UniformInt, UniformSampler};
use rand_distr::{Binomial, Distribution};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use self::hits::Hits;
use self::remaining::Remaining;
use crate::options::Refused;
use crate::photons::histograms::Histograms;
use crate::photons::list_checks::ListChecks;
use crate::photons::source::{Photon, PhotonSource, PixelPhotons, Slice};
use crate::random::pixel_rng;

/// The most photons of a histogram, and the most laser cycles of a recording. Up to here, binomial
/// numbers are exact to better than one in ten thousand.
const MOST: u64 = 1 << 40;
/// The most photons of all pixels in one laser cycle, so that they fit into memory.
const MOST_A_CYCLE: f64 = 5e7;
/// The most laser cycles of a chunk, and about the photons of all pixels in a chunk.
const CHUNK: u16 = 2048;
const CHUNK_PHOTONS: f64 = 4e6;
/// Laser cycles of a recording without photons, which do not show its length.
const CYCLES_WITHOUT_PHOTONS: u64 = 10_000;
/// How many photons of a laser cycle are written without a check.
const AT_ONCE: usize = 4;

/// The assumed length of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RecordingLength {
    /// Photons a laser cycle of the brightest pixel of each capture that is not masked.
    PhotonsPerCycle(f64),
    /// Laser cycles.
    Cycles(u64),
}

/// What a photon list tells beside its histograms.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ListTimes {
    /// The photons of all pixels in each quarter of the laser cycles, bin by bin.
    pub quarters: Vec<[u64; 4]>,
    /// Photons whose pixel had another before in the same laser cycle.
    pub again: u64,
    /// What is wrong with them.
    pub checks: ListChecks,
}

/// The captures of a file, which follow each other in the address space.
#[derive(Clone, Debug)]
pub struct RecordedHistograms {
    array: Array,
    /// What a column and a row of the array are called, for people.
    axis_names: [&'static str; 2],
    capture_rows: u32,
    cycles: u64,
    photons_per_cycle: f64,
    /// Laser cycles of the shortest and the longest capture.
    recorded: (u64, u64),
    next_cycle: u64,
    /// Laser cycles of a chunk.
    chunk: u16,
    pixels: Vec<RecordedPixel>,
}

impl RecordedHistograms {
    /// Replays `histograms`, one of each pixel of `array` for each capture, for at most `cycles` laser cycles.
    ///
    /// # Errors
    /// Fails if there are no captures, pixels without a histogram, more pixels than addresses, or more photons
    /// than can be counted.
    pub fn new(
        array: Array,
        histograms: &Histograms,
        length: RecordingLength,
        cycles: u64,
        seed: u64,
    ) -> Result<Self> {
        Self::with_masked(array, histograms, length, cycles, seed, &[])
    }

    /// The same, with pixels that do not count for the length, such as hot ones. `masked` are their addresses.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn with_masked(
        array: Array,
        histograms: &Histograms,
        length: RecordingLength,
        cycles: u64,
        seed: u64,
        masked: &[u16],
    ) -> Result<Self> {
        ensure!(!histograms.is_empty(), "no captures");
        let each = array.pixels() as usize;
        let are_complete = histograms.len().is_multiple_of(each);
        ensure!(are_complete, "a capture does not have {each} histograms");
        let rows = u32::try_from(histograms.len() / each)?.saturating_mul(array.rows());
        let all = Array::new(array.columns(), rows).context("more than 65,536 pixels")?;
        let totals = totals(histograms)?;
        let is_masked = |pixel: usize| u16::try_from(pixel).is_ok_and(|own| masked.contains(&own));
        let mut lengths = Vec::new();
        for (capture, totals) in totals.chunks(each).enumerate() {
            let unmasked = (capture * each..).zip(totals);
            let unmasked = unmasked.filter(|(pixel, _)| !is_masked(*pixel));
            let brightest = unmasked.map(|(_, &total)| total).max().unwrap_or(0);
            lengths.push(recorded_cycles(length, brightest)?);
        }
        // A capture without photons does not make a replay longer.
        let longest = lengths.iter().flatten().copied().max();
        let longest = longest.unwrap_or_else(|| cycles.min(CYCLES_WITHOUT_PHOTONS));
        let lengths = lengths.iter().map(|length| length.unwrap_or(longest));
        let shortest = lengths.clone().min().unwrap_or(longest);
        let (mut pixels, mut photons_per_cycle) = (Vec::new(), 0.0);
        let lengths = lengths.flat_map(|length| repeat_n(length, each));
        let addresses = (0..=u16::MAX).map(PixelAddress::new);
        for (((address, counts), total), recorded) in
            addresses.zip(histograms.iter()).zip(totals).zip(lengths)
        {
            photons_per_cycle += mean(total, recorded);
            pixels.push(RecordedPixel {
                remaining: Remaining::new(&counts),
                hits: None,
                cycles_left: recorded,
                rng: pixel_rng(seed, address),
                chunk: PixelPhotons::default(),
                replayed_cycles: 0,
                replayed_photons: 0,
            });
        }
        ensure!(
            photons_per_cycle <= MOST_A_CYCLE,
            "{photons_per_cycle:.0} photons a laser cycle are more than {MOST_A_CYCLE:.0}"
        );
        Ok(Self {
            array: all,
            axis_names: ["column", "row"],
            capture_rows: array.rows(),
            photons_per_cycle,
            cycles: cycles.min(longest),
            recorded: (shortest, longest),
            next_cycle: 0,
            chunk: chunk(photons_per_cycle),
            pixels,
        })
    }

    /// The photons of a TDC that was blind for `dead_time` bins after each, as the same `histograms` have them: no
    /// laser cycle has a photon in the dead time of another. With 0 nothing changes.
    ///
    /// # Errors
    /// Fails if a pixel that is not `masked` has more photons in a bin than laser cycles in which it was
    /// live.
    pub fn with_dead_time(
        mut self,
        histograms: &Histograms,
        masked: &[u16],
        dead_time: u16,
    ) -> Result<Self> {
        if dead_time == 0 {
            return Ok(self);
        }
        let pixels = self.pixels.iter_mut().zip(histograms.iter());
        for (address, (pixel, counts)) in (0..=u16::MAX).zip(pixels) {
            let hits = Hits::new(&counts, dead_time);
            let cycles = pixel.cycles_left;
            if let Some((bin, live)) = hits.contradiction(cycles)
                && !masked.contains(&address)
            {
                let reason = format!(
                    "bin {bin} of pixel {address} has {} photons, but was live in {live} of {cycles} laser \
                     cycles; give the laser cycles with `recorded_cycles`, a shorter dead time, or leave the pixel out with \
                     `masked` {address}",
                    counts[bin]
                );
                return Err(Refused::value("dead_time", dead_time, reason).into());
            }
            pixel.hits = Some(hits);
        }
        Ok(self)
    }

    /// Laser cycles of each pixel that have not been drawn: those of its recording, before the first slice.
    #[must_use]
    pub fn cycles_left(&self) -> Vec<u64> {
        self.pixels.iter().map(|pixel| pixel.cycles_left).collect()
    }

    /// Renames columns and rows.
    #[must_use]
    pub fn with_axis_names(self, axis_names: [&'static str; 2]) -> Self {
        Self { axis_names, ..self }
    }
}

/// Checks that the photons of each pixel can be counted.
///
/// # Errors
/// Names the first pixel with more.
pub fn check_totals(histograms: &Histograms) -> Result<()> {
    totals(histograms).map(drop)
}

/// Photons of each pixel.
fn totals(histograms: &Histograms) -> Result<Vec<u64>> {
    let add = |sum: u64, count: &u64| sum.checked_add(*count);
    let total = |(pixel, counts): (usize, Vec<u64>)| {
        let total = counts.iter().try_fold(0, add);
        let total = total.filter(|&total| total <= MOST);
        total.with_context(|| format!("pixel {pixel} holds more than 2^40 photons"))
    };
    histograms.iter().enumerate().map(total).collect()
}

/// Photons a laser cycle.
fn mean(photons: u64, cycles: u64) -> f64 {
    photons as f64 / cycles.max(1) as f64
}

/// Laser cycles of a chunk, for so many photons a laser cycle of all pixels.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "1 to CHUNK"
)]
fn chunk(photons_per_cycle: f64) -> u16 {
    (CHUNK_PHOTONS / photons_per_cycle).clamp(1.0, CHUNK.into()) as u16
}

/// Laser cycles of a capture whose brightest pixel holds `brightest` photons; `None` if only photons would show them.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn recorded_cycles(length: RecordingLength, brightest: u64) -> Result<Option<u64>> {
    match length {
        RecordingLength::Cycles(cycles) => {
            ensure!(
                cycles <= MOST,
                Refused::value("recorded_cycles", cycles, "must be at most 2^40")
            );
            Ok(Some(cycles))
        }
        RecordingLength::PhotonsPerCycle(_) if brightest == 0 => Ok(None),
        RecordingLength::PhotonsPerCycle(rate) => {
            let cycles = (brightest as f64 / rate).round().max(1.0);
            ensure!(
                cycles <= MOST as f64,
                Refused::value(
                    "photons_per_cycle",
                    rate,
                    "makes the recording longer than 2^40 laser cycles"
                )
            );
            Ok(Some(cycles as u64))
        }
    }
}

impl PhotonSource for RecordedHistograms {
    fn array(&self) -> Array {
        self.array
    }

    fn axis_names(&self) -> [&'static str; 2] {
        self.axis_names
    }

    fn capture_rows(&self) -> u32 {
        self.capture_rows
    }

    fn addresses(&self) -> Vec<PixelAddress> {
        let addresses = (0..=u16::MAX).take(self.pixels.len());
        addresses.map(PixelAddress::new).collect()
    }

    fn cycles(&self) -> u64 {
        self.cycles
    }

    fn photons_per_cycle(&self) -> f64 {
        self.photons_per_cycle
    }

    fn not_replayed(&self) -> u64 {
        self.pixels.iter().map(RecordedPixel::photons_left).sum()
    }

    fn recorded_cycles(&self) -> Option<(u64, u64)> {
        Some(self.recorded)
    }

    fn limit_to(&mut self, is_needed: &dyn Fn(PixelAddress) -> bool) {
        for (address, pixel) in self.addresses().into_iter().zip(&mut self.pixels) {
            if !is_needed(address) {
                pixel.cycles_left = 0;
            }
        }
    }

    fn next_slice(&mut self, cycles: u16) -> Result<Slice> {
        let first_cycle = self.next_cycle;
        self.next_cycle += u64::from(cycles);
        let chunk = self.chunk;
        let pixels = self
            .pixels
            .par_iter_mut()
            .map(|pixel| pixel.next_cycles(cycles, chunk));
        Ok(Slice {
            first_cycle,
            pixels: pixels.collect::<Result<_>>()?,
        })
    }
}

/// The photons of a pixel that have not been replayed.
#[derive(Clone, Debug)]
struct RecordedPixel {
    /// Photons of the laser cycles after the chunk.
    remaining: Remaining,
    /// The same with a dead time, instead.
    hits: Option<Hits>,
    cycles_left: u64,
    rng: Pcg64,
    /// The chunk: its laser cycles and photons.
    chunk: PixelPhotons,
    /// Laser cycles and photons of the chunk that have been replayed.
    replayed_cycles: u16,
    replayed_photons: usize,
}

impl RecordedPixel {
    fn photons_left(&self) -> u64 {
        let in_chunk = self.chunk.photons.len() - self.replayed_photons;
        let remaining = match &self.hits {
            Some(hits) => hits.photons(),
            None => self.remaining.photons(),
        };
        remaining + in_chunk as u64
    }

    /// The next `cycles` laser cycles, from chunks of `chunk` laser cycles.
    fn next_cycles(&mut self, cycles: u16, chunk: u16) -> Result<PixelPhotons> {
        let mut received = PixelPhotons::default();
        loop {
            let taken = (self.chunk.cycles - self.replayed_cycles).min(cycles - received.cycles);
            let end = self.replayed_cycles + taken;
            let left = &self.chunk.photons[self.replayed_photons..];
            let next = left.iter().take_while(|photon| photon.cycle < end).count();
            let next = &left[..next];
            let (from, to) = (self.replayed_cycles, received.cycles);
            received.photons.extend(next.iter().map(|photon| Photon {
                cycle: to + (photon.cycle - from),
                code: photon.code,
            }));
            self.replayed_photons += next.len();
            self.replayed_cycles = end;
            received.cycles += taken;
            if received.cycles == cycles {
                return Ok(received);
            }
            self.next_chunk(chunk)?;
            // The recording ends.
            if self.chunk.cycles == 0 {
                return Ok(received);
            }
        }
    }

    /// Draws the photons of the next `cycles` laser cycles, or of all that are left.
    fn next_chunk(&mut self, cycles: u16) -> Result<()> {
        let cycles = u16::try_from(self.cycles_left).map_or(cycles, |left| left.min(cycles));
        (self.replayed_cycles, self.replayed_photons) = (0, 0);
        self.chunk.cycles = cycles;
        self.chunk.photons.clear();
        if cycles == 0 {
            return Ok(());
        }
        if let Some(hits) = &mut self.hits {
            for cycle in 0..cycles {
                let photons = &mut self.chunk.photons;
                #[allow(clippy::cast_possible_truncation, reason = "at most 1024 bins")]
                hits.draw(self.cycles_left, &mut self.rng, |bin| {
                    let code = bin as u16;
                    photons.push(Photon { cycle, code });
                });
                self.cycles_left -= 1;
            }
            return Ok(());
        }
        let share = f64::from(cycles) / self.cycles_left as f64;
        let count = Binomial::new(self.remaining.photons(), share)?.sample(&mut self.rng);
        self.cycles_left -= u64::from(cycles);
        // Draws a laser cycle for each photon. Photons are interchangeable, so only the number in
        // each laser cycle matters.
        let mut photons_in_cycle = [0u32; CHUNK as usize];
        for _ in 0..count {
            let cycle = UniformInt::<u16>::sample_single(0, cycles, &mut self.rng)?;
            photons_in_cycle[usize::from(cycle)] += 1;
        }
        let photons = &mut self.chunk.photons;
        for _ in 0..count {
            let Some(code) = self.remaining.draw(&mut self.rng) else {
                bail!("the histogram has too few photons");
            };
            photons.push(Photon { cycle: 0, code });
        }
        let all = photons.len();
        // Most laser cycles have few photons. It is faster to write `AT_ONCE` of them without a
        // check; the next laser cycle overwrites those too many.
        photons.resize(all + AT_ONCE, Photon { cycle: 0, code: 0 });
        let mut next = 0;
        for (cycle, &count) in (0..cycles).zip(&photons_in_cycle) {
            for photon in &mut photons[next..next + AT_ONCE] {
                photon.cycle = cycle;
            }
            let end = next + count as usize;
            for photon in photons[next..end].iter_mut().skip(AT_ONCE) {
                photon.cycle = cycle;
            }
            next = end;
        }
        photons.truncate(all);
        Ok(())
    }
}
