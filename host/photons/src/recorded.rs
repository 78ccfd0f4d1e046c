//! Recorded histograms as a photon stream.
//!
//! Poisson counts split exactly: every recorded photon is given one uniformly
//! random laser cycle of the recording, and none is used twice. Some laser cycles
//! at a time, a chunk, this is: of the photons left, each falls into this chunk of
//! the laser cycles left with the same probability, so their number is binomial;
//! which ones they are is a draw without replacement, and each has any laser cycle
//! of the chunk. The recording alone says how long a chunk is, so that slices of
//! any length hold the same photons.

mod remaining;
#[cfg(test)]
mod tests;
mod whole;

use anyhow::{Context, Result, bail, ensure};
use dtof_core::{Array, PixelAddress};
use rand_distr::uniform::{UniformInt, UniformSampler};
use rand_distr::{Binomial, Distribution};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use self::remaining::Remaining;
pub use self::whole::Whole;
use crate::source::{Photon, PhotonSource, PixelPhotons, Slice};
use dtof_options::Refused;
use dtof_theory::random::pixel_rng;

/// Photons of a histogram and laser cycles of a recording, at most: within it
/// the binomial numbers are exact to better than one in ten thousand.
const MOST: u64 = 1 << 40;
/// Photons of all pixels in one laser cycle, at most, so that they fit into
/// memory.
const MOST_A_CYCLE: f64 = 5e7;
/// Laser cycles of a chunk, at most, and about how many photons of all pixels.
const CHUNK: u16 = 2048;
const CHUNK_PHOTONS: f64 = 4e6;
/// Photons of a laser cycle that are written at once.
const AT_ONCE: usize = 4;

/// How many laser cycles a recording is taken to have lasted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RecordingLength {
    /// So many that the brightest pixel of each capture, of those that are not masked, averages
    /// this many photons a laser cycle.
    PhotonsPerCycle(f64),
    /// This many.
    Cycles(u64),
}

/// The histograms of pixels that were recorded together, one a pixel.
pub type Capture = Vec<Vec<u64>>;

/// Captures of one file, one after the other in the address space.
#[derive(Clone, Debug)]
pub struct RecordedHistograms {
    array: Array,
    sides: [&'static str; 2],
    capture_rows: u32,
    cycles: u64,
    photons_per_cycle: f64,
    /// Laser cycles of the shortest and the longest capture.
    recorded: (u64, u64),
    next_cycle: u64,
    /// Laser cycles of a chunk.
    chunk: u16,
    /// The address of the first of `pixels`.
    first: u16,
    pixels: Vec<RecordedPixel>,
}

impl RecordedHistograms {
    /// Replays `captures`, each of `array`, for at most `cycles` laser cycles.
    ///
    /// # Errors
    /// If there are more pixels than addresses, or more photons than can be
    /// counted.
    pub fn new(
        array: Array,
        captures: &[Capture],
        length: RecordingLength,
        cycles: u64,
        seed: u64,
    ) -> Result<Self> {
        Self::placed(&Whole::of(array, captures)?, captures, length, cycles, seed)
    }

    /// Replays `captures`, which are a part of `whole`, as they are replayed there.
    ///
    /// # Errors
    /// If they are no part of it, and those of [`Self::new`].
    pub fn part(
        whole: &Whole,
        captures: &[Capture],
        length: RecordingLength,
        cycles: u64,
        seed: u64,
    ) -> Result<Self> {
        let mut own = Vec::new();
        for capture in captures {
            own.extend(totals(capture)?);
        }
        whole.check(&own)?;
        Self::placed(whole, captures, length, cycles, seed)
    }

