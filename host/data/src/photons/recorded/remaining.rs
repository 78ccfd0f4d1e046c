//! A histogram from which photons are drawn without replacement.

use rand_core::Rng;
use rand_distr::uniform::{UniformInt, UniformSampler};

/// A bin. Its photons have consecutive numbers, and those drawn so far are the last of them.
#[derive(Clone, Copy, Debug)]
struct Bin {
    /// One past its last photon.
    end: u64,
    /// One past its last photon that has not been drawn.
    left: u64,
}

/// At most so many photons are kept as a list.
const LIST: u64 = 1024;

/// The photons of a histogram that have not been drawn.
///
/// The photons of a bin are interchangeable. A number is drawn among all photons, and again if that
/// photon is gone. When more than a quarter of them are gone, the others are renumbered. A table
/// gives the bin at which to start the search for a number. The last photons are a list.
#[derive(Clone, Debug)]
pub struct Remaining {
    bins: Vec<Bin>,
    /// The bin of the first number with the same upper bits, indexed by these bits.
    guide: Vec<u16>,
    shift: u32,
    /// Photons that have a number, drawn or not.
    numbers: u64,
    /// Photons that have not been drawn.
    photons: u64,
    /// The bin of each photon, once there are few.
    list: Vec<u16>,
}

impl Remaining {
    /// All photons of a histogram, fewer than 2^62 in at most 65,536 bins.
    pub fn new(counts: &[u64]) -> Self {
        let mut end = 0;
        let bins = counts.iter().map(|count| {
            end += count;
            Bin { end, left: end }
        });
        let mut remaining = Self {
            bins: bins.collect(),
            guide: Vec::new(),
            shift: 0,
            numbers: 0,
            photons: end,
            list: Vec::new(),
        };
        remaining.number_anew();
        remaining
    }

    /// How many photons are left.
    pub fn photons(&self) -> u64 {
        self.photons
    }

    /// Renumbers the photons that are left, or lists them.
    fn number_anew(&mut self) {
        let (mut start, mut end) = (0, 0);
        for bin in &mut self.bins {
            end += bin.left - start;
            start = bin.end;
            *bin = Bin { end, left: end };
        }
        self.numbers = end;
        self.guide.clear();
        if end <= LIST {
            self.make_list();
            return;
        }
        let entries = 8 * self.bins.len() as u64;
        let is_short = |shift: &u32| self.numbers >> shift < entries;
        self.shift = (0..u64::BITS).find(is_short).unwrap_or(0);
        for (number, bin) in (0..=u16::MAX).zip(&self.bins) {
            // Numbers below `bin.end` are in this bin or an earlier one.
            while ((self.guide.len() as u64) << self.shift) < bin.end {
                self.guide.push(number);
            }
        }
    }

    /// Lists all photons. Once they are listed, that changes nothing.
    fn make_list(&mut self) {
        let mut start = 0;
        for (number, bin) in (0..=u16::MAX).zip(&self.bins) {
            self.list.extend((start..bin.end).map(|_| number));
            start = bin.end;
        }
        (self.bins, self.guide) = (Vec::new(), Vec::new());
    }

