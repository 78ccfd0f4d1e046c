//! Simulated exposures, one look after the other.
//!
//! Between two looks the count of each bin grows by a Poisson number. Background is equal
//! in all bins, so its photons are drawn with one Poisson number and spread evenly over the
//! bins: the same distribution at a cost per photon, not per bin. Histogram and rule are
//! those of the core.

use anyhow::{Context, Result};
use dtof_core::paper::{isqrt, quadrant_background};
use dtof_core::rule::detect;
use dtof_core::{AnyRule, Count, DepthEstimator, Detection, Histogram, RangeGate};
use rand_core::Rng;
use rand_distr::{Distribution, Poisson};
use rand_pcg::Pcg64;

use crate::rates::{Rates, bin_share};

/// When a pixel looks at its histogram, in steps of X laser cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Looks {
    /// Laser cycles a step (X).
    pub x: u32,
    /// The first look with N > L1.
    pub first: u32,
    /// The last look with N < L2.
    pub last: u32,
}

impl Looks {
    /// The looks of a valid [`PixelConfig`](dtof_core::PixelConfig) with these settings.
    #[must_use]
    pub fn new(x: u16, l1: u16, l2: u16) -> Self {
        let [x, l1, l2] = [x, l1, l2].map(u32::from);
        Self {
            x,
            first: l1 / x + 1,
            last: (l2 - 1) / x,
        }
    }

    /// Laser cycles of an exposure without an event: the first look with
    /// N ≥ L2.
    #[must_use]
    pub fn expiry(&self) -> u32 {
        (self.last + 1) * self.x
    }
}

/// The photon distribution of one pixel over a number of laser cycles.
#[derive(Clone, Debug)]
struct Photons {
    background: Option<Poisson<f64>>,
    /// A mean of more than half a photon a bin.
    is_bright: bool,
    signal: Vec<(u16, Poisson<f64>)>,
}

impl Photons {
    /// For `cycles` laser cycles. `bins` must be a power of two.
    fn new(rates: &Rates, bins: u16, cycles: f64) -> Result<Self> {
        let background = rates.background * f64::from(bins) * cycles;
        let signal = |bin: u16| {
            let mean = rates.signal * cycles * bin_share(bin.into(), rates.position, rates.sigma);
            // Less than a photon in 1e12 exposures is left out.
            (mean > 1e-12).then(|| Ok((bin, Poisson::new(mean)?)))
        };
        let signal = (0..bins).filter_map(signal).collect::<Result<_>>();
        let is_bright = background + rates.signal * cycles > f64::from(bins) / 2.0;
        let background = (background > 0.0).then(|| Poisson::new(background));
        Ok(Self {
            is_bright,
            background: background.transpose().context("the background")?,
            signal: signal.context("the signal")?,
        })
    }

    /// Draws photons and calls `photon` with the bin of each.
    fn draw<const BINS: usize>(&self, rng: &mut Pcg64, mut photon: impl FnMut(u16)) {
        // A Poisson sample is a whole number.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let sample = |law: &Poisson<f64>, rng: &mut Pcg64| law.sample(rng) as u64;
        let background = &self.background;
        let mut remaining = background.as_ref().map_or(0, |law| sample(law, rng));
        // Four uniform bins from one random number: BINS is a power of two.
        while remaining > 0 {
            let mut random = rng.next_u64();
            for _ in 0..remaining.min(4) {
                #[allow(clippy::cast_possible_truncation)]
                photon((random as usize & (BINS - 1)) as u16);
                random >>= 16;
            }
            remaining = remaining.saturating_sub(4);
        }
        for (bin, law) in &self.signal {
            // More photons than a counter holds change nothing.
            for _ in 0..sample(law, rng).min(1024) {
                photon(*bin);
            }
        }
    }

    fn frame<const BINS: usize>(&self, rng: &mut Pcg64) -> [u16; BINS] {
        let mut frame = [0u16; BINS];
        self.draw::<BINS>(rng, |bin| {
            let count = &mut frame[usize::from(bin)];
            *count = count.saturating_add(1);
        });
        frame
    }