    fn placed(
        whole: &Whole,
        captures: &[Capture],
        length: RecordingLength,
        cycles: u64,
        seed: u64,
    ) -> Result<Self> {
        let (mut recorded, mut of_all) = (Vec::new(), 0.0);
        let (mut shortest, mut longest) = (u64::MAX, 0);
        let mut first = 0;
        for totals in &whole.captures {
            let is_masked = |&(pixel, _): &(usize, &u64)| {
                u16::try_from(first + pixel).is_ok_and(|pixel| whole.masked.contains(&pixel))
            };
            let looked_at = totals.iter().enumerate().filter(|pixel| !is_masked(pixel));
            let brightest = looked_at.map(|(_, &total)| total).max().unwrap_or(0);
            first += totals.len();
            let lasted = recorded_cycles(length, brightest, cycles)?;
            shortest = shortest.min(lasted);
            longest = longest.max(lasted);
            of_all += totals.iter().map(|&total| mean(total, lasted)).sum::<f64>();
            recorded.extend(totals.iter().map(|_| lasted));
        }
        let (mut pixels, mut photons_per_cycle) = (Vec::new(), 0.0);
        let recorded = recorded.into_iter().enumerate().skip(whole.first);
        for (counts, (address, recorded)) in captures.iter().flatten().zip(recorded) {
            let address = u16::try_from(address).context("more than 65,536 pixels")?;
            let left = Remaining::new(counts);
            photons_per_cycle += mean(left.photons(), recorded);
            pixels.push(RecordedPixel {
                left,
                cycles_left: recorded,
                rng: pixel_rng(seed, PixelAddress(address)),
                chunk: PixelPhotons::default(),
                given: 0,
                given_photons: 0,
            });
        }
        ensure!(
            photons_per_cycle <= MOST_A_CYCLE,
            "{photons_per_cycle:.0} photons a laser cycle are more than {MOST_A_CYCLE:.0}"
        );
        Ok(Self {
            array: whole.array,
            sides: ["column", "row"],
            capture_rows: whole.capture_rows()?,
            photons_per_cycle,
            cycles: cycles.min(longest),
            recorded: (shortest, longest),
            next_cycle: 0,
            chunk: chunk(of_all),
            first: u16::try_from(whole.first).context("more than 65,536 pixels")?,
            pixels,
        })
    }

    /// With other names for columns and rows.
    #[must_use]
    pub fn with_sides(self, sides: [&'static str; 2]) -> Self {
        Self { sides, ..self }
    }
}

/// Photons of each pixel of a capture.
fn totals(capture: &Capture) -> Result<Vec<u64>> {
    let add = |sum: u64, &count: &u64| sum.checked_add(count);
    let totals = capture.iter().map(|counts| counts.iter().try_fold(0, add));
    totals
        .collect::<Option<Vec<u64>>>()
        .filter(|totals| totals.iter().all(|&total| total <= MOST))
        .context("a histogram holds more than 2^40 photons")
}

/// Photons a laser cycle.
fn mean(photons: u64, cycles: u64) -> f64 {
    photons as f64 / cycles.max(1) as f64
}

/// Laser cycles of a chunk, if all pixels have so many photons a laser cycle.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "1 to CHUNK"
)]
fn chunk(photons_per_cycle: f64) -> u16 {
    (CHUNK_PHOTONS / photons_per_cycle).clamp(1.0, CHUNK.into()) as u16
}

/// Laser cycles of a capture whose brightest pixel holds `brightest` photons.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn recorded_cycles(length: RecordingLength, brightest: u64, wanted: u64) -> Result<u64> {
    match length {
        RecordingLength::Cycles(cycles) => {
            ensure!(
                cycles <= MOST,
                Refused::value("recorded_cycles", cycles, "must be at most 2^40")
            );
            Ok(cycles)
        }
        // Without a photon every length is the same; last as long as asked for.
        RecordingLength::PhotonsPerCycle(_) if brightest == 0 => Ok(wanted),
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
            Ok(cycles as u64)
        }
    }
}

impl PhotonSource for RecordedHistograms {
    fn array(&self) -> Array {
        self.array
    }

    fn sides(&self) -> [&'static str; 2] {
        self.sides
    }

    fn capture_rows(&self) -> u32 {
        self.capture_rows
    }

