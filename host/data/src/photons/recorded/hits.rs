//! Photons of a TDC with a dead time, which are not independent: after one the TDC is blind.
//!
//! Of the laser cycles that are left, those with a photon in the dead time before a bin are blind
//! there. The photons of the bin are in any of the others with equal probability. So a laser cycle
//! that is live there has one with the probability of photons that are left ÷ live laser cycles.

use rand_core::Rng;

/// The photons of a histogram that have not been drawn.
#[derive(Clone, Debug)]
pub struct Hits {
    counts: Vec<u64>,
    photons: u64,
    dead_time: usize,
    /// The bins with a photon in the current laser cycle.
    hit: Vec<usize>,
}

impl Hits {
    /// All photons of a histogram. After each the TDC was blind for `dead_time` bins, at least 1.
    pub fn new(counts: &[u64], dead_time: u16) -> Self {
        Self {
            counts: counts.to_vec(),
            photons: counts.iter().sum(),
            dead_time: dead_time.into(),
            hit: Vec::new(),
        }
    }

    /// How many photons are left.
    pub fn photons(&self) -> u64 {
        self.photons
    }

    /// The first bin with more photons than live laser cycles of `cycles`, and these.
    pub fn contradiction(&self, cycles: u64) -> Option<(usize, u64)> {
        let live = (0..self.counts.len()).map(|bin| {
            let first = bin.saturating_sub(self.dead_time);
            let blind: u64 = self.counts[first..bin].iter().sum();
            (bin, cycles.saturating_sub(blind))
        });
        let mut live = live.zip(&self.counts);
        live.find(|&((_, live), &count)| live < count)
            .map(|(bin, _)| bin)
    }

    /// Draws the next of `cycles` laser cycles. Gives `photon` the bins of its photons, ascending.
    pub fn draw(&mut self, cycles: u64, rng: &mut impl Rng, mut photon: impl FnMut(usize)) {
        if self.photons == 0 {
            return;
        }
        let mut uniform = || (f64::from(rng.next_u32()) + 0.5) / 4_294_967_296.0;
        let (mut blind, mut until, mut live_from) = (0, 1.0, 0);
        let mut threshold = uniform();
        for (bin, &count) in self.counts.iter().enumerate() {
            if bin >= live_from && count > 0 {
                let live = cycles.saturating_sub(blind).max(count);
                until *= 1.0 - count as f64 / live as f64;
                if until < threshold {
                    self.hit.push(bin);
                    live_from = bin.saturating_add(1).saturating_add(self.dead_time);
                    if live_from >= self.counts.len() {
                        break;
                    }
                    (until, threshold) = (1.0, uniform());
                }
            }
            blind += count;
            if let Some(ended) = bin.checked_sub(self.dead_time) {
                blind -= self.counts[ended];
            }
        }
        for bin in self.hit.drain(..) {
            self.counts[bin] -= 1;
            self.photons -= 1;
            photon(bin);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::Numbers;
    use super::*;
    use crate::random::pixel_rng;
    use dtof_core::PixelAddress;
    use std::iter::repeat;

    /// Draws all laser cycles. Returns the photons of each.
    fn drawn(counts: &[u64], dead_time: u16, cycles: u64, seed: u64) -> Vec<Vec<usize>> {
        let mut rng = pixel_rng(seed, PixelAddress::new(0));
        let mut hits = Hits::new(counts, dead_time);
        let cycles = (1..=cycles).rev().map(|left| {
            let mut photons = Vec::new();
            hits.draw(left, &mut rng, |bin| photons.push(bin));
            photons
        });
        let cycles = cycles.collect();
        assert_eq!(hits.photons(), 0);
        cycles
    }

    #[test]
    fn all_photons_are_drawn_and_none_is_in_the_dead_time_of_another() {
        let counts = [40, 0, 30, 25, 5, 60, 1, 200];
        for dead_time in [1, 2, 3, 7, 8, u16::MAX] {
            for seed in 0..20 {
                let photons = drawn(&counts, dead_time, 361, seed);
                for cycle in &photons {
                    let is_apart = |pair: &[usize]| pair[1] - pair[0] > usize::from(dead_time);
                    assert!(cycle.windows(2).all(is_apart), "{dead_time}: {cycle:?}");
                }
                let mut sums = [0; 8];
                photons.iter().flatten().for_each(|&bin| sums[bin] += 1);
                assert_eq!(sums, counts);
            }
        }
    }

    /// Of 4 laser cycles 2 have a photon in bin 0, and 2 one in bin 2. With a dead time of 1 bin they
    /// are independent: both are in the first with probability 1/4. With 2 bins never.
    #[test]
    fn photons_further_apart_are_independent() {
        let both = |dead_time| {
            let runs = (0..8000)
                .filter(|&seed| drawn(&[2, 0, 2, 0, 0, 0, 0, 0], dead_time, 4, seed)[0].len() == 2);
            runs.count() as f64 / 8000.0
        };
        // Four standard deviations.
        assert!((both(1) - 0.25).abs() < 0.02, "{}", both(1));
        assert!(both(2) < 1e-9);
    }

    /// Bin 1 has more photons than laser cycles, all in the dead time of the photon in bin 0.
    #[test]
    fn a_contradiction_does_not_keep_later_bins_from_having_photons() {
        let mut hits = Hits::new(&[1, 5, 0, 1], 1);
        let mut photons = Vec::new();
        let mut rng = pixel_rng(1, PixelAddress::new(0));
        hits.draw(1, &mut rng, |bin| photons.push(bin));
        assert_eq!(photons, [0, 3]);
        assert_eq!(hits.photons(), 5);
    }

    #[test]
    fn no_random_number_prevents_a_photon_of_every_laser_cycle() {
        let mut photons = Vec::new();
        Hits::new(&[0, 4], 1).draw(4, &mut Numbers(repeat(0)), |bin| photons.push(bin));
        assert_eq!(photons, [1]);
    }

    #[test]
    fn counts_that_a_dead_time_cannot_give_are_found() {
        let bin = |counts: &[u64], dead_time| Hits::new(counts, dead_time).contradiction(100);
        assert_eq!(bin(&[60, 0, 40, 0], 3), None);
        assert_eq!(bin(&[60, 0, 41, 0], 3), Some((2, 40)));
        assert_eq!(bin(&[60, 0, 41, 0], 1), None);
        assert_eq!(bin(&[101, 0, 0, 0], 1), Some((0, 100)));
    }
}