    /// Adds the photons in the gate.
    fn add_to<const BINS: usize>(
        &self,
        histogram: &mut Histogram<BINS>,
        gate: &RangeGate<BINS>,
        rng: &mut Pcg64,
    ) {
        // Both give the same histogram. A frame takes a pass over all bins; a photon alone takes longer than one in a frame.
        if self.is_bright {
            histogram.add_frame(&self.frame::<BINS>(rng), gate);
        } else {
            self.draw::<BINS>(rng, |bin| {
                if gate.contains(bin) {
                    histogram.add(bin);
                }
            });
        }
    }
}

/// Exposures of one pixel at constant rates.
#[derive(Clone, Debug)]
pub struct Exposures {
    looks: Looks,
    until_first: Photons,
    between: Photons,
}

impl Exposures {
    /// `bins` must be a power of two from 8 to 1024.
    ///
    /// # Errors
    /// Fails if a rate is negative or not a number.
    pub fn new(rates: &Rates, bins: u16, looks: Looks) -> Result<Self> {
        let photons = |steps: u32| Photons::new(rates, bins, f64::from(steps * looks.x));
        Ok(Self {
            looks,
            until_first: photons(looks.first)?,
            between: photons(1)?,
        })
    }

    /// Calls `look` with the step (of X laser cycles) and the gated histogram of each look, until it returns `true` or
    /// the exposure expires. Returns the duration in laser cycles.
    pub fn run<const BINS: usize>(
        &self,
        gate: &RangeGate<BINS>,
        rng: &mut Pcg64,
        mut look: impl FnMut(u32, &Histogram<BINS>) -> bool,
    ) -> u32 {
        let mut histogram = Histogram::new();
        self.until_first.add_to(&mut histogram, gate, rng);
        for step in self.looks.first..=self.looks.last {
            if look(step, &histogram) {
                return step * self.looks.x;
            }
            self.between.add_to(&mut histogram, gate, rng);
        }
        self.looks.expiry()
    }

    /// Simulates the photons of one exposure. Calls `look` at each look with the laser cycles
    /// so far and the photons since the previous look, until it returns `true` or the
    /// exposure expires.
    pub fn frames<const BINS: usize>(
        &self,
        rng: &mut Pcg64,
        mut look: impl FnMut(u32, &[u16; BINS]) -> bool,
    ) {
        let mut photons = self.until_first.frame(rng);
        for step in self.looks.first..=self.looks.last {
            if look(step * self.looks.x, &photons) {
                break;
            }
            photons = self.between.frame(rng);
        }
    }

    /// Simulates one exposure: its duration in laser cycles, and its event if there was one.
    pub fn event<const BINS: usize>(
        &self,
        rule: &AnyRule,
        estimator: &DepthEstimator,
        rng: &mut Pcg64,
    ) -> (u32, Option<Detection>) {
        let mut event = None;
        let gate = RangeGate::full();
        let cycles = self.run::<BINS>(&gate, rng, |_, histogram| {
            event = detect(histogram, &gate, rule, estimator);
            event.is_some()
        });
        (cycles, event)
    }

    /// Simulates one exposure to its end. For each look of `lasts`, ascending: the highest α
    /// (in 1/256) that would have caused an event up to that look, if any.
    pub fn highest_alphas<const BINS: usize>(
        &self,
        minimum_count: Count,
        lasts: &[u32],
        rng: &mut Pcg64,
    ) -> Vec<Option<u16>> {
        let mut highest = None;
        let mut by_last = Vec::with_capacity(lasts.len());
        self.run::<BINS>(&RangeGate::full(), rng, |step, histogram| {
            highest = highest.max(highest_alpha(histogram, minimum_count));
            if lasts.get(by_last.len()) == Some(&step) {
                by_last.push(highest);
            }
            false
        });
        by_last
    }
}

