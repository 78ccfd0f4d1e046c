//! First-passage times for many thresholds at once: the rules of the core, and the likelihood ratio
//! as their reference.

mod ladder;
mod rule;

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use dtof_core::rule::ExcludedBins;
use dtof_core::{AnyRule, Count16, DetectionRule, Histogram, Peak, RangeGate};
use rand_pcg::Pcg64;

use crate::sweep::Tally;
use dtof_light::bounds::likelihood_ratio::{Evidence, LikelihoodRatio};
use dtof_light::looks::exposure::{Exposures, Looks};

pub use self::ladder::Ladder;
pub use self::rule::Rule;

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

/// A detector at all its thresholds, during one exposure.
enum Detector<'a> {
    Rules(Vec<AnyRule>),
    Oracle(Vec<f64>, Evidence<'a>),
}

impl<'a> Detector<'a> {
    fn new(ladder: &Ladder, oracle: Option<&'a LikelihoodRatio>) -> Result<Self> {
        if ladder.rule == Rule::Oracle {
            let scene = oracle.context("no scene for the likelihood ratio")?;
            return Ok(Self::Oracle(ladder.thresholds.clone(), scene.evidence()));
        }
        let thresholds = ladder.thresholds.iter();
        let rules =
            thresholds.map(|&threshold| ladder.rule.with_threshold(threshold, MINIMUM_COUNT));
        Ok(Self::Rules(rules.collect::<Result<_>>()?))
    }
}

/// Simulates exposures and finds when each threshold of each ladder fires first.
pub struct Passage<'a> {
    ladders: &'a [Ladder],
    exposures: Exposures,
    oracle: Option<&'a LikelihoodRatio>,
    rules: Vec<Detector<'a>>,
}

impl<'a> Passage<'a> {
    /// For `ladders`; `oracle` is required if one of them has [`Rule::Oracle`].
    ///
    /// # Errors
    /// Fails if a threshold is out of range or the oracle is missing.
    pub fn new(
        ladders: &'a [Ladder],
        exposures: Exposures,
        oracle: Option<&'a LikelihoodRatio>,
    ) -> Result<Self> {
        let rules = ladders.iter().map(|ladder| Detector::new(ladder, oracle));
        Ok(Self {
            ladders,
            exposures,
            oracle,
            rules: rules.collect::<Result<_>>()?,
        })
    }

    /// Simulates one exposure. For each ladder: the laser cycles at which the thresholds fired,
    /// from the lowest threshold on. Thresholds that had not fired when the exposure expired are
    /// missing.
    pub fn run(&mut self, rng: &mut Pcg64) -> Vec<Vec<u32>> {
        let mut passed = vec![Vec::new(); self.ladders.len()];
        let mut histogram = Histogram::<BINS, Count16>::new();
        for rules in &mut self.rules {
            if let (Detector::Oracle(_, evidence), Some(scene)) = (rules, self.oracle) {
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
                    Detector::Rules(rules) => climb(rules, &histogram, peak, cycles, passed),
                    Detector::Oracle(thresholds, evidence) => {
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

/// Adds the rules that fire for the first time. A rule that fires implies all lower thresholds, so
/// only the next threshold is checked.
fn climb(
    rules: &[AnyRule],
    histogram: &Histogram<BINS, Count16>,
    peak: Peak,
    cycles: u32,
    passed: &mut Vec<u32>,
) {
    while let Some(rule) = rules.get(passed.len())
        && rule
            .detect(histogram, &RangeGate::full(), peak, &ExcludedBins::NONE)
            .is_some()
    {
        passed.push(cycles);
    }
}

/// Simulates exposures without a target and counts those that fired at each threshold, as
/// `"false"`.
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
    use dtof_data::random::trial_rng;
    use dtof_light::rates::Rates;

    fn exposures(signal: f64) -> Exposures {
        let rates = Rates {
            background: 0.05,
            signal,
            position: 64.2,
            sigma: 0.8,
        };
        Exposures::new(&rates, 128, LOOKS).unwrap()
    }

    /// The first event of a pixel, if it has one.
    pub(crate) fn event<W: CounterWidth>(
        config: &PixelConfig<BINS, AnyRule>,
        frames: &[(u32, [u16; BINS])],
    ) -> Option<DepthEvent> {
        let mut pixel = AsyncPixel::<BINS, W>::new(PixelAddress::new(0));
        let mut before = 0;
        frames.iter().find_map(|(cycles, frame)| {
            pixel.count_frame(config, frame);
            let passed = u16::try_from(cycles - before).unwrap();
            before = *cycles;
            let last = LaserCycle::new(before.into());
            let _ = pixel.end_laser_cycles(config, &mut Statistics::new(), last, passed);
            pixel.take_event()
        })
    }

    #[test]
    fn thresholds_fire_when_a_pixel_reports() {
        let ladders = [
            Ladder::new(Rule::Paper, 8, 24, 4),
            Ladder::new(Rule::Window(3), 12, 24, 4),
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
                    let rule = ladder
                        .rule
                        .with_threshold(threshold, MINIMUM_COUNT)
                        .unwrap();
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
