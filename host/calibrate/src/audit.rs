//! Whether a recording holds photon counts.
//!
//! Decisions rest on the scatter of photon counts: what is no count has another one. Let three neighbouring bins hold a, b
//! and c photons, and n together. If their means lie on a straight line, each of the n photons adds 1, −2 or 1 to
//! a − 2b + c, with the mean 0 and the variance 2, so (a − 2b + c)² ÷ 2n has the mean 1, whatever n is. A bin that counts at
//! most once a laser cycle and is full in the share p of them scatters less, by 1 − p.

use dtof_photons::warnings::greatest_divisor;

use super::find::observed::Trace;
use super::find::significance::median;

/// Of larger recordings some of the histograms tell, with so many bins.
const BINS: usize = 1 << 20;
/// The most peaks of a histogram.
const PEAKS: usize = 8;
/// So many bins before and after the highest bin of a peak belong to it in any case.
const REACH: usize = 3;
/// Fewer triples of bins do not tell. So many scatter by 0.08.
const FEWEST: usize = 600;
/// From so many photons on a triple is nearly Gaussian. The median of the test then is as good as the mean, and a peak that
/// was not found does not move it.
const GAUSSIAN: f64 = 10.0;
/// The median of the square of a Gaussian number of variance 1.
const MEDIAN: f64 = 0.4549;
/// Counts scatter between so little and so much of what photons do: anything else is none.
const COUNTS: [f64; 2] = [0.7, 1.4];
/// If the sum of all histograms scatters so many times as much as each, their bins are alike.
const ALIKE: f64 = 10.0;
/// From this share of empty bins on that photons would have filled, something was subtracted.
const CUT: f64 = 0.1;

/// How bins beside the peaks scatter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// The mean of (a − 2b + c)² ÷ 2n over neighbouring bins: 1 for photon counts.
    pub mean: f64,
    /// Its median, over that of a Gaussian.
    pub median: f64,
    /// The mean of n, the photons of three bins.
    pub photons: f64,
    /// The share of the laser cycles in which a bin is full, if it counts at most once in each; 0 if they are not known.
    pub full: f64,
    /// The number of triples.
    pub triples: usize,
}

impl Scatter {
    /// Of histograms, each with its laser cycles, if they are known.
    #[must_use]
    pub fn of<'a>(histograms: impl IntoIterator<Item = (&'a [f64], Option<f64>)>) -> Self {
        let (mut tests, mut photons, mut full) = (Vec::new(), 0.0, 0.0);
        for (counts, cycles) in histograms {
            let is_beside = beside_peaks(counts);
            for (bins, is_beside) in counts.windows(3).zip(is_beside.windows(3)) {
                let n: f64 = bins.iter().sum();
                if n > 0.0 && !is_beside.contains(&false) {
                    let bend = bins[0] - 2.0 * bins[1] + bins[2];
                    tests.push(bend * bend / (2.0 * n));
                    photons += n;
                    full += cycles.map_or(0.0, |cycles| (n / 3.0 / cycles).min(1.0));
                }
            }
        }
        let triples = tests.len();
        let each = triples.max(1) as f64;
        Self {
            mean: tests.iter().sum::<f64>() / each,
            median: median(tests) / MEDIAN,
            photons: photons / each,
            full: full / each,
            triples,
        }
    }

    /// How many times the variance is that of photons, as far as it differs surely; `None` if too few bins tell, or if they
    /// do not differ.
    #[must_use]
    pub fn unlike_counts(&self) -> Option<f64> {
        let by_median = match self.photons >= GAUSSIAN {
            true => self.median,
            false => self.mean,
        };
        let [least, most] = COUNTS;
        if self.triples < FEWEST {
            None
        } else if self.mean.min(by_median) > most {
            Some(self.mean.min(by_median))
        } else if self.mean.max(by_median) < least * (1.0 - self.full) {
            Some(self.mean.max(by_median))
        } else {
            None
        }
    }
}