/// The highest α in 1/256 with which the paper's rule fires on `histogram`.
///
/// The rule fires if `256·peak > 256·q + α·⌊√q⌋`, in α's units.
fn highest_alpha<const BINS: usize>(
    histogram: &Histogram<BINS>,
    minimum_count: Count,
) -> Option<u16> {
    let peak = histogram.peak();
    let background = quadrant_background(histogram.counts(), &RangeGate::full(), peak.bin);
    if peak.count < minimum_count || peak.count <= background {
        return None;
    }
    let excess = (peak.count.raw() - background.raw()) << 8;
    let root = isqrt::<5>(background.raw());
    // Without a background every α fires.
    let highest = (excess - 1).checked_div(root).unwrap_or(u32::MAX);
    Some(u16::try_from(highest).unwrap_or(u16::MAX))
}

#[cfg(test)]
mod tests {
    use dtof_core::fixed::types::U8F8;
    use dtof_core::{AsyncPixel, LaserCycle, Look, PaperRule, PixelConfig, Statistics};

    use super::*;
    use dtof_core::PixelAddress;
    use dtof_data::random::trial_rng;

    #[test]
    fn looks_are_those_of_a_pixel() {
        let all = [
            (1, 1, 3),
            (4, 40, 2000),
            (10, 100, 203),
            (7, 10, 22),
            (3, 5, 7),
        ];
        for (x, l1, l2) in all {
            let config = PixelConfig::<8>::paper().x(x).l1(l1).l2(l2);
            let config = config.build().unwrap();
            let looks = Looks::new(x, l1, l2);
            let mut pixel = AsyncPixel::<8>::new(PixelAddress::new(0));
            let (mut seen, mut statistics) = (Vec::new(), Statistics::new());
            for cycle in 0.. {
                match pixel.end_laser_cycle(&config, &mut statistics, LaserCycle::new(cycle)) {
                    Look::NoPeak => seen.push(u32::from(pixel.exposure())),
                    Look::Expired => {
                        assert_eq!(cycle + 1, u64::from(looks.expiry()));
                        break;
                    }
                    _ => {}
                }
            }
            let expected = (looks.first..=looks.last).map(|look| look * looks.x);
            assert!(seen.into_iter().eq(expected), "{x} {l1} {l2}");
        }
    }

    /// A photon alone and a frame of photons give the same histogram, also of full counters.
    #[test]
    fn photons_alone_and_frames_are_the_same() {
        let rates = Rates {
            background: 0.1,
            signal: 2.0,
            position: 9.5,
            sigma: 0.7,
        };
        for gate in [RangeGate::full(), RangeGate::new(9, 20).unwrap()] {
            for cycles in [1.0, 30.0, 900.0] {
                let drawn = [false, true].map(|is_bright| {
                    let mut photons = Photons::new(&rates, 32, cycles).unwrap();
                    photons.is_bright = is_bright;
                    let mut histogram = Histogram::<32>::new();
                    let mut rng = trial_rng(2, 5);
                    for _ in 0..3 {
                        photons.add_to(&mut histogram, &gate, &mut rng);
                    }
                    assert!(histogram.total() > 0 && (cycles < 900.0 || histogram.saturated() > 0));
                    (
                        *histogram.counts(),
                        histogram.peak(),
                        histogram.total(),
                        histogram.saturated(),
                    )
                });
                assert_eq!(drawn[0], drawn[1], "{gate:?} {cycles}");
            }
        }
    }

    #[test]
    fn the_highest_alpha_fires_and_the_next_does_not() {
        let mut rng = trial_rng(5, 0);
        let minimum_count = Count::saturating(5);
        let (gate, estimator) = (RangeGate::full(), DepthEstimator::default());
        let mut seen = [0; 3];
        for mean in [0.002, 0.5, 3.0, 60.0] {
            let rates = Rates {
                background: mean,
                signal: 10.0,
                position: 40.3,
                sigma: 0.7,
            };
            let photons = Photons::new(&rates, 128, 1.0).unwrap();
            for _ in 0..2000 {
                let mut histogram = Histogram::<128>::new();
                photons.add_to(&mut histogram, &RangeGate::full(), &mut rng);
                let fires = |alpha: u16| {
                    let rule = PaperRule::new(U8F8::from_bits(alpha), minimum_count);
                    detect(&histogram, &gate, &rule, &estimator).is_some()
                };
                let (kind, is_right) = match highest_alpha(&histogram, minimum_count) {
                    None => (0, !fires(0)),
                    Some(u16::MAX) => (1, fires(u16::MAX)),
                    Some(alpha) => (2, fires(alpha) && !fires(alpha + 1)),
                };
                assert!(is_right);
                seen[kind] += 1;
            }
        }
        assert!(seen.iter().all(|&seen| seen > 50), "{seen:?}");
    }

