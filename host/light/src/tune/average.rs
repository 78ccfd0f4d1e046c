//! Settings of the average rule for a required rate of false alarms.
//!
//! There is no table for this rule: exposures without a target are simulated. Each exposure
//! yields the highest α with which one of its looks fires. For each L1, α is the smallest value
//! with which the upper 99 % limit of the share of firing exposures is within the limit. A
//! limit below 4.6 over the number of exposures cannot be met. The L1 with the shortest mean
//! time to an event wins. False alarms are counted in separate exposures.

use std::ops::Range;

use anyhow::{Result, ensure};
use dtof_core::fixed::types::U8F8;
use dtof_core::{AverageRule, Count, DepthEstimator, Histogram, RangeGate};
use rayon::prelude::*;

use super::shortest::{false_alarms, for_bins, shortest};
use super::{Request, candidates, check};
use crate::counts::binomial;
use crate::looks::detections::{DetectionSettings, Detections};
use crate::looks::exposure::{Exposures, Looks};
use crate::progress::{Part, Progress};
use crate::rates::Rates;
use dtof_data::random::trial_rng;

/// Approximate photons of all simulated exposures, which take some seconds.
const PHOTONS: f64 = 5e8;
/// Trials that share the exposures.
const TRIALS: u16 = 64;
/// Their numbers, which no other simulation of `tune` uses.
pub(super) const NUMBERS: Range<u16> = 1000..1000 + TRIALS;
/// The most exposures of a trial.
const LONGEST_TRIAL: f64 = 2000.0;
/// The upper limit of a simulated share is one-sided, for 99 % confidence.
const UPPER_TAIL: f64 = 0.01;

/// The settings and the performance to expect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuned {
    /// α.
    pub alpha: U8F8,
    /// L1.
    pub l1: u16,
    /// Exposures without a target that determined α.
    pub exposures: u64,
    /// Further exposures without a target, and how many of them had an event.
    pub false_alarms: (u64, u64),
    /// Exposures simulated with the target.
    pub detections: Detections,
}

/// Finds α and L1.
///
/// # Errors
/// Fails if the request is invalid or cannot be met, or if `progress` ends the calculation; the message is
/// one line.
pub fn tune(request: &Request, progress: Progress) -> Result<Tuned> {
    check(request)?;
    let l1s = candidates(request);
    let looks: Vec<Looks> = l1s
        .iter()
        .map(|&l1| Looks::new(request.x, l1, request.l2))
        .collect();
    let highest = highest_alphas(request, &looks, progress)?;
    let exposures = highest.len() as u64;
    let minimum_count = Count::saturating(request.minimum_count.into());
    let mut all = Vec::new();
    let mut rarest = 1.0_f64;
    for (at, (&l1, &looks)) in l1s.iter().zip(&looks).enumerate() {
        let limit = request.limit.per_exposure(looks);
        rarest = rarest.min(limit);
        let highest = highest.iter().map(|of| of[at]).collect();
        let Some(alpha) = smallest_alpha(highest, limit) else {
            continue;
        };
        let settings = DetectionSettings {
            looks,
            rule: AverageRule::new(alpha, minimum_count).into(),
            estimator: DepthEstimator::Centroid3,
        };
        all.push((settings, (settings, alpha, l1)));
    }
    ensure!(
        !all.is_empty(),
        "no α found for a false alarm in {:.0} exposures, as {exposures} are simulated: allow more \
         false alarms, or take --rule window",
        1.0 / rarest
    );
    let ((settings, alpha, l1), detections) = shortest(request, &all, progress)?;
    Ok(Tuned {
        alpha,
        l1,
        exposures,
        false_alarms: false_alarms(request, &settings, progress)?,
        detections,
    })
}

/// The smallest α that a share of at most `limit` of the exposures reaches, with 99 %
/// confidence. `highest` has the highest α of each exposure. `None` if no α does.
fn smallest_alpha(mut highest: Vec<Option<u16>>, limit: f64) -> Option<U8F8> {
    let times = highest.len();
    // The upper confidence limit is within `limit` if, at that probability, so few successes
    // lie in the tail. It grows with the count.
    let holds =
        |&reached: &usize| binomial::at_most(reached as u64, times as u64, limit) <= UPPER_TAIL;
    let reached = (0..times).take_while(holds).last()?;
    highest.sort_unstable();
    let first_above = highest.get(times - 1 - reached)?;
    let alpha = first_above.map_or(Some(0), |highest| highest.checked_add(1))?;
    Some(U8F8::from_bits(alpha))
}

