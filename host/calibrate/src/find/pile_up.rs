//! Pile-up: after a photon a TDC with a dead time misses all others for some bins, or to the end of the
//! laser cycle.
//!
//! Of `N` laser cycles, bin `b` was live in `live(b) = N - Σ counts of the D bins before b`. With a dead
//! time of D bins the background of a bin is proportional to that; with none it is constant. It falls over
//! the histogram, and has a hole behind each bright bin.
//!
//! Both are compared by the background's photons alone, given their number in each histogram: bin by bin,
//! how likely is it that so many of those left fall into this bin? With none it is one in as many as there
//! are bins left; with a dead time the bin's share of the live laser cycles to come, as the photons so far
//! let expect. The share of a bin is fixed before its own photons are used. So the ratio of the two
//! likelihoods exceeds 1000 in at most one of 1000 recordings of flat light without a dead time, however
//! bright it is (Ville's inequality), also as a mean over dead times. A straight line through counts over
//! live laser cycles, which are sums of the same counts, has no such bound.
//!
//! The dead time is then the shortest of those with about the highest likelihood, or all bins if that is one
//! of them. Something else than a dead time may make a background fall, so the fall must be neither half nor
//! twice as steep.
//!
//! Both depend on the number of photons of each histogram alone, which is given, and on the bins without a peak.
//!
//! Where the laser cycles are not known, they are looked for in the same way, for a TDC that takes one photon in each, and
//! captures that are equally long. Another fall would fit some number of laser cycles, too. But after pile-up brighter
//! histograms fall more steeply: if some are clearly brighter and all fall alike, it is none.

use std::ops::Range;

use super::observed::Trace;
use super::significance::{is_surely_more, median, quantile};

use dtof_data::photons::recorded::ListTimes;
use dtof_light::counts::dead_time::{arrived, live};

/// The ratio of likelihoods that decides, as a logarithm: 1000.
const DECIDES: f64 = 6.91;
/// By chance a bin is left out in fewer than one of so many histograms.
const ONE_IN: f64 = 100.0;
/// The share of the histograms that something is wrong with.
const DOUBT: f64 = 1e-4;
/// The most repetitions to find bins without a peak.
const ROUNDS: usize = 10;
/// Bins beside a window that are left out, and those behind them that it is compared with: for narrow
/// pulses, and for wide ones and tails.
const SIDES: [(usize, usize); 3] = [(2, 8), (8, 32), (24, 96)];
/// The most histograms that are used, spread over the recording.
const MOST: usize = 4096;
/// The same to find the dead time itself.
const MOST_TO_REFINE: usize = 512;
/// Laser cycles to try: the photons of the brightest histogram times `1 + 2^e`, for these e.
const EXCESSES: Range<i8> = -8..5;
/// Histograms are of different brightness if eight in ten have photons that differ by more than this part of the median:
/// by more than chance.
const DIFFERENT: f64 = 0.2;
/// From this share of lost photons on, depths are wrong.
pub(crate) const MATTERS: f64 = 0.2;
/// If so many second photons of a laser cycle are expected and there is none, the TDC takes the first: by chance one list in
/// a million has none.
const SECOND_PHOTONS: f64 = 14.0;
/// Steps between two e for the likeliest laser cycles.
const FINER: i8 = 8;

/// The kind of TDC, as histograms show it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tdc {
    /// It has a dead time.
    DeadTime {
        /// Bins for which it is blind after a photon: all of the histogram if only the first photon of a
        /// laser cycle counts.
        bins: usize,
        /// The share of the arriving photons that is lost in the median histogram.
        lost: f64,
    },
    /// It takes several photons a laser cycle, or there is so little light that it makes no difference.
    SeveralHits,
    /// Not decided. With one photon a laser cycle this share would be lost.
    Unclear(f64),
    /// Laser cycles are not known. The background falls as if one photon counted in each of so many.
    OnePhotonIn {
        /// So many laser cycles.
        cycles: f64,
        /// The share of the arriving photons that would be lost in the median histogram.
        lost: f64,
    },
}

/// A histogram, and its background.
struct Background<'a> {
    counts: &'a [f64],
    cycles: f64,
    /// Bins without a peak.
    clear: Vec<bool>,
}