    #[test]
    fn the_highest_alphas_of_an_exposure_are_those_of_its_looks() {
        let minimum_count = Count::saturating(3);
        let rates = Rates::without_target(0.02);
        let looks = Looks::new(4, 40, 400);
        let exposures = Exposures::new(&rates, 32, looks).unwrap();
        let lasts = [looks.first, 20, 50, looks.last];
        let mut grown = 0;
        for exposure in 0..200 {
            let mut rng = trial_rng(9, exposure);
            let found = exposures.highest_alphas::<32>(minimum_count, &lasts, &mut rng);
            let mut rng = trial_rng(9, exposure);
            let mut alphas = Vec::new();
            exposures.run::<32>(&RangeGate::full(), &mut rng, |step, histogram| {
                alphas.push((step, highest_alpha(histogram, minimum_count)));
                false
            });
            let until = |last| {
                let looks = alphas.iter().filter(move |(step, _)| *step <= last);
                looks.filter_map(|(_, alpha)| *alpha).max()
            };
            assert_eq!(found, lasts.map(until));
            grown += u32::from(found[0] < found[1] && found[1] < found[2]);
        }
        assert!(grown > 20, "{grown}");
    }

    #[test]
    fn frames_come_with_the_laser_cycles_of_their_looks() {
        let rates = Rates {
            background: 0.05,
            signal: 0.3,
            position: 20.0,
            sigma: 1.0,
        };
        let looks = Looks::new(7, 30, 100);
        let exposures = Exposures::new(&rates, 32, looks).unwrap();
        let mut rng = trial_rng(4, 4);
        let mut sums = [0u32; 10];
        let times = 2000;
        for _ in 0..times {
            let mut seen = Vec::new();
            exposures.frames::<32>(&mut rng, |cycles, photons| {
                sums[seen.len()] += photons.iter().map(|&count| u32::from(count)).sum::<u32>();
                seen.push(cycles);
                false
            });
            assert_eq!(seen, [35, 42, 49, 56, 63, 70, 77, 84, 91, 98]);
        }
        for (look, sum) in sums.into_iter().enumerate() {
            let cycles = if look == 0 { 35.0 } else { 7.0 };
            let expected = f64::from(times) * cycles * (32.0 * 0.05 + 0.3);
            let deviation = (f64::from(sum) - expected) / expected.sqrt();
            assert!(deviation.abs() < 5.0, "{look}: {sum} {expected}");
        }
        let mut looked = 0;
        exposures.frames::<32>(&mut rng, |cycles, _| {
            looked += 1;
            cycles == 49
        });
        assert_eq!(looked, 3);
    }

    #[test]
    fn counts_have_the_means_of_the_rates() {
        let rates = Rates {
            background: 0.05,
            signal: 2.0,
            position: 20.0,
            sigma: 1.5,
        };
        let photons = Photons::new(&rates, 64, 10.0).unwrap();
        let mut rng = trial_rng(1, 1);
        let mut sums = [0u32; 64];
        let times = 20_000;
        for _ in 0..times {
            let mut histogram = Histogram::<64>::new();
            photons.add_to(&mut histogram, &RangeGate::full(), &mut rng);
            for (sum, &count) in sums.iter_mut().zip(histogram.counts()) {
                *sum += u32::from(count);
            }
        }
        for (bin, &sum) in (0..).zip(&sums) {
            let mean = 0.5 + 20.0 * bin_share(bin, rates.position, rates.sigma);
            let expected = mean * f64::from(times);
            // 4.5 standard deviations: one in 2,000 runs, over 64 bins.
            let deviation = (f64::from(sum) - expected) / expected.sqrt();
            assert!(deviation.abs() < 4.5, "{bin}: {sum} {expected}");
        }
    }
}
