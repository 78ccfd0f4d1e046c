//! The photons of pixels, bin by bin, summed over laser cycles.

use std::ops::Range;

use rayon::prelude::*;

use crate::photons::histograms::{Histograms, add};
use crate::photons::source::Slice;

/// All photons of some pixels.
pub trait AllPhotons: Sync {
    /// Adds the histogram of pixel number `place` to `sum`. Sums saturate.
    fn add_to(&self, place: usize, sum: &mut [u64]);

    /// The laser cycles of pixel number `place`.
    fn cycles(&self, place: usize) -> u64;
}

/// Recorded histograms, and the laser cycles of each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedCounts {
    /// The histograms.
    pub histograms: Histograms,
    /// The laser cycles of each histogram.
    pub cycles: Vec<u64>,
}

impl AllPhotons for RecordedCounts {
    fn add_to(&self, place: usize, sum: &mut [u64]) {
        self.histograms.add_to(place, sum);
    }

    fn cycles(&self, place: usize) -> u64 {
        self.cycles[place]
    }
}

impl AllPhotons for PixelCounts {
    fn add_to(&self, place: usize, sum: &mut [u64]) {
        add(sum, Some(self.histogram(place)));
    }

    fn cycles(&self, place: usize) -> u64 {
        self.cycles[place]
    }
}

/// A histogram of each pixel, of photons that come slice by slice. It takes 4 bytes a bin, whatever the number of photons.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PixelCounts {
    bins: usize,
    counts: Vec<u32>,
    /// Laser cycles of each pixel.
    cycles: Vec<u64>,
    /// Photons past the last bin.
    rejected: u64,
}

impl PixelCounts {
    /// No photons of so many pixels with `bins` bins each.
    #[must_use]
    pub fn new(pixels: usize, bins: usize) -> Self {
        Self {
            bins,
            counts: vec![0; pixels * bins],
            cycles: vec![0; pixels],
            rejected: 0,
        }
    }

    /// Adds the photons of the laser cycles `span` of a slice.
    pub fn add_span(&mut self, slice: &Slice, span: Range<u64>) {
        let [start, end] =
            [span.start, span.end].map(|cycle| cycle.saturating_sub(slice.first_cycle));
        let pixels = self.counts.par_chunks_mut(self.bins.max(1));
        let pixels = pixels.zip(&mut self.cycles).zip(&slice.pixels);
        let rejected = pixels.map(|((counts, cycles), received)| {
            let received_cycles = u64::from(received.cycles);
            *cycles += received_cycles.min(end) - received_cycles.min(start);
            let until = |end: u64| {
                let photons = &received.photons;
                photons.partition_point(|photon| u64::from(photon.cycle) < end)
            };
            let mut rejected = 0;
            for photon in &received.photons[until(start)..until(end)] {
                match counts.get_mut(usize::from(photon.code)) {
                    Some(count) => *count = count.saturating_add(1),
                    None => rejected += 1,
                }
            }
            rejected
        });
        self.rejected += rejected.sum::<u64>();
    }

    /// Adds the photons of a slice.
    pub fn add(&mut self, slice: &Slice) {
        self.add_span(slice, 0..u64::MAX);
    }

    /// These photons and those of `other`, of the same pixels.
    #[must_use]
    pub fn with(mut self, other: &Self) -> Self {
        for (count, other) in self.counts.iter_mut().zip(&other.counts) {
            *count = count.saturating_add(*other);
        }
        for (cycles, other) in self.cycles.iter_mut().zip(&other.cycles) {
            *cycles += other;
        }
        self.rejected += other.rejected;
        self
    }

    /// The photons of all pixels, bin by bin.
    #[must_use]
    pub fn sum(&self) -> Vec<u64> {
        let mut sum = vec![0; self.bins];
        for counts in self.counts.chunks(self.bins.max(1)) {
            for (sum, &count) in sum.iter_mut().zip(counts) {
                *sum += u64::from(count);
            }
        }
        sum
    }

    /// The number of pixels.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.cycles.len()
    }

    /// The histogram of pixel number `place`.
    #[must_use]
    pub fn histogram(&self, place: usize) -> &[u32] {
        &self.counts[place * self.bins..][..self.bins]
    }

    /// The laser cycles of pixel number `place`.
    #[must_use]
    pub fn cycles(&self, place: usize) -> u64 {
        self.cycles[place]
    }

    /// Photons past the last bin.
    #[must_use]
    pub const fn rejected(&self) -> u64 {
        self.rejected
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photons::source::{Photon, PixelPhotons};
    use proptest::prelude::*;

    fn slice(first_cycle: u64, photons: &[(u16, u16)]) -> Slice {
        let photon = |&(cycle, code): &(u16, u16)| Photon { cycle, code };
        Slice {
            first_cycle,
            pixels: vec![PixelPhotons {
                cycles: 10,
                photons: photons.iter().map(photon).collect(),
            }],
        }
    }

    /// Counts of more than 32 bits are added as they are.
    #[test]
    fn photons_of_pixels_add_up_exactly() {
        let histograms = [[1 << 35, 16, 0], [5, 1, 1 << 40]].map(|bins| bins.to_vec());
        let recorded = RecordedCounts {
            histograms: Histograms::of(histograms).unwrap(),
            cycles: vec![1 << 36, 7],
        };
        let mut counted = PixelCounts::new(1, 3);
        counted.add(&slice(0, &[(0, 1), (3, 1), (9, 2)]));
        let mut sum = [1, 0, 0];
        (0..2).for_each(|place| recorded.add_to(place, &mut sum));
        counted.add_to(0, &mut sum);
        assert_eq!(sum, [(1 << 35) + 6, 19, (1 << 40) + 1]);
        let all: [&dyn AllPhotons; 2] = [&recorded, &counted];
        assert_eq!(all.map(|all| all.cycles(0)), [1 << 36, 10]);
    }

    proptest! {
        /// Every photon is in one of the two parts, and counted or rejected.
        #[test]
        fn parts_add_up(
            mut photons in prop::collection::vec((0_u16..10, 0_u16..12), 0..50),
            end in 0_u64..30,
        ) {
            photons.sort_unstable();
            let slices = [slice(0, &photons), slice(10, &photons)];
            let [mut all, mut first, mut second] = [0; 3].map(|_| PixelCounts::new(1, 8));
            for slice in &slices {
                all.add(slice);
                first.add_span(slice, 0..end);
                second.add_span(slice, end..u64::MAX);
            }
            prop_assert_eq!(&first.clone().with(&second), &all);
            let before = |cycle: u64| slices.iter().flat_map(|slice| {
                let cycles = slice.pixels[0].photons.iter();
                cycles.map(|photon| slice.first_cycle + u64::from(photon.cycle))
            }).filter(|&photon| photon < cycle).count() as u64;
            let photons = |counts: &PixelCounts| counts.sum().iter().sum::<u64>() + counts.rejected();
            prop_assert_eq!((all.cycles(0), photons(&all)), (20, before(20)));
            prop_assert_eq!((first.cycles(0), photons(&first)), (end.min(20), before(end)));
            prop_assert_eq!((second.cycles(0), photons(&second)), (20 - end.min(20), before(20) - before(end)));
        }
    }
}