    fn addresses(&self) -> Vec<PixelAddress> {
        let there = (self.first..=u16::MAX).take(self.pixels.len());
        there.map(PixelAddress).collect()
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

    fn spare(&mut self, is_wanted: &dyn Fn(PixelAddress) -> bool) {
        for (address, pixel) in self.addresses().into_iter().zip(&mut self.pixels) {
            if !is_wanted(address) {
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

/// One pixel's photons that have not been used.
#[derive(Clone, Debug)]
struct RecordedPixel {
    /// Of the laser cycles after the chunk.
    left: Remaining,
    cycles_left: u64,
    rng: Pcg64,
    /// Some laser cycles.
    chunk: PixelPhotons,
    /// Laser cycles and photons of the chunk that slices have had.
    given: u16,
    given_photons: usize,
}

impl RecordedPixel {
    fn photons_left(&self) -> u64 {
        let in_chunk = self.chunk.photons.len() - self.given_photons;
        self.left.photons() + in_chunk as u64
    }

    /// The next `cycles` laser cycles, from chunks of `chunk`.
    fn next_cycles(&mut self, cycles: u16, chunk: u16) -> Result<PixelPhotons> {
        let mut received = PixelPhotons::default();
        while received.cycles < cycles {
            if self.given == self.chunk.cycles {
                self.next_chunk(chunk)?;
                if self.chunk.cycles == 0 {
                    break;
                }
            }
            let taken = (self.chunk.cycles - self.given).min(cycles - received.cycles);
            let end = self.given + taken;
            let left = &self.chunk.photons[self.given_photons..];
            let next = left.iter().take_while(|photon| photon.cycle < end).count();
            let next = &left[..next];
            let (from, to) = (self.given, received.cycles);
            received.photons.extend(next.iter().map(|photon| Photon {
                cycle: to + (photon.cycle - from),
                code: photon.code,
            }));
            self.given_photons += next.len();
            self.given = end;
            received.cycles += taken;
        }
        Ok(received)
    }

    /// Draws the photons of the next `cycles` laser cycles, or of all there are.
    fn next_chunk(&mut self, cycles: u16) -> Result<()> {
        let cycles = u16::try_from(self.cycles_left).map_or(cycles, |left| left.min(cycles));
        (self.given, self.given_photons) = (0, 0);
        self.chunk.cycles = cycles;
        self.chunk.photons.clear();
        if cycles == 0 {
            return Ok(());
        }
        let share = f64::from(cycles) / self.cycles_left as f64;
        let count = Binomial::new(self.left.photons(), share)?.sample(&mut self.rng);
        self.cycles_left -= u64::from(cycles);
        // A laser cycle for each. As any photon may have any of them, how many fall into each
        // says enough.
        let mut of_cycle = [0u32; CHUNK as usize];
        for _ in 0..count {
            let cycle = UniformInt::<u16>::sample_single(0, cycles, &mut self.rng)?;
            of_cycle[usize::from(cycle)] += 1;
        }
        let photons = &mut self.chunk.photons;
        for _ in 0..count {
            let Some(code) = self.left.draw(&mut self.rng) else {
                bail!("a photon too few");
            };
            photons.push(Photon { cycle: 0, code });
        }
        let all = photons.len();
        // Most laser cycles have few photons: to write some too many, which the next laser
        // cycles have, is faster than to ask each time.
        photons.resize(all + AT_ONCE, Photon { cycle: 0, code: 0 });
        let mut next = 0;
        for (cycle, &count) in (0..cycles).zip(&of_cycle) {
            for photon in &mut photons[next..next + AT_ONCE] {
                photon.cycle = cycle;
            }
            let end = next + count as usize;
            if count as usize > AT_ONCE {
                for photon in &mut photons[next + AT_ONCE..end] {
                    photon.cycle = cycle;
                }
            }
            next = end;
        }
        photons.truncate(all);
        Ok(())
    }
}