/// The TDC that recorded `traces`, whose laser cycles are known.
#[must_use]
pub fn tdc(traces: &[Trace]) -> Tdc {
    let bins = traces.first().map_or(0, |trace| trace.counts.len());
    let backgrounds = backgrounds(traces);
    let lost = |dead_time| {
        let all = traces.iter().map(|trace| (trace, trace.cycles));
        share_lost(all, dead_time)
    };
    let sum = |dead_time| {
        let ratios = backgrounds.iter();
        let ratios = ratios.map(|one| doubted(one.log_ratio(one.cycles, dead_time)));
        ratios.sum::<f64>()
    };
    let candidates = candidates(bins);
    let ratios: Vec<f64> = candidates.iter().map(|&bins| sum(bins)).collect();
    if let Some(best) = decided(&ratios) {
        let dead_time = refined(&backgrounds, &candidates, best);
        let lost = lost(dead_time);
        return match has_the_slope(&backgrounds, dead_time) {
            true => Tdc::DeadTime {
                bins: dead_time,
                lost,
            },
            false => Tdc::Unclear(lost),
        };
    }
    match ratios.last() {
        Some(&first_only) if first_only > -DECIDES => Tdc::Unclear(lost(bins)),
        _ => Tdc::SeveralHits,
    }
}

impl Tdc {
    /// If the background has not decided, and it matters, the times of a photon list do: a TDC that takes several photons has about
    /// `n²/2N` second ones among `n` photons of a pixel in `N` laser cycles, and one that takes the first photon none.
    pub(crate) fn or_by_times(self, traces: &[Trace], times: Option<&ListTimes>) -> Self {
        let (Self::Unclear(lost), Some(times)) = (self, times) else {
            return self;
        };
        if lost <= MATTERS {
            return self;
        }
        let bins = traces.first().map_or(0, |trace| trace.counts.len());
        let expected = traces.iter().map(|trace| {
            let photons = trace.counts.iter().sum::<f64>();
            photons * photons / (2.0 * trace.cycles)
        });
        let expected: f64 = expected.sum();
        match times.again as f64 {
            again if again > expected / 2.0 => Self::SeveralHits,
            0.0 if expected > SECOND_PHOTONS => Self::DeadTime { bins, lost },
            _ => self,
        }
    }
}

/// A TDC that is dead for so many bins after a photon.
#[must_use]
pub fn known_tdc(traces: &[Trace], dead_time: usize) -> Tdc {
    let bins = dead_time.min(traces.first().map_or(0, |trace| trace.counts.len()));
    if bins == 0 {
        return Tdc::SeveralHits;
    }
    let all = traces.iter().map(|trace| (trace, trace.cycles));
    let lost = share_lost(all, bins);
    Tdc::DeadTime { bins, lost }
}

/// The TDC that recorded `traces`, whose laser cycles are not known; `None` if the background does not show it.
#[must_use]
pub fn tdc_without_cycles(traces: &[Trace]) -> Option<Tdc> {
    let bins = traces.first()?.counts.len();
    let backgrounds = backgrounds(traces);
    let totals = traces.iter().map(|trace| trace.counts.iter().sum::<f64>());
    let totals: Vec<f64> = totals.collect();
    let brightest = totals.iter().copied().fold(1.0, f64::max);
    let step = step_through(backgrounds.len(), MOST_TO_REFINE);
    // Of every `step`-th histogram, whose laser cycles are `factor` times `photons`.
    let ratio = |factor: f64, photons: &dyn Fn(&Background) -> f64, step: usize| {
        let used = backgrounds.iter().step_by(step);
        let ratios = used.map(|one| one.log_ratio(factor * photons(one), bins));
        ratios.sum::<f64>()
    };
    let of_brightest = |_: &Background| brightest;
    let each = |one: &Background| one.counts.iter().sum::<f64>().max(1.0);
    let factors = |finer: i8| {
        let steps = finer * EXCESSES.start..finer * EXCESSES.end;
        steps.map(move |step| 1.0 + (f64::from(step) / f64::from(finer)).exp2())
    };
    let coarse: Vec<f64> = factors(1)
        .map(|factor| ratio(factor, &of_brightest, 1))
        .collect();
    decided(&coarse)?;
    let likeliest = |photons: &dyn Fn(&Background) -> f64| {
        let scored = factors(FINER).map(|factor| (factor, ratio(factor, photons, step)));
        scored.max_by(|a, b| a.1.total_cmp(&b.1))
    };
    let (factor, equal) = likeliest(&of_brightest)?;
    let [low, middle, high] = [0.1, 0.5, 0.9].map(|share| quantile(totals.iter().copied(), share));
    if high - low > DIFFERENT * middle && likeliest(&each)?.1 > equal + DECIDES {
        return None;
    }
    let cycles = factor * brightest;
    let lost = share_lost(traces.iter().map(|trace| (trace, cycles)), bins);
    Some(Tdc::OnePhotonIn { cycles, lost })
}