/// For each bin whether it lies beside the peaks. A peak reaches from its highest bin to where three bins together hold no
/// more than usual.
fn beside_peaks(counts: &[f64]) -> Vec<bool> {
    let all = counts.len();
    let around = |bin: usize| {
        counts[bin.saturating_sub(1)..(bin + 2).min(all)]
            .iter()
            .sum()
    };
    let mut sums: Vec<f64> = (0..all).map(around).collect();
    let usual = median(sums.iter().copied());
    let noise = usual.sqrt();
    let belongs: Vec<bool> = sums.iter().map(|&sum| sum > usual + 2.0 * noise).collect();
    let mut is_beside = vec![true; all];
    for _ in 0..PEAKS {
        let top = (0..all).max_by(|&one, &other| sums[one].total_cmp(&sums[other]));
        let Some(top) = top.filter(|&top| sums[top] > usual + 6.0 * noise + 6.0) else {
            break;
        };
        let before = (0..top.saturating_sub(REACH)).rev();
        let first = top.saturating_sub(REACH) - before.take_while(|&bin| belongs[bin]).count();
        let after = (top + REACH + 1).min(all)..all;
        let end = after.start + after.take_while(|&bin| belongs[bin]).count();
        is_beside[first..end].fill(false);
        sums[first..end].fill(f64::NEG_INFINITY);
    }
    is_beside
}

/// What is known of a recording before anything is corrected or decided.
#[derive(Clone, Debug, PartialEq)]
pub struct Audit {
    /// Of each histogram by itself.
    pub scatter: Scatter,
    /// Of the sum of all.
    pooled: Scatter,
    /// The largest number that divides all counts; 0 without photons.
    divisor: u64,
    /// The share of the bins beside the peaks that are empty and would not be.
    cut: f64,
}

impl Audit {
    /// Of histograms as they were recorded, with their laser cycles if they are known.
    #[must_use]
    pub fn of(traces: &[Trace], has_cycles: bool) -> Self {
        let bins = traces.first().map_or(0, |trace| trace.counts.len());
        // Odd, so that it is not always the same column.
        let step = (traces.len() * bins / BINS) | 1;
        let some = || traces.iter().step_by(step);
        let cycles = |trace: &Trace| has_cycles.then_some(trace.cycles);
        let each = some().map(|trace| (&trace.counts[..], cycles(trace)));
        let mut pooled = vec![0.0; bins];
        for trace in some() {
            for (sum, count) in pooled.iter_mut().zip(&trace.counts) {
                *sum += count;
            }
        }
        let counts = traces.iter().flat_map(|trace| &trace.counts);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "counts"
        )]
        let divisor = counts.fold(0, |divisor, &count| match divisor {
            1 => 1,
            divisor => greatest_divisor(divisor, count as u64),
        });
        Self {
            scatter: Scatter::of(each),
            pooled: Scatter::of([(&pooled[..], None)]),
            divisor,
            cut: cut(some()),
        }
    }

    /// That these are no photon counts.
    #[must_use]
    pub fn no_counts(&self, false_alarm: f64) -> Option<String> {
        let times = self.scatter.unlike_counts()?;
        let differ = format!(
            "neighbouring bins differ {} times as much as photon counts do (variance)",
            short(times)
        );
        if times < 1.0 {
            return Some(format!(
                "{differ}: as if they were averaged, smoothed or divided, or distances. A decision needs the photons that \
                 were counted: save their sums"
            ));
        }
        let divisor = self.divisor;
        let cause = if divisor > 1 {
            format!("all are multiples of {divisor}: save `counts // {divisor}`")
        } else if self.cut > CUT {
            format!(
                "{:.0} % of the bins are 0, as if background was subtracted: save the counts as they were read",
                self.cut * 100.0
            )
        } else if self.pooled.mean > ALIKE * self.scatter.mean {
            "the same ones in all pixels, so the bins are of unequal width: sum them to bins of equal width before you save \
             them"
                .to_owned()
        } else {
            "they were multiplied or corrected, or the bins of each pixel are of unequal width: save the counts as they were \
             read"
                .to_owned()
        };
        Some(format!(
            "{differ}, so more than {} % of the empty pixels may have a depth. {}{}",
            false_alarm * 100.0,
            cause[..1].to_uppercase(),
            &cause[1..]
        ))
    }
}

