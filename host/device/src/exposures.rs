//! Adds up histograms of exposures so that no photon counts twice.
//!
//! The same exposure may be read several times. A later histogram of an exposure contains the photons
//! of an earlier one and replaces it. Exposures with a full counter are left out, as they would show
//! too little light.

use dtof_link::HistogramHead;

use super::assembly::PixelHistogram;

/// A full counter of a pixel.
const FULL: u32 = 1023;
/// A full counter of a sensor that counts histograms itself.
const FULL_WHOLE: u32 = (1 << 24) - 1;

/// Summed histograms of each pixel.
#[derive(Clone, Debug)]
pub struct Exposures {
    pixels: Vec<Pixel>,
    full: u64,
}

#[derive(Clone, Debug)]
struct Pixel {
    sums: Vec<u64>,
    cycles: u64,
    /// The last histogram. Its exposure may not have ended.
    latest: Option<PixelHistogram>,
}

impl Exposures {
    /// Empty histograms.
    #[must_use]
    pub fn new(pixels: u16, bins: u16) -> Self {
        let empty = Pixel {
            sums: vec![0; bins.into()],
            cycles: 0,
            latest: None,
        };
        Self {
            pixels: vec![empty; pixels.into()],
            full: 0,
        }
    }

    /// Adds a histogram, unless its pixel does not exist. Returns whether it has new laser cycles.
    pub fn add(&mut self, histogram: PixelHistogram) -> bool {
        let head = histogram.head;
        let Some(pixel) = self.pixels.get_mut(usize::from(head.pixel.raw())) else {
            return false;
        };
        let before = pixel.latest.as_ref().map(|latest| latest.head);
        if before.is_some_and(|before| began(&before) != began(&head)) {
            self.full += pixel.close();
        }
        let before = pixel.latest.as_ref().map(|latest| latest.head.cycle);
        let is_news = head.exposure > 0 && before.is_none_or(|before| before < head.cycle);
        if is_news {
            pixel.latest = Some(histogram);
        }
        is_news
    }

    /// Ends all exposures: the device is about to be configured or left alone.
    pub fn close(&mut self) {
        self.full += self.pixels.iter_mut().map(Pixel::close).sum::<u64>();
    }

    /// Number of exposures that were left out for a full counter.
    #[must_use]
    pub fn full(&self) -> u64 {
        let latest = self.pixels.iter().filter_map(|pixel| pixel.latest.as_ref());
        self.full + latest.filter(|latest| latest.is_full()).count() as u64
    }

    /// Photons of each bin of each pixel, from closed exposures.
    pub fn sums(&self) -> impl Iterator<Item = &[u64]> {
        self.pixels.iter().map(|pixel| pixel.sums.as_slice())
    }

    /// Laser cycles of each pixel, from closed exposures.
    pub fn cycles(&self) -> impl Iterator<Item = u64> {
        self.pixels.iter().map(|pixel| pixel.cycles)
    }

    /// Photons of the median pixel so far.
    #[must_use]
    pub fn median_photons(&self) -> u64 {
        let latest = |pixel: &Pixel| pixel.latest.as_ref().map_or(0, PixelHistogram::photons);
        let photons = |pixel: &Pixel| pixel.sums.iter().sum::<u64>() + latest(pixel);
        let mut photons: Vec<u64> = self.pixels.iter().map(photons).collect();
        photons.sort_unstable();
        photons.get(photons.len() / 2).copied().unwrap_or(0)
    }

    /// Upper bound of the photons a laser cycle in the brightest bin: its count, three standard
    /// deviations and five photons. `None` while a pixel has fewer than `least` laser cycles.
    #[must_use]
    pub fn brightest(&self, least: u16) -> Option<f64> {
        let mut brightest = 0.0;
        for pixel in &self.pixels {
            let latest = pixel.latest.as_ref().filter(|latest| !latest.is_full());
            let count = |bin| latest.map_or(0, |latest| u64::from(latest.counts[bin]));
            let counts = pixel.sums.iter().enumerate();
            let highest = counts.map(|(bin, sum)| sum + count(bin)).max().unwrap_or(0) as f64;
            let cycles = pixel.cycles + latest.map_or(0, |latest| latest.head.exposure.into());
            if cycles < u64::from(least) {
                return None;
            }
            let most = highest + 3.0 * highest.sqrt() + 5.0;
            brightest = f64::max(brightest, most / cycles as f64);
        }
        Some(brightest)
    }
}