/// The number of the likeliest alternative, if the mean of these ratios of likelihoods decides for them. They
/// are logarithms.
fn decided(ratios: &[f64]) -> Option<usize> {
    let highest = ratios.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let relative = ratios.iter().map(|ratio| (ratio - highest).exp());
    let mean = relative.sum::<f64>() / ratios.len() as f64;
    let best = ratios.iter().position(|&ratio| ratio >= highest);
    best.filter(|_| highest + mean.ln() > DECIDES)
}

/// The step from one histogram to the next that uses `most` of `all` at most.
fn step_through(all: usize, most: usize) -> usize {
    all.div_ceil(most).max(1)
}

/// The backgrounds of histograms spread over the recording.
fn backgrounds(traces: &[Trace]) -> Vec<Background<'_>> {
    let step = step_through(traces.len(), MOST);
    traces.iter().step_by(step).map(Background::of).collect()
}

/// Dead times to try: each up to 8, then steps of an eighth, and all bins.
fn candidates(bins: usize) -> Vec<usize> {
    let next = |&dead_time: &usize| Some(dead_time + (dead_time / 8).max(1));
    let steps = std::iter::successors(Some(1), next);
    let mut candidates: Vec<usize> = steps.take_while(|&dead_time| dead_time < bins).collect();
    candidates.push(bins);
    candidates
}

/// The dead time with the highest likelihood, between the neighbours of candidate number `best`. The
/// shortest of those that are hardly less likely: a bin too many makes targets, a bin too few does not.
fn refined(backgrounds: &[Background], candidates: &[usize], best: usize) -> usize {
    let low = best
        .checked_sub(1)
        .map_or(1, |before| candidates[before] + 1);
    let high = candidates
        .get(best + 1)
        .map_or(candidates[best], |&next| next - 1);
    let step = step_through(backgrounds.len(), MOST_TO_REFINE);
    let used = || backgrounds.iter().step_by(step);
    let likelihood = |dead_time: usize| {
        let each = used().map(|one| one.log_likelihood(one.cycles, dead_time, 1.0));
        each.sum::<f64>()
    };
    let scored: Vec<(usize, f64)> = (low..=high).map(|bins| (bins, likelihood(bins))).collect();
    let highest = scored
        .iter()
        .fold(f64::NEG_INFINITY, |highest, one| highest.max(one.1));
    let mut likely = scored.iter().filter(|one| one.1 > highest - 3.0);
    let all = candidates.last().copied().unwrap_or(1);
    // A longest dead time is the end of the laser cycle.
    if likely.clone().any(|one| one.0 == all) {
        return all;
    }
    likely.next().map_or(all, |one| one.0)
}

/// Whether the background falls neither half nor twice as steeply as with this dead time.
fn has_the_slope(backgrounds: &[Background], dead_time: usize) -> bool {
    let likelihood = |power| {
        let backgrounds = backgrounds.iter();
        let each = backgrounds.map(|one| one.log_likelihood(one.cycles, dead_time, power));
        each.sum::<f64>()
    };
    let here = likelihood(1.0);
    here > likelihood(0.5) && here > likelihood(2.0)
}

/// The logarithm of a ratio of likelihoods, if one histogram in so many is not what it seems: one pixel cannot outweigh the
/// others. The expectation of such a ratio is at most 1, as it was.
fn doubted(log_ratio: f64) -> f64 {
    let doubt = DOUBT.ln();
    let (high, low) = (log_ratio.max(doubt), log_ratio.min(doubt));
    high + (low - high).exp().ln_1p()
}

/// Bins that hold no more than the bins around them, on the brighter side: those of a pulse or its tail do.
/// A background that falls is left whole, so that neither hypothesis is favoured.
fn clear_bins(counts: &[f64]) -> Vec<bool> {
    let bins = counts.len();
    let mut clear = vec![true; bins];
    for _ in 0..ROUNDS {
        let mut sums = vec![(0.0, 0.0); bins + 1];
        for bin in 0..bins {
            let (photons, number) = sums[bin];
            let kept = f64::from(u8::from(clear[bin]));
            sums[bin + 1] = (photons + kept * counts[bin], number + kept);
        }
        // The most photons a bin that some bins let expect.
        let level = |bins: Range<usize>| {
            let photons = sums[bins.end].0 - sums[bins.start].0;
            let number = sums[bins.end].1 - sums[bins.start].1;
            (number >= 4.0).then(|| (photons + 2.0 * photons.sqrt() + 3.0) / number)
        };
        let mut next = vec![true; bins];
        for (guard, reach) in SIDES {
            for width in [1, 3] {
                for (first, window) in counts.windows(width).enumerate() {
                    let last = first + width - 1;
                    let before = first.saturating_sub(guard);
                    let after = (last + 1 + guard).min(bins);
                    let sides = [
                        level(before.saturating_sub(reach)..before),
                        level(after..(after + reach).min(bins)),
                    ];
                    let level = sides.into_iter().flatten().reduce(f64::max);
                    let all = window.iter().sum();
                    let one_in = ONE_IN * bins as f64;
                    if level.is_some_and(|level| is_surely_more(all, level * width as f64, one_in))
                    {
                        next[first.saturating_sub(1)..(last + 2).min(bins)].fill(false);
                    }
                }
            }
        }
        if next == clear {
            break;
        }
        clear = next;
    }
    clear
}

