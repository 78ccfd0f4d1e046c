//! Thresholds that give all rules the same rate of false alarms: exposures without a target are simulated,
//! and all rules decide on the same ones.

use anyhow::{Result, ensure};
use dtof_core::rule::detect;
use dtof_core::{AnyRule, Count10, DepthEstimator, Histogram, RangeGate};
use rand_distr::{Distribution, Poisson, Uniform};
use rayon::prelude::*;

use super::method::Rule;
use dtof_data::options::Refused;
use dtof_data::random::pixel_rng;
use dtof_engine::settings::Settings;
use dtof_engine::with_bins;

/// The most exposures; fewer if they have more than [`MAX_PHOTONS`] photons.
const MAX_EXPOSURES: u32 = 20_000;
/// The fewest exposures.
const MIN_EXPOSURES: u32 = 1_000;
const MAX_PHOTONS: f64 = 4e8;
/// Progress is reported after so many exposures.
const PART: u32 = 500;
/// The fewest exposures with a false alarm at a threshold.
const MIN_EVENTS: f64 = 5.0;

/// The number of exposures that end with an event at each threshold.
pub struct Thresholds {
    rules: Vec<Rule>,
    /// For each rule a histogram of exposures by the number of thresholds that they exceed.
    exceeded: Vec<Vec<u32>>,
    exposures: u32,
}

impl Thresholds {
    /// Simulates `rules` with `background` photons a bin and laser cycle, and gate, L1, L2 and X of
    /// `settings`. `progress` takes the share that is done.
    ///
    /// # Errors
    /// Fails if `progress` fails, or if number of bins, gate, background or a window is invalid.
    pub fn simulate(
        rules: &[Rule],
        settings: &Settings,
        background: f64,
        seed: u64,
        progress: &dyn Fn(f64) -> Result<()>,
    ) -> Result<Self> {
        let exceeded = with_bins!(settings.bins, BINS => {
            exceeded::<BINS>(rules, settings, background, seed, progress)
        })??;
        Ok(Self {
            rules: rules.to_vec(),
            exposures: exceeded.first().map_or(0, |counts| counts.iter().sum()),
            exceeded,
        })
    }

    /// The lowest threshold at which at most `share` of the exposures end with an event.
    ///
    /// # Errors
    /// Fails if `share` is too small for the number of exposures, or if even the highest threshold has
    /// more events.
    pub fn of(&self, rule: Rule, share: f64) -> Result<f64> {
        let mut rules = self.rules.iter().zip(&self.exceeded);
        let counts = rules.find(|(simulated, _)| **simulated == rule);
        let counts = counts.map_or(&[][..], |(_, counts)| counts);
        let allowed = share * f64::from(self.exposures);
        ensure!(
            allowed >= MIN_EVENTS,
            Refused::value(
                "false_alarm",
                share,
                format!(
                    "{} exposures can only show shares of {} or more",
                    self.exposures,
                    MIN_EVENTS / f64::from(self.exposures)
                )
            )
        );
        let mut firing = self.exposures;
        for (number, &here) in counts.iter().enumerate() {
            firing -= here;
            if f64::from(firing) <= allowed {
                return Ok(Rule::threshold(number));
            }
        }
        anyhow::bail!("{rule:?}: no threshold has as few false alarms as {share}")
    }
}

/// For each rule a histogram of exposures by the number of thresholds that they exceed.
fn exceeded<const BINS: usize>(
    rules: &[Rule],
    settings: &Settings,
    background: f64,
    seed: u64,
    progress: &dyn Fn(f64) -> Result<()>,
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
                .map(|number| rule.with(Rule::threshold(number), MIN_COUNT))
                .collect()
        })
        .collect::<Result<_>>()?;
    let bins = BINS as f64;
    let photons = background * bins * f64::from(settings.configuration.l2);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within u32"
    )]
    let exposures = (MAX_PHOTONS / photons.max(1.0)).min(MAX_EXPOSURES.into()) as u32;
    let exposures = exposures.max(MIN_EXPOSURES);
    let each_look = background * bins * f64::from(settings.configuration.x);
    let each_look = (each_look > 0.0)
        .then(|| Poisson::new(each_look))
        .transpose()?;
    #[allow(clippy::cast_possible_truncation, reason = "at most 1024")]
    let bin = Uniform::new(0, BINS as u16)?;
    // One type for all rules and numbers of bins: the parallel code is compiled once.
    let one: &(dyn Fn(u32) -> Vec<usize> + Sync) = &|exposure| {
        let place = dtof_core::PixelAddress::new((exposure & 0xffff) as u16);
        let mut rng = pixel_rng(seed.wrapping_add(u64::from(exposure >> 16) << 32), place);
        let mut histogram = Histogram::<BINS, Count10>::new();
        let mut fired = vec![0usize; ladders.len()];
        let mut cycles = 0u32;
        loop {
            cycles += u32::from(settings.configuration.x.max(1));
            let count = each_look.map_or(0.0, |photons| photons.sample(&mut rng));
            let mut made = 0.0;
            while made < count {
                made += 1.0;
                let code = bin.sample(&mut rng);
                if gate.contains(code) {
                    histogram.add(code);
                }
            }
            if cycles >= u32::from(settings.configuration.l2) {
                break fired;
            }
            if cycles <= u32::from(settings.configuration.l1) {
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
    let mut counts = vec![vec![0; Rule::THRESHOLDS + 1]; rules.len()];
    for first in (0..exposures).step_by(PART as usize) {
        let part = first..exposures.min(first + PART);
        progress(f64::from(first) / f64::from(exposures))?;
        let fired: Vec<Vec<usize>> = part.into_par_iter().map(one).collect();
        for exposure in fired {
            for (counts, fired) in counts.iter_mut().zip(exposure) {
                counts[fired] += 1;
            }
        }
    }
    Ok(counts)
}

/// The lowest minimum count of a peak.
pub const MIN_COUNT: u16 = 5;
