//! The thresholds at which rules have equal false alarms: exposures without a target are
//! simulated, and all rules decide on the same ones.

use anyhow::{Result, ensure};
use dtof_core::{AnyRule, Count10, DepthEstimator, Histogram, RangeGate, detect};
use rand_distr::{Distribution, Poisson, Uniform};
use rayon::prelude::*;

use super::method::Rule;
use dtof_engine::settings::Settings;
use dtof_engine::with_bins;
use dtof_options::Refused;
use dtof_theory::random::pixel_rng;

/// Exposures, unless their photons would be more than [`MOST_PHOTONS`].
const EXPOSURES: u32 = 20_000;
/// At least so many, whatever they cost.
const LEAST_EXPOSURES: u32 = 1_000;
const MOST_PHOTONS: f64 = 4e8;
/// Exposures with a false alarm at a threshold, at least.
const LEAST_EVENTS: f64 = 5.0;

/// How many exposures end with an event at each threshold.
pub struct Thresholds {
    rules: Vec<Rule>,
    /// Of each rule: how many exposures fire at so many of the lowest thresholds.
    highest: Vec<Vec<u32>>,
    exposures: u32,
}

impl Thresholds {
    /// Of `rules`, for `background` photons a bin and laser cycle, with gate, L1, L2 and X of
    /// `settings`.
    ///
    /// # Errors
    /// If the number of bins is none.
    pub fn simulate(
        rules: &[Rule],
        settings: &Settings,
        background: f64,
        seed: u64,
    ) -> Result<Self> {
        let highest = with_bins!(settings.bins, BINS => {
            highest::<BINS>(rules, settings, background, seed)
        })??;
        Ok(Self {
            rules: rules.to_vec(),
            exposures: highest.first().map_or(0, |counts| counts.iter().sum()),
            highest,
        })
    }

    /// The least threshold at which at most `share` of the exposures end with an event.
    ///
    /// # Errors
    /// If even the highest has more.
    pub fn of(&self, rule: Rule, share: f64) -> Result<f64> {
        let known = self.rules.iter().zip(&self.highest);
        let counts = known.into_iter().find(|(known, _)| **known == rule);
        let counts = counts.map_or(&[][..], |(_, counts)| counts);
        let wanted = share * f64::from(self.exposures);
        ensure!(
            wanted >= LEAST_EVENTS,
            Refused::value(
                "false_alarm",
                share,
                format!(
                    "{} exposures show shares from {} on",
                    self.exposures,
                    LEAST_EVENTS / f64::from(self.exposures)
                )
            )
        );
        let mut firing = self.exposures;
        for (number, &here) in counts.iter().enumerate() {
            firing -= here;
            if f64::from(firing) <= wanted {
                return Ok(Rule::threshold(number));
            }
        }
        anyhow::bail!("{rule:?}: no threshold has as few false alarms as {share}")
    }
}

/// Of each rule: how many exposures fire at so many of the lowest thresholds.
fn highest<const BINS: usize>(
    rules: &[Rule],
    settings: &Settings,
    background: f64,
    seed: u64,
) -> Result<Vec<Vec<u32>>> {
    ensure!(
        background >= 0.0 && background.is_finite(),
        "a background of {background} photons a bin and laser cycle"
    );
    let gate: RangeGate<BINS> = settings.range_gate()?;
    let ladders: Vec<Vec<AnyRule>> = rules
        .iter()
        .map(|rule| {
            let numbers = 0..Rule::THRESHOLDS;
            numbers
                .map(|number| rule.with(Rule::threshold(number), LEAST_COUNT))
                .collect()
        })
        .collect::<Result<_>>()?;
    let bins = BINS as f64;
    let photons = background * bins * f64::from(settings.l2);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within u32"
    )]
    let exposures = (MOST_PHOTONS / photons.max(1.0)).min(EXPOSURES.into()) as u32;
    let exposures = exposures.max(LEAST_EXPOSURES);
    let each_look = background * bins * f64::from(settings.x);
    let each_look = (each_look > 0.0)
        .then(|| Poisson::new(each_look))
        .transpose()?;
    #[allow(clippy::cast_possible_truncation, reason = "at most 1024")]
    let bin = Uniform::new(0, BINS as u16)?;
    // One type for all rules and numbers of bins: what runs it on threads is compiled once.
    let one: &(dyn Fn(u32) -> Vec<usize> + Sync) = &|exposure| {
        let place = dtof_core::PixelAddress((exposure & 0xffff) as u16);
        let mut rng = pixel_rng(seed.wrapping_add(u64::from(exposure >> 16) << 32), place);
        let mut histogram = Histogram::<BINS, Count10>::new();
        let mut fired = vec![0usize; ladders.len()];
        let mut cycles = 0u32;
        loop {
            cycles += u32::from(settings.x.max(1));
            let count = each_look.map_or(0.0, |photons| photons.sample(&mut rng));
            let mut made = 0.0;
            while made < count {
                made += 1.0;
                let code = bin.sample(&mut rng);
                if gate.contains(code) {
                    histogram.add(code);
                }
            }
            if cycles >= u32::from(settings.l2) {
                break fired;
            }
            if cycles <= u32::from(settings.l1) {
                continue;
            }
            for (ladder, fired) in ladders.iter().zip(&mut fired) {
                let fires =
                    |rule| detect(&histogram, &gate, rule, &DepthEstimator::Centroid3).is_some();
                while ladder.get(*fired).is_some_and(fires) {
                    *fired += 1;
                }
            }
        }
    };
    let fired: Vec<Vec<usize>> = (0..exposures).into_par_iter().map(one).collect();
    let mut counts = vec![vec![0; Rule::THRESHOLDS + 1]; rules.len()];
    for exposure in fired {
        for (counts, fired) in counts.iter_mut().zip(exposure) {
            counts[fired] += 1;
        }
    }
    Ok(counts)
}

/// Photons of a peak, at least.
pub const LEAST_COUNT: u16 = 5;