impl PixelHistogram {
    /// Returns whether a counter is full.
    #[must_use]
    pub fn is_full(&self) -> bool {
        let full = if self.head.is_whole { FULL_WHOLE } else { FULL };
        self.counts.iter().any(|&count| count >= full)
    }

    fn photons(&self) -> u64 {
        self.counts.iter().map(|&count| u64::from(count)).sum()
    }
}

impl Pixel {
    /// Adds the last histogram to the sums. Returns 1 if it is left out, else 0.
    fn close(&mut self) -> u64 {
        let Some(latest) = self.latest.take() else {
            return 0;
        };
        if latest.is_full() {
            return 1;
        }
        self.cycles += u64::from(latest.head.exposure);
        for (sum, count) in self.sums.iter_mut().zip(&latest.counts) {
            *sum += u64::from(*count);
        }
        0
    }
}

/// The laser cycle at which an exposure began.
fn began(head: &HistogramHead) -> u64 {
    head.cycle.raw().saturating_sub(head.exposure.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_core::{LaserCycle, PixelAddress};
    use proptest::prelude::*;

    fn histogram(pixel: u16, cycle: u64, exposure: u32, counts: &[u32]) -> PixelHistogram {
        PixelHistogram {
            head: HistogramHead {
                pixel: PixelAddress::new(pixel),
                is_whole: false,
                cycle: LaserCycle::new(cycle),
                exposure,
            },
            counts: counts.to_vec(),
        }
    }

    #[test]
    fn a_later_histogram_of_an_exposure_replaces_an_earlier_one() {
        let mut exposures = Exposures::new(2, 2);
        assert!(exposures.add(histogram(0, 10, 10, &[1, 0])));
        assert!(exposures.add(histogram(0, 20, 20, &[1, 2])));
        // The same again, and one without a laser cycle.
        assert!(!exposures.add(histogram(0, 20, 20, &[1, 2])));
        assert!(!exposures.add(histogram(0, 24, 0, &[0, 0])));
        assert!(exposures.add(histogram(0, 30, 6, &[0, 5])));
        assert!(!exposures.add(histogram(9, 30, 6, &[0, 5])));
        assert_eq!(exposures.brightest(1), None);
        exposures.close();
        let sums: Vec<&[u64]> = exposures.sums().collect();
        assert_eq!(sums, [[1, 7], [0, 0]]);
        assert!(exposures.cycles().eq([26, 0]));
    }

    #[test]
    fn an_exposure_with_a_full_counter_is_left_out_and_counted() {
        let mut exposures = Exposures::new(1, 2);
        exposures.add(histogram(0, 10, 10, &[1022, 9]));
        exposures.add(histogram(0, 20, 20, &[1023, 19]));
        exposures.add(histogram(0, 30, 6, &[1022, 5]));
        exposures.close();
        assert_eq!(exposures.full(), 1);
        assert!(exposures.sums().eq([[1022, 5]]));
        assert!(exposures.cycles().eq([6]));
        let most = (1022.0 + 3.0 * f64::sqrt(1022.0) + 5.0) / 6.0;
        assert!((exposures.brightest(6).unwrap() - most).abs() < 1e-9);
        assert_eq!(exposures.brightest(7), None);
        // A sensor's counters hold more.
        let mut whole = histogram(0, 70_030, 70_000, &[1023, 0]);
        whole.head.is_whole = true;
        exposures.add(whole);
        exposures.close();
        assert_eq!(
            (exposures.full(), exposures.cycles().next()),
            (1, Some(70_006))
        );
    }

    proptest! {
        /// With one photon a laser cycle there are as many photons as laser cycles, whenever the
        /// histograms are read.
        #[test]
        fn photons_and_laser_cycles_belong_together(
            reads in prop::collection::vec((1u64..400, 0u16..2), 1..60), length in 8u64..200,
        ) {
            let mut exposures = Exposures::new(2, 1);
            let (mut cycle, mut seen) = (0, std::collections::BTreeMap::new());
            for (wait, pixel) in reads {
                cycle += wait;
                let exposure = u32::try_from(cycle % length).unwrap();
                if exposure < FULL {
                    seen.insert((pixel, cycle - u64::from(exposure)), u64::from(exposure));
                }
                exposures.add(histogram(pixel, cycle, exposure, &[exposure]));
            }
            exposures.close();
            let photons: u64 = exposures.sums().map(|sums| sums[0]).sum();
            prop_assert_eq!(photons, seen.values().sum::<u64>());
            prop_assert_eq!(exposures.cycles().sum::<u64>(), photons);
        }
    }
}
