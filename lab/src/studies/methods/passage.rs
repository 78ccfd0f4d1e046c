//! When a rule fires for the first time, for many thresholds at once: the rules of
//! the core, and the likelihood ratio they are measured against.

mod ladder;
mod method;

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use dtof_core::{AnyRule, Count16, DetectionRule, Histogram, Peak, RangeGate};
use rand_pcg::Pcg64;

use crate::sweep::Tally;
use dtof_theory::bounds::likelihood_ratio::{Evidence, LikelihoodRatio};
use dtof_theory::looks::exposure::{Exposures, Looks};

pub use self::ladder::Ladder;
pub use self::method::Method;

/// Bins of the histograms.
pub const BINS: usize = 128;
/// A look every 4 laser cycles from 40, in exposures of 1000.
pub const LOOKS: Looks = Looks {
    x: 4,
    first: 10,
    last: 249,
};
/// The fewest photons of an event, in the peak or in the window.
pub const MINIMUM_COUNT: u32 = 5;

/// The decisions of one exposure.
enum Decisions<'a> {
    Rules(Vec<AnyRule>),
    Oracle(Vec<f64>, Evidence<'a>),
}

impl<'a> Decisions<'a> {
    fn new(ladder: &Ladder, oracle: Option<&'a LikelihoodRatio>) -> Result<Self> {
        if ladder.method == Method::Oracle {
            let scene = oracle.context("no scene for the likelihood ratio")?;
            return Ok(Self::Oracle(ladder.thresholds.clone(), scene.evidence()));
        }
        let thresholds = ladder.thresholds.iter();
        let rules = thresholds.map(|&threshold| ladder.method.rule(threshold, MINIMUM_COUNT));
        Ok(Self::Rules(rules.collect::<Result<_>>()?))
    }
}

/// How many laser cycles each threshold of each ladder took to fire, in simulated
/// exposures.
pub struct Passage<'a> {
    ladders: &'a [Ladder],
    exposures: Exposures,
    oracle: Option<&'a LikelihoodRatio>,
    rules: Vec<Decisions<'a>>,
}

impl<'a> Passage<'a> {
    /// Of these ladders; `oracle` is needed if one is [`Method::Oracle`].
    ///
    /// # Errors
    /// If a rule or the oracle is not possible.
    pub fn new(
        ladders: &'a [Ladder],
        exposures: Exposures,
        oracle: Option<&'a LikelihoodRatio>,
    ) -> Result<Self> {
        let rules = ladders.iter().map(|ladder| Decisions::new(ladder, oracle));
        Ok(Self {
            ladders,
            exposures,
            oracle,
            rules: rules.collect::<Result<_>>()?,
        })
    }

    /// One exposure: for each ladder the laser cycles of the thresholds that fired,
    /// from the lowest; fewer than there are thresholds if it expired first.
    pub fn run(&mut self, rng: &mut Pcg64) -> Vec<Vec<u32>> {
        let mut passed = vec![Vec::new(); self.ladders.len()];
        let mut histogram = Histogram::<BINS, Count16>::new();
        for rules in &mut self.rules {
            if let (Decisions::Oracle(_, evidence), Some(scene)) = (rules, self.oracle) {
                *evidence = scene.evidence();
            }
        }
        let gate = RangeGate::full();
        let rules = &mut self.rules;
        let ladders = self.ladders;
        self.exposures.frames::<BINS>(rng, |cycles, frame| {
            histogram.add_frame(frame, &gate);
            let peak = histogram.peak();
            let mut all = true;
            for ((rules, passed), ladder) in rules.iter_mut().zip(&mut passed).zip(ladders) {
                match rules {
                    Decisions::Rules(rules) => climb(rules, &histogram, peak, cycles, passed),
                    Decisions::Oracle(thresholds, evidence) => {
                        for (bin, &photons) in (0..).zip(frame) {
                            if photons > 0 {
                                evidence.add(bin, photons);
                            }
                        }
                        let highest = evidence.highest(cycles);
                        let fired = thresholds.partition_point(|&threshold| threshold < highest);
                        passed.resize(passed.len().max(fired), cycles);
                    }
                }
                all &= passed.len() == ladder.thresholds.len();
            }
            all
        });
        passed
    }
}