/// The share of its photons that the median histogram loses to this dead time. Histograms come with their laser cycles.
fn share_lost<'a>(histograms: impl Iterator<Item = (&'a Trace, f64)>, dead_time: usize) -> f64 {
    let lost = histograms.filter_map(|(trace, cycles)| {
        let came = arrived(&trace.counts, cycles, dead_time);
        let came = came.iter().sum::<f64>();
        (came > 0.0).then(|| 1.0 - trace.counts.iter().sum::<f64>() / came)
    });
    median(lost)
}

impl<'a> Background<'a> {
    fn of(trace: &'a Trace) -> Self {
        Self {
            counts: &trace.counts,
            cycles: trace.cycles,
            clear: clear_bins(&trace.counts),
        }
    }

    /// The logarithm of the likelihood with a dead time over that without, for an exposure of `cycles`.
    fn log_ratio(&self, cycles: f64, dead_time: usize) -> f64 {
        let bins = self.counts.len();
        let is_clear = |bin: usize| f64::from(u8::from(self.clear[bin]));
        let mut before = vec![0.0; bins + 1];
        for bin in 0..bins {
            before[bin + 1] = before[bin] + is_clear(bin);
        }
        // Background bins that a photon of a bin blinds.
        let blinded = |bin: usize| before[(bin + dead_time + 1).min(bins)] - before[bin + 1];
        // What photons yet to come blind: of background bins each, and of the others.
        let (mut each, mut others) = (0.0, 0.0);
        let (mut left_bins, mut left) = (0.0, 0.0);
        for bin in 0..bins {
            if self.clear[bin] {
                each += blinded(bin);
                left += self.counts[bin];
                left_bins += 1.0;
            } else {
                others += self.counts[bin] * blinded(bin);
            }
        }
        // What photons that have come blind from here on, and here.
        let (mut known, mut blind, mut ratio) = (0.0, 0.0, 0.0);
        for bin in 0..bins {
            let count = self.counts[bin];
            if self.clear[bin] {
                let live = cycles - blind;
                if live < 0.0 {
                    return f64::NEG_INFINITY;
                }
                if left_bins > 1.0 && left > 0.0 {
                    let to_come = left_bins * cycles - known - others - each * left / left_bins;
                    let even = 1.0 / left_bins;
                    let share = live / to_come.max(live.max(1.0));
                    let share = share.clamp(0.1 * even, (10.0 * even).min(0.5 + 0.5 * even));
                    ratio += count * (share / even).ln()
                        + (left - count) * ((1.0 - share) / (1.0 - even)).ln();
                }
                left -= count;
                left_bins -= 1.0;
                each -= blinded(bin);
                known -= blind;
            } else {
                others -= count * blinded(bin);
            }
            known += count * blinded(bin);
            blind += count
                - bin
                    .checked_sub(dead_time)
                    .map_or(0.0, |bin| self.counts[bin]);
        }
        ratio
    }

