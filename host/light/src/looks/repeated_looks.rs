//! False alarms of a whole exposure: a pixel that looks every X laser cycles
//! while L1 < N < L2.
//!
//! There is no closed form, because the looks share photons. The probability of a false alarm
//! in an exposure is at least that of its worst look, and at most the sum over its looks.
//! Simulation finds the value in between: [`FalseAlarms`] counts,
//! [`table`](crate::looks::table) interpolates.

use anyhow::Result;
use dtof_core::Count;
use dtof_core::paper::Threshold;
use rand_pcg::Pcg64;
use rayon::prelude::*;

use crate::looks::exposure::{Exposures, Looks};
use crate::looks::single_look::SingleLook;
use crate::rates::Rates;

/// The exact law of each look of an exposure.
#[derive(Clone, Debug)]
pub struct RepeatedLooks<'a> {
    looks: &'a [SingleLook],
}

/// The single looks at steps 1 to `last`, the input of [`RepeatedLooks`].
#[must_use]
pub fn single_looks(bins: u32, mean_a_step: f64, last: u32) -> Vec<SingleLook> {
    let look = |step: u32| SingleLook::new(bins, mean_a_step * f64::from(step));
    (1..=last).into_par_iter().map(look).collect()
}

impl<'a> RepeatedLooks<'a> {
    /// Looks `first` to `last` of [`single_looks`].
    #[must_use]
    pub fn new(steps: &'a [SingleLook], first: u32, last: u32) -> Self {
        Self {
            looks: &steps[first as usize - 1..last as usize],
        }
    }

    /// The exact bounds for the exposure.
    #[must_use]
    pub fn bounds(&self, threshold: &Threshold) -> Bounds {
        let mut bounds = Bounds::default();
        for look in self.looks {
            let probability = look.false_alarm_probability(threshold);
            bounds.worst_look = bounds.worst_look.max(probability);
            bounds.sum += probability;
            bounds.independent -= (-probability).ln_1p();
        }
        bounds.sum = bounds.sum.min(1.0);
        bounds
    }
}

/// Bounds on the probability of a false alarm in an exposure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bounds {
    /// Lower bound: the probability at the worst look.
    pub worst_look: f64,
    /// Upper bound: the sum of the probabilities of all looks, at most 1.
    pub sum: f64,
    /// `H`: −ln of the probability of no false alarm if the looks were independent.
    /// Looks share photons, so the simulated intensity is lower;
    /// [`table`](crate::looks::table) has the ratio.
    pub independent: f64,
}

/// A point of the simulated grid: 128 bins, background only.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Mean background photons a bin at the first look.
    pub first_mean: f64,
    /// The first look, in steps of X laser cycles.
    pub first: u32,
    /// The last looks to count for, ascending.
    pub lasts: Vec<u32>,
}

/// Bins of the histograms simulated.
pub const BINS: usize = 128;
/// The fewest photons of a reported peak, the default of the commands.
pub const MINIMUM_COUNT: u16 = 5;
/// α from 1 to 10 in halves.
pub const ALPHA_STEPS: usize = 19;

/// α at `step` of [`ALPHA_STEPS`], in 1/256.
#[must_use]
pub fn alpha_bits(step: usize) -> u16 {
    u16::try_from(256 + 128 * step).unwrap_or(u16::MAX)
}

/// Exposures with a false alarm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FalseAlarms {
    /// Simulated exposures.
    pub exposures: u64,
    /// For each last look and each α, exposures with a false alarm.
    pub events: Vec<[u64; ALPHA_STEPS]>,
}

impl FalseAlarms {
    /// Zero counts for `lasts` last looks.
    #[must_use]
    pub fn new(lasts: usize) -> Self {
        Self {
            exposures: 0,
            events: vec![[0; ALPHA_STEPS]; lasts],
        }
    }

    /// Simulates `exposures` exposures at `point`.
    ///
    /// # Errors
    /// Fails if the mean is negative or not a number.
    pub fn trial(point: &Point, exposures: u32, rng: &mut Pcg64) -> Result<Self> {
        let rates = Rates::without_target(point.first_mean / f64::from(point.first));
        let looks = Looks {
            x: 1,
            first: point.first,
            last: point.lasts.last().copied().unwrap_or(point.first),
        };
        let simulated = Exposures::new(&rates, u16::try_from(BINS)?, looks)?;
        let minimum_count = Count::saturating(MINIMUM_COUNT.into());
        let mut tally = Self::new(point.lasts.len());
        for _ in 0..exposures {
            let highest = simulated.highest_alphas::<BINS>(minimum_count, &point.lasts, rng);
            for (events, highest) in tally.events.iter_mut().zip(highest) {
                let Some(highest) = highest else { continue };
                for (step, events) in events.iter_mut().enumerate() {
                    *events += u64::from(alpha_bits(step) <= highest);
                }
            }
            tally.exposures += 1;
        }
        Ok(tally)
    }
}

impl std::ops::AddAssign<&Self> for FalseAlarms {
    fn add_assign(&mut self, other: &Self) {
        self.exposures += other.exposures;
        for (sum, more) in self.events.iter_mut().zip(&other.events) {
            for (sum, more) in sum.iter_mut().zip(more) {
                *sum += more;
            }
        }
    }
}