/// Notes the rules that fire for the first time. One that fires lets no lower
/// threshold wait, so that only the next has to be asked.
fn climb(
    rules: &[AnyRule],
    histogram: &Histogram<BINS, Count16>,
    peak: Peak,
    cycles: u32,
    passed: &mut Vec<u32>,
) {
    while let Some(rule) = rules.get(passed.len())
        && rule.detect(histogram, &RangeGate::full(), peak).is_some()
    {
        passed.push(cycles);
    }
}

/// Target-free exposures: how many fired at each threshold, as `"false"`.
///
/// # Errors
/// If a rate is not possible.
pub fn count_false(passage: &mut Passage, exposures: u64, rng: &mut Pcg64) -> Tally {
    let mut fired: Vec<Vec<u64>> = passage
        .ladders
        .iter()
        .map(|ladder| vec![0; ladder.thresholds.len()])
        .collect();
    for _ in 0..exposures {
        for (fired, passed) in fired.iter_mut().zip(passage.run(rng)) {
            for fired in &mut fired[..passed.len()] {
                *fired += 1;
            }
        }
    }
    let mut tally = BTreeMap::from([("exposures".to_owned(), exposures)]);
    for (ladder, fired) in passage.ladders.iter().zip(fired) {
        for (index, fired) in fired.into_iter().enumerate() {
            tally.insert(ladder.key(index, "false"), fired);
        }
    }
    tally
}

#[cfg(test)]
pub(crate) mod tests {
    use dtof_core::{
        AsyncPixel, CounterWidth, DepthEvent, LaserCycle, PixelAddress, PixelConfig, Statistics,
    };

    use super::*;
    use dtof_theory::random::trial_rng;
    use dtof_theory::rates::Rates;

    fn exposures(signal: f64) -> Exposures {
        let rates = Rates {
            background: 0.05,
            signal,
            position: 64.2,
            sigma: 0.8,
        };
        Exposures::new(&rates, 128, LOOKS).unwrap()
    }

    /// What a pixel reports first, if it does.
    pub(crate) fn event<W: CounterWidth>(
        config: &PixelConfig<BINS, AnyRule>,
        frames: &[(u32, [u16; BINS])],
    ) -> Option<DepthEvent> {
        let mut pixel = AsyncPixel::<BINS, W>::new(PixelAddress(0));
        let mut before = 0;
        frames.iter().find_map(|(cycles, frame)| {
            pixel.count_frame(config, frame);
            let passed = u16::try_from(cycles - before).unwrap();
            before = *cycles;
            let last = LaserCycle(before.into());
            let _ = pixel.end_laser_cycles(config, &mut Statistics::new(), last, passed);
            pixel.acknowledge()
        })
    }

    #[test]
    fn thresholds_fire_when_a_pixel_reports() {
        let ladders = [
            Ladder::new(Method::Paper, 8, 24, 4),
            Ladder::new(Method::Window(3), 12, 24, 4),
        ];
        let mut fired = 0;
        for seed in 0..20 {
            let signal = if seed < 10 { 0.4 } else { 0.0 };
            let mut passage = Passage::new(&ladders, exposures(signal), None).unwrap();
            let passed = passage.run(&mut trial_rng(seed, 0));
            // The same photons.
            let mut frames = Vec::new();
            exposures(signal).frames::<BINS>(&mut trial_rng(seed, 0), |cycles, frame| {
                frames.push((cycles, *frame));
                false
            });
            assert_eq!(frames.len(), 240);
            for (ladder, passed) in ladders.iter().zip(&passed) {
                for (index, &threshold) in ladder.thresholds.iter().enumerate() {
                    let rule = ladder.method.rule(threshold, MINIMUM_COUNT).unwrap();
                    let config = PixelConfig::with_rule(rule).x(4).l1(39).l2(1000);
                    let event = event::<Count16>(&config.build().unwrap(), &frames);
                    let cycles = event.map(|event| event.exposure.into());
                    assert_eq!(passed.get(index).copied(), cycles);
                }
            }
            fired += passed[1].len();
        }
        assert!(fired > 100, "{fired}");
    }
}
