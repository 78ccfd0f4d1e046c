//! Recorded histograms as a photon stream.
//!
//! Poisson counts split exactly: every recorded photon is given one uniformly
//! random laser cycle of the recording, and none is used twice. Laser cycle by
//! laser cycle this is: of the photons left, each falls into this one of the
//! laser cycles left with the same probability, so their number is binomial;
//! which ones they are is a draw without replacement.

use anyhow::{Context, Result, ensure};
use dtof_core::PixelAddress;
use rand_distr::{Binomial, Distribution, Uniform};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use crate::input::source::{Geometry, Photon, PhotonSource, PixelPhotons, Slice};
use dtof_theory::random::pixel_rng;

/// Photons of a histogram and laser cycles of a recording, at most: within it
/// the binomial numbers are exact to better than one in ten thousand.
const MOST: u64 = 1 << 40;
/// Photons of all pixels in one laser cycle, at most, so that they fit into
/// memory.
const MOST_A_CYCLE: f64 = 5e7;

/// How many laser cycles a recording is taken to have lasted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RecordingLength {
    /// So many that the brightest pixel of each capture averages this many
    /// photons a laser cycle.
    PhotonsPerCycle(f64),
    /// This many.
    Cycles(u64),
}

/// The histograms of pixels that were recorded together, one a pixel.
pub type Capture = Vec<Vec<u64>>;

/// Captures of one file, one after the other in the address space.
#[derive(Clone, Debug)]
pub struct RecordedHistograms {
    geometry: Geometry,
    sides: [&'static str; 2],
    cycles: u64,
    photons_per_cycle: f64,
    /// Laser cycles of the shortest and the longest capture.
    recorded: (u64, u64),
    next_cycle: u64,
    pixels: Vec<RecordedPixel>,
}

impl RecordedHistograms {
    /// Replays `captures` for at most `cycles` laser cycles.
    ///
    /// # Errors
    /// If there are more pixels than addresses, or more photons than can be
    /// counted.
    pub fn new(
        geometry: Geometry,
        captures: &[Capture],
        length: RecordingLength,
        cycles: u64,
        seed: u64,
    ) -> Result<Self> {
        let mut pixels = Vec::new();
        let mut photons_per_cycle = 0.0;
        let (mut shortest, mut longest) = (u64::MAX, 0);
        for capture in captures {
            let add = |sum: u64, &count| sum.checked_add(count);
            let totals = capture.iter().map(|counts| counts.iter().try_fold(0, add));
            let totals = totals
                .collect::<Option<Vec<u64>>>()
                .filter(|totals| totals.iter().all(|&total| total <= MOST))
                .context("a histogram holds more than 2^40 photons")?;
            let brightest = totals.iter().copied().max().unwrap_or(0);
            let recorded = recorded_cycles(length, brightest, cycles)?;
            shortest = shortest.min(recorded);
            longest = longest.max(recorded);
            let mean = |total: &u64| *total as f64 / recorded.max(1) as f64;
            photons_per_cycle += totals.iter().map(mean).sum::<f64>();
            for (counts, total) in capture.iter().zip(totals) {
                let address = u16::try_from(pixels.len()).context("more than 65,536 pixels")?;
                pixels.push(RecordedPixel {
                    left: Remaining::new(counts),
                    photons_left: total,
                    cycles_left: recorded,
                    rng: pixel_rng(seed, PixelAddress(address)),
                });
            }
        }
        ensure!(
            photons_per_cycle <= MOST_A_CYCLE,
            "{photons_per_cycle:.0} photons a laser cycle are more than {MOST_A_CYCLE:.0}"
        );
        Ok(Self {
            geometry,
            sides: ["column", "row"],
            photons_per_cycle,
            cycles: cycles.min(longest),
            recorded: (shortest, longest),
            next_cycle: 0,
            pixels,
        })
    }

    /// With other names for columns and rows.
    #[must_use]
    pub fn with_sides(self, sides: [&'static str; 2]) -> Self {
        Self { sides, ..self }
    }
}

/// Laser cycles of a capture whose brightest pixel holds `brightest` photons.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn recorded_cycles(length: RecordingLength, brightest: u64, wanted: u64) -> Result<u64> {
    match length {
        RecordingLength::Cycles(cycles) => {
            ensure!(
                cycles <= MOST,
                "--recorded-cycles {cycles} is more than 2^40"
            );
            Ok(cycles)
        }
        // Without a photon every length is the same; last as long as asked for.
        RecordingLength::PhotonsPerCycle(_) if brightest == 0 => Ok(wanted),
        RecordingLength::PhotonsPerCycle(rate) => {
            let cycles = (brightest as f64 / rate).round().max(1.0);
            ensure!(
                cycles <= MOST as f64,
                "--photons-per-cycle {rate} makes the recording longer than 2^40 laser cycles"
            );
            Ok(cycles as u64)
        }
    }
}

impl PhotonSource for RecordedHistograms {
    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn sides(&self) -> [&'static str; 2] {
        self.sides
    }

    fn cycles(&self) -> u64 {
        self.cycles
    }

    fn photons_per_cycle(&self) -> f64 {
        self.photons_per_cycle
    }

    fn not_replayed(&self) -> u64 {
        self.pixels.iter().map(|pixel| pixel.photons_left).sum()
    }

