//! What no single pixel can do better: the likelihood ratio of someone who knows background,
//! signal and pulse, and from then on the Cramér-Rao bound.

use anyhow::Result;
use dtof_core::PixelAddress;
use rand_distr::{Distribution, Normal, Poisson, Uniform};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::stress::{Light, count};
use super::tally::mm_per_bin;
use dtof_engine::settings::Settings;
use dtof_theory::bounds::cramer_rao::Pulse;
use dtof_theory::bounds::likelihood_ratio::{Evidence, LikelihoodRatio};
use dtof_theory::random::pixel_rng;

/// Exposures without a target, unless they have more looks than [`MOST_LOOKS`], and with one.
const WITHOUT: u16 = 10_000;
const WITH: u16 = 1_000;
const MOST_LOOKS: u32 = 5_000_000;

/// The bound of one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Bound {
    light: Light,
    mm_per_bin: f64,
    /// Laser cycles from one event to the next.
    pub cycles: f64,
}

impl Bound {
    /// Of a pixel with this light that looks as `settings` say and has `share` false alarms in
    /// an exposure. None without background or signal.
    ///
    /// # Errors
    /// If the light is none.
    pub fn new(light: &Light, settings: &Settings, share: f64, seed: u64) -> Result<Option<Self>> {
        if light.background <= 0.0 || light.signal <= 0.0 {
            return Ok(None);
        }
        let (first, last) = settings
            .gate
            .map_or((0, settings.bins - 1), |(first, last)| {
                (first.into(), last.into())
            });
        let bins = u32::try_from(last - first + 1)?;
        let ratio = LikelihoodRatio::new(bins, light.background, light.signal, light.sigma);
        let exposure = |number: u16, signal: f64, threshold: f64| {
            let rng = pixel_rng(seed.wrapping_add(signal.to_bits()), PixelAddress(number));
            Exposure::new(light, bins, signal, settings)?.run(ratio.evidence(), threshold, rng)
        };
        let looks = u32::from(settings.l2) / u32::from(settings.x.max(1));
        let most = u16::try_from(MOST_LOOKS / looks.max(1)).unwrap_or(WITHOUT);
        let exposures = most.clamp(WITH, WITHOUT);
        let without = (0..exposures).into_par_iter();
        let without = without.map(|number| Ok(exposure(number, 0.0, f64::INFINITY)?.1));
        let mut highest: Vec<f64> = without.collect::<Result<_>>()?;
        highest.sort_unstable_by(|one, other| other.total_cmp(one));
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a place"
        )]
        let place = (share * f64::from(exposures)) as usize;
        let threshold = highest.get(place).copied().unwrap_or(f64::INFINITY);
        let with = (0..WITH).into_par_iter();
        let with = with.map(|number| Ok(exposure(number, light.signal, threshold)?.0));
        let with: Vec<(u32, bool)> = with.collect::<Result<_>>()?;
        let events = with.iter().filter(|(_, fired)| *fired).count();
        let cycles: u32 = with.iter().map(|(cycles, _)| cycles).sum();
        Ok((events > 0).then(|| Self {
            light: *light,
            mm_per_bin: mm_per_bin(settings),
            cycles: f64::from(cycles) / events as f64,
        }))
    }

    /// Millimetres that the best estimate from so many laser cycles is off: one standard
    /// deviation.
    #[must_use]
    pub fn error_mm(&self, cycles: f64) -> f64 {
        let pulse = Pulse {
            signal: self.light.signal * cycles,
            background: self.light.background * cycles,
            sigma: self.light.sigma,
        };
        pulse.position_error() * self.mm_per_bin
    }
}

/// One exposure.
struct Exposure {
    even: Poisson<f64>,
    bin: Uniform<u16>,
    pulse: Option<(Poisson<f64>, Normal<f64>)>,
    bins: u32,
    x: u32,
    l1: u32,
    l2: u32,
}

impl Exposure {
    fn new(light: &Light, bins: u32, signal: f64, settings: &Settings) -> Result<Self> {
        let x = f64::from(settings.x.max(1));
        // Anywhere in its bin would not change the mean by a hundredth.
        let place = f64::from(bins / 2) + 0.25;
        let pulse = if signal > 0.0 {
            Some((Poisson::new(signal * x)?, Normal::new(place, light.sigma)?))
        } else {
            None
        };
        Ok(Self {
            even: Poisson::new(light.background * f64::from(bins) * x)?,
            bin: Uniform::new(0, u16::try_from(bins)?)?,
            pulse,
            bins,
            x: settings.x.max(1).into(),
            l1: settings.l1.into(),
            l2: settings.l2.into(),
        })
    }

    /// How long it lasted and whether it ended with an event, and the highest ratio.
    fn run(
        &self,
        mut evidence: Evidence,
        threshold: f64,
        mut rng: Pcg64,
    ) -> Result<((u32, bool), f64)> {
        let mut highest = f64::NEG_INFINITY;
        let mut cycles = 0;
        loop {
            cycles += self.x;
            for _ in 0..count(&self.even, &mut rng) {
                evidence.add(self.bin.sample(&mut rng), 1);
            }
            if let Some((photons, place)) = &self.pulse {
                for _ in 0..count(photons, &mut rng) {
                    let place = place.sample(&mut rng);
                    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                    if (0.0..f64::from(self.bins)).contains(&place) {
                        evidence.add(place as u16, 1);
                    }
                }
            }
            if cycles >= self.l2 {
                return Ok(((self.l2, false), highest));
            }
            if cycles > self.l1 {
                highest = highest.max(evidence.highest(cycles));
                if highest > threshold {
                    return Ok(((cycles, true), highest));
                }
            }
        }
    }
}
