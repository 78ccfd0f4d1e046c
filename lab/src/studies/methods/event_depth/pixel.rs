//! Pixels that count the same photons until each has had its event.

use anyhow::{Context, Result};
use dtof_core::rule::detect;
use dtof_core::{AnyRule, DepthEstimator, Histogram, RangeGate, z_for};
use rand_pcg::Pcg64;

use super::{BACKGROUNDS, FIRST_LOOKS};
use crate::studies::methods::passage::{BINS, LOOKS, MINIMUM_COUNT, Rule};
use dtof_light::looks::exposure::Exposures;
use dtof_light::rates::Rates;

/// For each of [`FIRST_LOOKS`] and [`BACKGROUNDS`]: the smallest α, in steps of 1/16, with at most
/// 1 % false alarms an exposure. No α has exactly 1 %, because integer counts make the share fall
/// in steps.
const ALPHAS: [[f64; 3]; 2] = [[5.0, 4.0, 3.5], [3.6875, 3.1875, 3.0]];

/// A rule with its threshold and its first look.
#[derive(Clone, Copy, Debug)]
pub struct Pixel {
    /// The rule.
    pub rule: Rule,
    /// The first look, in laser cycles.
    pub first_look: u32,
    /// The core's rule with that threshold.
    pub core_rule: AnyRule,
    /// α or z.
    pub threshold: f64,
}

impl Pixel {
    /// With 1 % false alarms an exposure at this background.
    ///
    /// # Errors
    /// Fails if the background or the first look is not one of the study's.
    pub fn new(rule: Rule, first_look: u32, background: f64) -> Result<Self> {
        let threshold = match rule {
            Rule::Window(_) => {
                // As in the commands; L1 is one less than the first look.
                let [x, l1, l2] = [LOOKS.x, first_look - 1, LOOKS.expiry()].map(u16::try_from);
                z_for(100, &RangeGate::<BINS>::full(), x?, l1?, l2?).to_num()
            }
            _ => {
                let looks = FIRST_LOOKS.into_iter().zip(ALPHAS);
                let alphas = looks.filter(|(first, _)| *first == first_look);
                let mut all = alphas.flat_map(|(_, alphas)| BACKGROUNDS.into_iter().zip(alphas));
                let alpha = all.find(|(of, _)| of.total_cmp(&background).is_eq());
                let no_alpha = || format!("no α for {background} from {first_look}");
                alpha.with_context(no_alpha)?.1
            }
        };
        Ok(Self {
            rule,
            first_look,
            core_rule: rule.with_threshold(threshold, MINIMUM_COUNT)?,
            threshold,
        })
    }

    /// Its name in tallies.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{} {}", self.rule.name(), self.first_look)
    }
}

/// The event of an exposure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// Laser cycles of its exposure.
    pub cycles: u32,
    /// Photons of the pulse in all bins.
    pub signal: u64,
    /// The highest bin.
    pub peak: u16,
    /// The position by each of [`ESTIMATORS`](super::ESTIMATORS), in 1/256 bin from the start of
    /// bin 0.
    pub positions: [i32; 2],
}