    fn recorded_cycles(&self) -> Option<(u64, u64)> {
        Some(self.recorded)
    }

    fn next_slice(&mut self, cycles: u16) -> Result<Slice> {
        let first_cycle = self.next_cycle;
        self.next_cycle += u64::from(cycles);
        let pixels = self
            .pixels
            .par_iter_mut()
            .map(|pixel| pixel.next_cycles(cycles));
        Ok(Slice {
            first_cycle,
            pixels: pixels.collect::<Result<_>>()?,
        })
    }
}

/// One pixel's photons that have not been used.
#[derive(Clone, Debug)]
struct RecordedPixel {
    left: Remaining,
    photons_left: u64,
    cycles_left: u64,
    rng: Pcg64,
}

impl RecordedPixel {
    fn next_cycles(&mut self, cycles: u16) -> Result<PixelPhotons> {
        let mut received = PixelPhotons::default();
        while received.cycles < cycles && self.cycles_left > 0 {
            let share = 1.0 / self.cycles_left as f64;
            let count = Binomial::new(self.photons_left, share)?.sample(&mut self.rng);
            for _ in 0..count {
                let nth = Uniform::new(0, self.photons_left)?.sample(&mut self.rng);
                let code = self.left.take(nth);
                self.photons_left -= 1;
                received.photons.push(Photon {
                    cycle: received.cycles,
                    code,
                });
            }
            self.cycles_left -= 1;
            received.cycles += 1;
        }
        Ok(received)
    }
}

/// A histogram from which the n-th photon can be taken: a binary tree whose
/// node `i` holds the photons below it, its children being `2i` and `2i + 1`,
/// the bins its leaves.
#[derive(Clone, Debug)]
struct Remaining {
    tree: Vec<u64>,
}

impl Remaining {
    fn new(counts: &[u64]) -> Self {
        let leaves = counts.len().next_power_of_two();
        let mut tree = vec![0; 2 * leaves];
        tree[leaves..leaves + counts.len()].copy_from_slice(counts);
        for node in (1..leaves).rev() {
            tree[node] = tree[2 * node] + tree[2 * node + 1];
        }
        Self { tree }
    }

    /// Takes the `nth` of the photons left, counted from bin 0, and gives its
    /// bin.
    fn take(&mut self, mut nth: u64) -> u16 {
        let leaves = self.tree.len() / 2;
        let mut node = 1;
        loop {
            self.tree[node] -= 1;
            if node >= leaves {
                break u16::try_from(node - leaves).expect("no more than 1024 bins");
            }
            node *= 2;
            if nth >= self.tree[node] {
                nth -= self.tree[node];
                node += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A capture of pixels in a row.
    fn recorded(capture: Capture, cycles: u64, seed: u64) -> Result<RecordedHistograms> {
        let geometry = Geometry::new(u32::try_from(capture.len())?, 1);
        let length = RecordingLength::Cycles(cycles);
        RecordedHistograms::new(geometry, &[capture], length, u64::MAX, seed)
    }

    fn replay(counts: &[u64], cycles: u64) -> Vec<Photon> {
        let mut source = recorded(vec![counts.to_vec()], cycles, 7).unwrap();
        let slice = source.next_slice(u16::MAX).unwrap();
        assert_eq!(u64::from(slice.pixels[0].cycles), cycles);
        slice.pixels[0].photons.clone()
    }

    #[test]
    fn every_recorded_photon_is_used_exactly_once() {
        let counts = [3, 0, 500, 1, 0, 0, 77, 2];
        let photons = replay(&counts, 100);
        let mut replayed = [0; 8];
        for photon in &photons {
            replayed[usize::from(photon.code)] += 1;
        }
        assert_eq!(replayed, counts);
        assert!(photons.is_sorted_by_key(|photon| photon.cycle));
    }

    #[test]
    fn equal_pixels_and_other_seeds_receive_other_photons() {
        let photons = |seed| {
            let mut source = recorded(vec![vec![100; 8]; 2], 1000, seed).unwrap();
            source.next_slice(1000).unwrap().pixels
        };
        let (one, other) = (photons(1), photons(2));
        let all = [&one[0], &one[1], &other[0], &other[1]];
        for (index, pixel) in all.iter().enumerate() {
            assert_eq!(pixel.photons.len(), 800);
            assert!(all[..index].iter().all(|before| before != pixel));
        }
    }

    #[test]
    fn what_does_not_fit_into_memory_is_refused() {
        let refused = |count: u64, cycles| recorded(vec![vec![count; 8]], cycles, 1).is_err();
        assert!(refused(1 << 38, 1 << 40));
        assert!(refused(1 << 30, 1));
        assert!(refused(1, (1 << 40) + 1));
        assert!(!refused(1 << 30, 1 << 20));
    }

    #[test]
    fn photons_fall_evenly_over_the_laser_cycles_whatever_their_bin() {
        // 100,000 photons over 10 laser cycles: 5,000 a bin and laser cycle in
        // two bins, standard deviation 67; five of them are 335.
        let mut cells = [[0i64; 2]; 10];
        for photon in replay(&[50_000, 0, 0, 0, 0, 0, 0, 50_000], 10) {
            cells[usize::from(photon.cycle)][usize::from(photon.code) / 7] += 1;
        }
        for cell in cells.as_flattened() {
            assert!((cell - 5_000).abs() < 335, "{cells:?}");
        }
    }
}