/// Simulates exposures without a target. For each exposure and candidate: the highest α, in
/// 1/256, that fires at any look; `None` if none fires.
fn highest_alphas(
    request: &Request,
    looks: &[Looks],
    progress: Progress,
) -> Result<Vec<Vec<Option<u16>>>> {
    let trial = for_bins!(request.bins, trial);
    let photons = request.background * f64::from(request.bins) * f64::from(request.l2);
    let most = (PHOTONS / photons / f64::from(TRIALS)).clamp(1.0, LONGEST_TRIAL);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let exposures = most as u32;
    let part = Part::new(progress, (u32::from(TRIALS) * exposures).into())?;
    let trials = NUMBERS
        .into_par_iter()
        .map(|number| trial(request, looks, number, exposures, &part))
        .collect::<Result<Vec<_>>>()?;
    Ok(trials.into_iter().flatten().collect())
}

fn trial<const BINS: usize>(
    request: &Request,
    looks: &[Looks],
    number: u16,
    exposures: u32,
    part: &Part,
) -> Result<Vec<Vec<Option<u16>>>> {
    let rates = Rates::without_target(request.background);
    let minimum_count = Count::saturating(request.minimum_count.into());
    // The first candidate has the looks of all.
    let simulated = Exposures::new(&rates, request.bins, looks[0])?;
    let mut rng = trial_rng(request.seed, number);
    let exposure = |_| {
        let mut highest = vec![None; looks.len()];
        simulated.run::<BINS>(&RangeGate::full(), &mut rng, |step, histogram| {
            let found = highest_alpha(histogram, minimum_count);
            for (highest, looks) in highest.iter_mut().zip(looks) {
                if step >= looks.first {
                    *highest = found.max(*highest);
                }
            }
            false
        });
        part.next().map(|()| highest)
    };
    (0..exposures).map(exposure).collect()
}

/// The highest α in 1/256 with which the average rule fires on `histogram`: it fires if
/// `(256·(B·peak - T))² > α²·B·T`, in α's units.
fn highest_alpha<const BINS: usize>(
    histogram: &Histogram<BINS>,
    minimum_count: Count,
) -> Option<u16> {
    let peak = histogram.peak().count;
    let (bins, total) = (BINS as u64, u64::from(histogram.total()));
    let above = bins * u64::from(peak.raw()) - total;
    if peak < minimum_count || above == 0 {
        return None;
    }
    let squared = ((256 * above).pow(2) - 1) / (bins * total);
    Some(u16::try_from(squared.isqrt()).unwrap_or(u16::MAX))
}

#[cfg(test)]
mod tests {
    use dtof_core::RangeGate;
    use dtof_core::rule::detect;

    use super::*;

    #[test]
    fn the_highest_alpha_is_the_last_that_fires() {
        let mut fired = 0;
        for seed in 0..2000u32 {
            // Up to 15 photons a bin, or up to 7: then the peak is sometimes the minimum.
            let mask = [15, 7][seed as usize % 2];
            let frame: [u32; 8] =
                std::array::from_fn(|bin| (seed.wrapping_mul(2_654_435_761) >> (4 * bin)) & mask);
            let mut histogram = Histogram::<8>::new();
            histogram.add_frame(&frame, &RangeGate::full());
            let minimum = Count::saturating(5);
            let fires = |alpha: u16| {
                let rule = AverageRule::new(U8F8::from_bits(alpha), minimum);
                let (gate, estimator) = (RangeGate::full(), DepthEstimator::default());
                detect(&histogram, &gate, &rule, &estimator).is_some()
            };
            match highest_alpha(&histogram, minimum) {
                None => assert!(!fires(0)),
                Some(alpha) => {
                    assert!(fires(alpha) && !fires(alpha + 1), "{frame:?}");
                    fired += 1;
                }
            }
        }
        assert!(fired > 1000, "{fired}");
    }

    #[test]
    fn the_upper_limit_of_the_share_is_within_the_limit() {
        let highest = |reached: usize| {
            let reach = (0..1000).map(|at| (at < reached).then_some(700));
            smallest_alpha(reach.collect(), 0.01)
        };
        // 2 of 1,000 are at most 1 % with 99 % confidence, 3 are not.
        assert_eq!(highest(2), Some(U8F8::ZERO));
        assert_eq!(highest(3), Some(U8F8::from_bits(701)));
        assert_eq!(smallest_alpha(vec![None; 400], 0.01), None);
    }
}