/// Simulates one exposure of the same photons for all `pixels`. Returns the event of each pixel, if
/// it has one; `estimators` find the depth on its histogram.
///
/// # Errors
/// Fails if a rate is negative or not a number.
pub fn exposure(
    rates: &Rates,
    pixels: &[Pixel],
    estimators: &[DepthEstimator; 2],
    rng: &mut Pcg64,
) -> Result<Vec<Option<Event>>> {
    let bins = u16::try_from(BINS)?;
    // Separate from the background, so that they can be counted.
    let mut pulse = Vec::new();
    if rates.signal > 0.0 {
        let rates = Rates {
            background: 0.0,
            ..*rates
        };
        Exposures::new(&rates, bins, LOOKS)?.frames::<BINS>(rng, |_, frame| {
            pulse.push(*frame);
            false
        });
    }
    let background = Rates {
        signal: 0.0,
        ..*rates
    };
    let background = Exposures::new(&background, bins, LOOKS)?;
    let gate = RangeGate::full();
    let mut histogram = Histogram::<BINS>::new();
    let mut events = vec![None; pixels.len()];
    let mut signal = 0;
    let mut pulse = pulse.iter();
    background.frames::<BINS>(rng, |cycles, frame| {
        histogram.add_frame(frame, &gate);
        if let Some(frame) = pulse.next() {
            histogram.add_frame(frame, &gate);
            signal += frame.iter().map(|&photons| u64::from(photons)).sum::<u64>();
        }
        let waiting = pixels.iter().zip(&mut events);
        for (pixel, event) in waiting.filter(|(_, event)| event.is_none()) {
            if cycles < pixel.first_look {
                continue;
            }
            let detect = |estimator| detect(&histogram, &gate, &pixel.core_rule, estimator);
            let [Some(mass), Some(centred)] = estimators.each_ref().map(detect) else {
                continue;
            };
            *event = Some(Event {
                cycles,
                signal,
                peak: mass.peak.bin.raw(),
                positions: [mass, centred].map(|found| found.position().raw()),
            });
        }
        events.iter().all(Option::is_some)
    });
    Ok(events)
}

#[cfg(test)]
mod tests {
    use dtof_core::{Count10, PixelConfig};

    use super::super::estimators;
    use super::*;
    use crate::studies::methods::passage::tests::event as of_core;
    use dtof_data::random::trial_rng;

    const RATES: Rates = Rates {
        background: 0.05,
        signal: 0.3,
        position: 64.2,
        sigma: 1.0,
    };

    /// The photons of [`exposure`], from look to look.
    fn frames(seed: u64) -> Vec<(u32, [u16; BINS])> {
        let rng = &mut trial_rng(seed, 0);
        let mut all = Vec::<(u32, [u16; BINS])>::new();
        for (background, signal) in [(0.0, RATES.signal), (RATES.background, 0.0)] {
            let rates = Rates {
                background,
                signal,
                ..RATES
            };
            let mut index = 0;
            let exposures = Exposures::new(&rates, 128, LOOKS).unwrap();
            exposures.frames::<BINS>(rng, |cycles, frame| {
                match all.get_mut(index) {
                    Some((_, sum)) => (0..BINS).for_each(|bin| sum[bin] += frame[bin]),
                    None => all.push((cycles, *frame)),
                }
                index += 1;
                false
            });
        }
        all
    }

    /// Both rules and first looks, with both estimators.
    #[test]
    fn events_are_those_of_a_pixel() {
        let mut pixels = Vec::new();
        for first in FIRST_LOOKS {
            for rule in [Rule::Paper, Rule::Window(3)] {
                pixels.push(Pixel::new(rule, first, RATES.background).unwrap());
            }
        }
        let both = estimators(RATES.sigma);
        let mut differ = 0;
        for seed in 0..10 {
            let events = exposure(&RATES, &pixels, &both, &mut trial_rng(seed, 0)).unwrap();
            let frames = frames(seed);
            for (pixel, event) in pixels.iter().zip(events) {
                for (index, estimator) in both.into_iter().enumerate() {
                    let l1 = u16::try_from(pixel.first_look - 1).unwrap();
                    let config = PixelConfig::with_rule(pixel.core_rule).l1(l1).l2(1000);
                    let config = config.estimator(estimator).build().unwrap();
                    let here = event.map(|event| (event.cycles, event.positions[index]));
                    let there = of_core::<Count10>(&config, &frames)
                        .map(|found| (found.exposure.into(), found.position().raw()));
                    assert_eq!(here, there);
                }
                differ += event.map_or(0, |event| {
                    u32::from(event.positions[0] != event.positions[1])
                });
            }
        }
        assert!(differ > 20, "{differ}");
    }
}