    /// Draws a photon. Returns its bin, or `None` if none is left.
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "indices of what is there")]
    pub fn draw(&mut self, rng: &mut impl Rng) -> Option<u16> {
        if 4 * self.photons < 3 * self.numbers {
            self.number_anew();
        }
        if !self.list.is_empty() {
            let place = UniformInt::<u32>::sample_single(0, self.list.len() as u32, rng).ok()?;
            self.photons -= 1;
            return Some(self.list.swap_remove(place as usize));
        }
        loop {
            let number = UniformInt::<u64>::sample_single(0, self.numbers, rng).ok()?;
            let first = usize::from(self.guide[(number >> self.shift) as usize]);
            let mut bins = (first..).zip(&mut self.bins[first..]);
            let (bin, of_bin) = bins.find(|(_, bin)| number < bin.end)?;
            if number < of_bin.left {
                of_bin.left -= 1;
                self.photons -= 1;
                return Some(bin as u16);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::Numbers;
    use super::*;
    use crate::random::pixel_rng;
    use dtof_core::PixelAddress;
    use proptest::prelude::*;
    use std::iter::once;

    proptest! {
        #[test]
        fn every_photon_is_drawn_once(
            counts in prop::collection::vec(prop_oneof![Just(0u64), 1u64..5, 1u64..300, 1u64..3000], 1..40),
            seed in any::<u64>(),
        ) {
            let mut rng = pixel_rng(seed, PixelAddress::new(0));
            let mut remaining = Remaining::new(&counts);
            let mut drawn = vec![0; counts.len()];
            while let Some(bin) = remaining.draw(&mut rng) {
                drawn[usize::from(bin)] += 1;
                let all: u64 = counts.iter().sum();
                prop_assert_eq!(remaining.photons() + drawn.iter().sum::<u64>(), all);
            }
            prop_assert_eq!(drawn, counts);
        }
    }

    /// With replacement, single draws would have the same distribution. Without it, two draws from
    /// bins of 1 and 3 photons differ with probability 1/2, not 3/8.
    #[test]
    fn a_photon_is_not_put_back() {
        let mut rng = pixel_rng(1, PixelAddress::new(0));
        let mut differ = 0i32;
        for _ in 0..40_000 {
            let mut remaining = Remaining::new(&[1, 0, 3]);
            let pair = [remaining.draw(&mut rng), remaining.draw(&mut rng)];
            differ += i32::from(pair[0] != pair[1]);
        }
        // The standard deviation is 100.
        assert!((differ - 20_000).abs() < 500, "{differ}");
    }

    /// Four bins have a table of at most 32 entries, so 4,096 photons have one of 16, each for 256 numbers.
    #[test]
    fn the_table_has_the_bin_of_the_first_number() {
        let remaining = Remaining::new(&[1024, 0, 1024, 2048]);
        assert_eq!(remaining.shift, 8);
        let guide = [0, 0, 0, 0, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3, 3];
        assert_eq!(remaining.guide, guide);
    }

    /// The upper 11 bits of a random number choose one of 2,048 photons.
    #[test]
    fn photons_of_a_bin_have_consecutive_numbers() {
        for (number, bin) in [(0, 0), (999, 0), (1000, 2), (2047, 2)] {
            let mut remaining = Remaining::new(&[1000, 0, 1048]);
            let drawn = remaining.draw(&mut Numbers(once(number << 53)));
            assert_eq!(drawn, Some(bin), "{number}");
        }
    }

    #[test]
    fn photons_are_renumbered_when_more_than_a_quarter_is_gone() {
        let mut rng = pixel_rng(3, PixelAddress::new(0));
        let mut remaining = Remaining::new(&[2000, 2000]);
        let numbers = (0..1002).map(|_| {
            remaining.draw(&mut rng);
            remaining.numbers
        });
        let numbers: Vec<u64> = numbers.collect();
        assert_eq!(numbers[..1001], [4000; 1001]);
        assert_eq!(numbers[1001], 2999);
    }

    /// At least three quarters of the numbers are those of photons, so a photon takes 4/3 of them at most, on average.
    #[test]
    fn photons_take_few_random_numbers() {
        let mut rng = pixel_rng(4, PixelAddress::new(0));
        let numbers = (0..5000 * 4 / 3).map(|_| rng.next_u64());
        let mut numbers = Numbers(numbers);
        let mut remaining = Remaining::new(&[3000, 2000]);
        while remaining.draw(&mut numbers).is_some() {}
        assert_eq!(remaining.photons(), 0);
    }

    #[test]
    fn all_photons_of_a_large_histogram_are_as_likely() {
        let mut rng = pixel_rng(2, PixelAddress::new(0));
        let counts: Vec<u64> = (0..1024).map(|bin| (bin % 4) << 28).collect();
        let mut remaining = Remaining::new(&counts);
        let mut drawn = [0i64; 4];
        for _ in 0..600_000 {
            let bin = remaining.draw(&mut rng).unwrap();
            drawn[usize::from(bin) % 4] += 1;
        }
        // Five standard deviations of the largest are 1,900.
        for (expected, count) in [0, 100_000, 200_000, 300_000].into_iter().zip(drawn) {
            assert!((count - expected).abs() < 1_900, "{drawn:?}");
        }
    }
}