    /// The logarithm of the likelihood that each background photon lies where it does, if a bin's share is
    /// this power of its live laser cycles.
    fn log_likelihood(&self, cycles: f64, dead_time: usize, power: f64) -> f64 {
        let live = live(self.counts, cycles, dead_time);
        let clear = live
            .iter()
            .zip(self.counts)
            .zip(&self.clear)
            .filter(|(_, clear)| **clear);
        let (mut sum, mut photons, mut all) = (0.0, 0.0, 0.0);
        for ((&live, &count), _) in clear {
            sum += count * power * live.max(0.5).ln();
            photons += count;
            all += live.max(0.5).powf(power);
        }
        sum - photons * all.max(f64::MIN_POSITIVE).ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::{Rng, SeedableRng};
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg32;
    use rayon::prelude::*;

    const BINS: usize = 128;

    fn trace(pixel: usize, cycles: u32, counts: Vec<f64>) -> Trace {
        Trace {
            pixel,
            cycles: cycles.into(),
            live: vec![1.0; counts.len()],
            counts,
            truth_mm: None,
        }
    }

    /// Histograms of 64 pixels under flat light, of a TDC that is blind for `dead_time` bins.
    fn flat(rng: &mut Pcg32, cycles: u32, light: f64, dead_time: usize) -> Vec<Trace> {
        let pixel = |pixel| {
            let mut counts = vec![0.0; BINS];
            for _ in 0..cycles {
                let mut bin = 0;
                loop {
                    let uniform = (f64::from(rng.next_u32()) + 0.5) / 4_294_967_296.0;
                    #[allow(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "empty bins"
                    )]
                    let empty = (-uniform.ln() / light) as usize;
                    bin += empty;
                    if bin >= BINS {
                        break;
                    }
                    counts[bin] += 1.0;
                    bin += 1 + dead_time;
                }
            }
            trace(pixel, cycles, counts)
        };
        (0..64).map(pixel).collect()
    }

    /// Short dead times, too: their background has a step, and a hole behind each bright bin.
    #[test]
    fn a_dead_time_is_found_by_itself() {
        let mut rng = Pcg32::seed_from_u64(1);
        for (dead_time, light, cycles) in [
            (128, 0.02, 400),
            (128, 0.047, 400),
            (20, 0.047, 2000),
            (5, 0.05, 4000),
        ] {
            let traces = flat(&mut rng, cycles, light, dead_time);
            let Tdc::DeadTime { bins, .. } = tdc(&traces) else {
                panic!("none of {dead_time} at {light}");
            };
            assert!(
                (dead_time - dead_time / 20..=dead_time).contains(&bins),
                "{bins} of {dead_time}"
            );
        }
    }

    /// Fog, tails and lenses make light fall in all pixels alike.
    #[test]
    fn a_fall_that_all_pixels_share_is_no_pile_up() {
        let mut rng = Pcg32::seed_from_u64(7);
        for (decay, floor) in [(20.0, 0.0), (30.0, 0.2), (90.0, 0.0)] {
            let fog = |pixel: usize, rng: &mut Pcg32| {
                let bright = 2.0 + (pixel % 8) as f64;
                let mean = |bin| bright * (floor + f64::exp(-f64::from(bin) / decay));
                let counts = (0..128u16).map(|bin| Poisson::new(mean(bin)).unwrap().sample(rng));
                trace(pixel, 1, counts.collect())
            };
            let traces: Vec<Trace> = (0..256).map(|pixel| fog(pixel, &mut rng)).collect();
            assert_eq!(tdc_without_cycles(&traces), None, "{decay} {floor}");
        }
    }

    /// One hot pixel loses nearly all of its photons, the others nearly none.
    #[test]
    fn a_hot_pixel_does_not_say_what_is_lost() {
        let mut rng = Pcg32::seed_from_u64(8);
        let mut traces = flat(&mut rng, 2000, 0.004, 128);
        traces[9].counts = flat(&mut rng, 2000, 0.1, 128).swap_remove(9).counts;
        let Some(Tdc::OnePhotonIn { cycles, lost }) = tdc_without_cycles(&traces) else {
            panic!("not found");
        };
        assert!((1900.0..2100.0).contains(&cycles), "{cycles}");
        assert!((0.18..0.26).contains(&lost), "{lost}");
    }

    /// Flat counts of a TDC without a dead time, as sparse and as dense as they come, and with laser cycles
    /// that would allow one, or unknown ones. At most two recordings in 1000 appear to have a dead time (Ville's
    /// inequality), so none or one in all. `DTOF_SLOW=1` draws larger and more of them.
    #[test]
    fn flat_counts_have_no_dead_time() {
        let (seeds, pixels) = match std::env::var_os("DTOF_SLOW") {
            Some(_) => (100, 1024),
            None => (30, 256),
        };
        let mut all = 0;
        for (light, cycles) in [(0.01, 100), (0.05, 20), (0.3, 100), (2.0, 400)] {
            let poisson = Poisson::new(light).unwrap();
            let found = (0u64..seeds).into_par_iter().filter(|&seed| {
                let mut rng = Pcg32::seed_from_u64(seed);
                let mut histogram = || (0..BINS).map(|_| poisson.sample(&mut rng)).collect();
                let traces = (0..pixels).map(|pixel| trace(pixel, cycles, histogram()));
                let traces: Vec<Trace> = traces.collect();
                matches!(tdc(&traces), Tdc::DeadTime { .. })
                    || tdc_without_cycles(&traces).is_some()
            });
            let found = found.count();
            all += found;
        }
        assert!(all <= 1, "{all} of {seeds} in each");
    }
}