/// Two digits.
fn short(times: f64) -> String {
    match times {
        10.0.. => format!("{times:.0}"),
        1.0.. => format!("{times:.1}"),
        _ => format!("{times:.2}"),
    }
}

/// By how much the share of empty bins beside the peaks is above that of photons with the same mean.
fn cut<'a>(traces: impl Iterator<Item = &'a Trace>) -> f64 {
    let (mut bins, mut empty, mut expected) = (0.0, 0.0, 0.0);
    for trace in traces {
        let is_beside = beside_peaks(&trace.counts);
        let beside = trace.counts.iter().zip(&is_beside);
        let counts: Vec<f64> = beside
            .filter(|(_, is)| **is)
            .map(|(count, _)| *count)
            .collect();
        let all = counts.len() as f64;
        let mean = counts.iter().sum::<f64>() / all.max(1.0);
        bins += all;
        empty += counts.iter().filter(|&&count| count <= 0.0).count() as f64;
        expected += all * (-mean).exp();
    }
    (empty - expected) / f64::max(bins, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_theory::rates::bin_share;
    use proptest::prelude::*;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

    const BINS: usize = 128;

    /// So many histograms with these means, each count changed by `change`.
    fn recorded(
        histograms: usize,
        means: &dyn Fn(usize, usize) -> f64,
        change: &dyn Fn(usize, f64) -> f64,
        seed: u64,
    ) -> Vec<Trace> {
        let mut rng = Pcg64::seed_from_u64(seed);
        let mut count = |mean: f64| match mean > 0.0 {
            true => Poisson::new(mean).unwrap().sample(&mut rng),
            false => 0.0,
        };
        let trace = |pixel: usize| Trace {
            pixel,
            cycles: 1e9,
            counts: (0..BINS)
                .map(|bin| change(bin, count(means(pixel, bin))))
                .collect(),
            live: vec![1.0; BINS],
            truth_mm: None,
        };
        (0..histograms).map(trace).collect()
    }

    /// A background and some pulses.
    fn scene(background: f64, pulses: Vec<(f64, f64, f64)>) -> impl Fn(usize, usize) -> f64 {
        move |_, bin| {
            let of = |&(photons, place, sigma): &(f64, f64, f64)| {
                #[allow(clippy::cast_possible_truncation)]
                let share = bin_share(bin as u32, place, sigma);
                photons * share
            };
            background + pulses.iter().map(of).sum::<f64>()
        }
    }

    fn said(traces: &[Trace]) -> Option<String> {
        Audit::of(traces, false).no_counts(0.01)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Whatever the light is: level, slope, pulses.
        #[test]
        fn photon_counts_are_counts(
            background in -3.0..10.0_f64,
            slope in 0.0..1.0_f64,
            pulses in prop::collection::vec((1.0..9.0_f64, 5.0..120.0, 0.5..2.5), 0..5),
            seed: u64,
        ) {
            let pulses = pulses.into_iter().map(|(photons, place, sigma)| (photons.exp(), place, sigma));
            let even = scene(0.0, pulses.collect());
            let level = |bin: usize| background.exp() * (1.0 - slope * bin as f64 / BINS as f64);
            let traces = recorded(16, &|pixel, bin| level(bin) + even(pixel, bin), &|_, n| n, seed);
            let audit = Audit::of(&traces, false);
            prop_assert_eq!(audit.no_counts(0.01), None, "{:?}", audit);
        }

        /// Counts times a number scatter so many times as much. A few peaks of noise are left out.
        #[test]
        fn a_factor_is_found(factor in 2_u32..100, background in 1.0..200.0_f64, seed: u64) {
            let light = scene(background, vec![(300.0, 60.5, 1.0)]);
            let traces = recorded(32, &light, &|_, n| n * f64::from(factor), seed);
            let audit = Audit::of(&traces, false);
            let found = audit.scatter.unlike_counts().unwrap() / f64::from(factor);
            prop_assert!((0.7..1.2).contains(&found), "{}", found);
            let says = audit.no_counts(0.01).unwrap();
            let cause = format!("All are multiples of {factor}: save `counts // {factor}`");
            prop_assert!(says.ends_with(&cause), "{}", says);
        }

        #[test]
        fn background_that_was_taken_off_is_found(background in 5.0..1000.0_f64, seed: u64) {
            let light = scene(background, vec![(3.0 * background, 60.5, 1.0)]);
            let traces = recorded(32, &light, &|_, n| (n - background.round()).max(0.0), seed);
            let says = said(&traces).unwrap();
            prop_assert!(says.contains(" % of the bins are 0, as if background was subtracted"), "{}", says);
        }

        /// The same widths in all pixels, or others in each.
        #[test]
        fn bins_of_unequal_width_are_found(differ in 0.35..0.8_f64, background in 40.0..400.0_f64, each: bool, seed: u64) {
            let mut rng = Pcg64::seed_from_u64(seed);
            let widths: Vec<f64> = (0..32 * BINS)
                .map(|_| 1.0 + differ * rand_distr::Uniform::new(-1.0, 1.0).unwrap().sample(&mut rng))
                .collect();
            let width = |pixel: usize, bin: usize| widths[if each { pixel * BINS } else { 0 } + bin];
            let traces = recorded(32, &|pixel, bin| background * width(pixel, bin), &|_, n| n, seed);
            let says = said(&traces).unwrap();
            let cause = if each { "bins of each pixel are of unequal width" } else { "the bins are of unequal width" };
            prop_assert!(says.contains(cause), "{}", says);
        }

        /// Averages of `window` counts, or distances with a noise of a few millimetres.
        #[test]
        fn averages_and_distances_are_no_counts(window in 2_usize..8, background in 50.0..2000.0_f64, seed: u64) {
            let mut traces = recorded(32, &|_, _| background, &|_, n| n, seed);
            for trace in &mut traces {
                let mean = |at: usize| trace.counts[at..(at + window).min(BINS)].iter().sum::<f64>() / window as f64;
                trace.counts = (0..BINS - window).map(|at| mean(at).round()).collect();
            }
            prop_assert!(said(&traces).unwrap().contains("averaged, smoothed or divided, or distances"));
            let depths = recorded(32, &|_, _| 9.0, &|_, n| background + n, seed);
            prop_assert!(said(&depths).unwrap().contains("averaged, smoothed or divided, or distances"));
        }
    }

    #[test]
    fn too_few_bins_do_not_tell() {
        let light = scene(20.0, vec![]);
        let times_eight = |histograms| said(&recorded(histograms, &light, &|_, n| 8.0 * n, 1));
        assert_eq!(times_eight(4), None);
        assert!(times_eight(8).is_some());
        assert_eq!(said(&[]), None);
        assert_eq!(said(&recorded(100, &|_, _| 0.0, &|_, n| n, 1)), None);
    }

    /// A bin that counts once a laser cycle at most, in half of them.
    #[test]
    fn bins_that_are_often_full_scatter_less() {
        let mut rng = Pcg64::seed_from_u64(1);
        let half = rand_distr::Binomial::new(1000, 0.5).unwrap();
        let mut traces = recorded(32, &|_, _| 0.0, &|_, n| n, 1);
        for trace in &mut traces {
            trace.cycles = 1000.0;
            trace.counts.fill_with(|| half.sample(&mut rng) as f64);
        }
        assert!(Audit::of(&traces, false).no_counts(0.01).is_some());
        assert_eq!(Audit::of(&traces, true).no_counts(0.01), None);
    }
}
