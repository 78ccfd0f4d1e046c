//! When a rule fires for the first time, for many thresholds at once: the rules of
//! the core, and the likelihood ratio they are measured against.

use std::collections::BTreeMap;

use anyhow::{Context, Result, bail};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{
    AnyRule, AverageRule, Count, Count16, DetectionRule, Histogram, PaperRule, Peak, RangeGate,
    WindowRule,
};
use rand_pcg::Pcg64;

use crate::sweep::{PointTally, Tally};
use dtof_draw::palette::{self, Pen};
use dtof_theory::bounds::likelihood_ratio::{Evidence, LikelihoodRatio};
use dtof_theory::looks::exposure::{Exposures, Looks};

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

/// What decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Method {
    /// The paper's rule; its threshold is α.
    Paper,
    /// The same over the average of all bins.
    Average,
    /// The core's window rule with as many bins; its threshold is z.
    Window(u8),
    /// The largest likelihood ratio of a scene that is known; its threshold is in
    /// nats.
    Oracle,
}

impl Method {
    /// Those that a pixel can run.
    pub const RULES: [Self; 7] = [
        Self::Paper,
        Self::Average,
        Self::Window(1),
        Self::Window(2),
        Self::Window(3),
        Self::Window(5),
        Self::Window(7),
    ];

    /// The core's rule with this threshold and minimum count.
    ///
    /// # Errors
    /// If there is none.
    pub fn rule(self, threshold: f64, minimum: u32) -> Result<AnyRule> {
        let minimum = Count::saturating(minimum);
        Ok(match self {
            Self::Paper => PaperRule::new(U8F8::saturating_from_num(threshold), minimum).into(),
            Self::Average => AverageRule::new(U8F8::saturating_from_num(threshold), minimum).into(),
            Self::Window(width) => {
                WindowRule::new(width, U4F12::saturating_from_num(threshold), minimum)?.into()
            }
            Self::Oracle => bail!("no pixel knows the scene"),
        })
    }

    /// Its name in tallies and tables.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Paper => "paper".to_owned(),
            Self::Average => "average".to_owned(),
            Self::Window(width) => format!("w{width}"),
            Self::Oracle => "oracle".to_owned(),
        }
    }

    /// What it looks like in a chart.
    #[must_use]
    pub const fn pen(self) -> Pen {
        match self {
            Self::Paper => palette::PAPER,
            Self::Average => palette::AVERAGE,
            Self::Window(width) => palette::window(width),
            Self::Oracle => palette::REFERENCE,
        }
    }

    /// Its name where there is little room: a window's is its width.
    #[must_use]
    pub fn short(self) -> String {
        match self {
            Self::Paper => "paper's".to_owned(),
            Self::Average => "average".to_owned(),
            Self::Window(1) => "1 bin".to_owned(),
            Self::Window(width) => format!("{width} bins"),
            Self::Oracle => self.label(),
        }
    }

    /// Its name in a text.
    #[must_use]
    pub fn label(self) -> String {
        match self {
            Self::Paper => "the paper's rule".to_owned(),
            Self::Average => "average of all bins".to_owned(),
            Self::Window(_) => format!("window of {}", self.short()),
            Self::Oracle => "likelihood ratio".to_owned(),
        }
    }
}

/// A method with ascending thresholds.
#[derive(Clone, Debug)]
pub struct Ladder {
    /// What decides.
    pub method: Method,
    /// Equally spaced, by powers of two: exact in every format.
    pub thresholds: Vec<f64>,
}

impl Ladder {
    /// Thresholds from `first` to `last`, counted in steps of which `steps` make 1.
    #[must_use]
    pub fn new(method: Method, first: u32, last: u32, steps: u32) -> Self {
        let thresholds = first..=last;
        Self {
            method,
            thresholds: thresholds
                .map(|step| f64::from(step) / f64::from(steps))
                .collect(),
        }
    }

    /// What a tally calls `what` at threshold number `index`.
    #[must_use]
    pub fn key(&self, index: usize, what: &str) -> String {
        format!("{} {} {what}", self.method.name(), self.thresholds[index])
    }

    /// The threshold at which `share` of the exposures fire, from the counts
    /// `"false"` of `points`, in `exposures`: between two thresholds the share falls
    /// by equal factors. The first or the last if it lies beyond.
    #[must_use]
    pub fn calibrated(&self, points: &[&PointTally], share: f64) -> f64 {
        let exposures: u64 = points.iter().map(|point| point.count("exposures")).sum();
        let wanted = (share * exposures as f64).ln();
        let found = |index: usize| {
            let key = self.key(index, "false");
            let count: u64 = points.iter().map(|point| point.count(&key)).sum();
            // None is less than one.
            (count as f64).max(0.5).ln()
        };
        for index in 1..self.thresholds.len() {
            let (before, after) = (found(index - 1), found(index));
            if after <= wanted {
                let between = if before > wanted {
                    (before - wanted) / (before - after)
                } else {
                    0.0
                };
                let [low, high] = [index - 1, index].map(|index| self.thresholds[index]);
                return low + between * (high - low);
            }
        }
        self.thresholds.last().copied().unwrap_or_default()
    }

    /// The number of the threshold nearest to `threshold`.
    #[must_use]
    pub fn nearest(&self, threshold: f64) -> usize {
        let above = self.thresholds.partition_point(|&at| at < threshold);
        let distance = |index: usize| {
            let at = self.thresholds.get(index);
            at.map_or(f64::INFINITY, |at| (at - threshold).abs())
        };
        let below = above.saturating_sub(1);
        if distance(below) < distance(above) {
            below
        } else {
            above
        }
    }

    /// `value` of the thresholds' numbers, linear between the two beside
    /// `threshold`.
    pub fn interpolated(&self, threshold: f64, value: impl Fn(usize) -> f64) -> f64 {
        let above = self.thresholds.partition_point(|&at| at < threshold);
        let above = above.clamp(1, self.thresholds.len() - 1);
        let [low, high] = [above - 1, above].map(|index| self.thresholds[index]);
        let part = ((threshold - low) / (high - low)).clamp(0.0, 1.0);
        value(above - 1) * (1.0 - part) + value(above) * part
    }
}

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

    #[test]
    fn the_threshold_of_a_share_lies_between_its_neighbours() {
        let ladder = Ladder::new(Method::Window(2), 12, 14, 4);
        let mut tally = Tally::from([("exposures".to_owned(), 1000)]);
        for (index, count) in [1000, 100, 1].into_iter().enumerate() {
            tally.insert(ladder.key(index, "false"), count);
        }
        assert_eq!(ladder.key(1, "false"), "w2 3.25 false");
        let point = tally.into();
        let at = |share: f64| ladder.calibrated(&[&point], share);
        assert!((at(0.1) - 3.25).abs() < 1e-12);
        // Equal factors: 10 is halfway from 100 to 1.
        assert!((at(0.01) - 3.375).abs() < 1e-12);
        assert_eq!(at(1e-6), 3.5);
        let nearest = [0.0, 3.1, 3.2, 3.4, 9.0].map(|threshold| ladder.nearest(threshold));
        assert_eq!(nearest, [0, 0, 1, 2, 2]);
        let linear = ladder.interpolated(3.375, |index| [0.0, 4.0, 8.0][index]);
        assert!((linear - 6.0).abs() < 1e-12);
        assert_eq!(
            ladder.interpolated(9.0, |index| [0.0, 4.0, 8.0][index]),
            8.0
        );
    }
}
