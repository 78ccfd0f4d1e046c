//! A bound for single pixels: the time to an event of the likelihood-ratio test, which knows background,
//! signal and pulse, and after that the Cramér-Rao bound of the error.

use anyhow::Result;
use dtof_core::PixelAddress;
use rand_distr::{Distribution, Normal, Poisson, Uniform};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::stress::{Light, count};
use super::tally::{first_and_last, mm_per_bin};
use dtof_data::random::pixel_rng;
use dtof_engine::settings::Settings;
use dtof_light::bounds::cramer_rao::Pulse;
use dtof_light::bounds::likelihood_ratio::{Evidence, LikelihoodRatio};

/// Exposures without a target, at most; fewer if they have more looks than [`MAX_LOOKS`].
const WITHOUT: u16 = 10_000;
/// Exposures with a target.
const WITH: u16 = 1_000;
const MAX_LOOKS: u32 = 5_000_000;

/// The bound of one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Bound {
    light: Light,
    mm_per_bin: f64,
    /// Laser cycles from one event to the next.
    pub cycles: f64,
}

impl Bound {
    /// The bound of a pixel with this light, and with gate, L1, L2 and X of `settings`, that has `share`
    /// false alarms in an exposure. `None` without background or signal, or if there are no events.
    ///
    /// # Errors
    /// Fails if the gate or the light is invalid.
    pub fn new(light: &Light, settings: &Settings, share: f64, seed: u64) -> Result<Option<Self>> {
        if light.background <= 0.0 || light.signal <= 0.0 {
            return Ok(None);
        }
        let (first, last) = first_and_last(settings)?;
        let bins = u32::try_from(last - first + 1)?;
        let ratio = LikelihoodRatio::new(bins, light.background, light.signal, light.sigma);
        let exposure = |number: u16, signal: f64, threshold: f64| {
            let rng = pixel_rng(
                seed.wrapping_add(signal.to_bits()),
                PixelAddress::new(number),
            );
            Exposure::new(light, bins, signal, settings)?.run(ratio.evidence(), threshold, rng)
        };
        let looks =
            u32::from(settings.configuration.l2) / u32::from(settings.configuration.x.max(1));
        let most = u16::try_from(MAX_LOOKS / looks.max(1)).unwrap_or(WITHOUT);
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

    /// The lowest standard deviation of a range from so many laser cycles, in millimetres.
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

/// Exposures of a pixel.
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
        let x = f64::from(settings.configuration.x.max(1));
        // Other positions in the bin change the mean by less than 1 %.
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
            x: settings.configuration.x.max(1).into(),
            l1: settings.configuration.l1.into(),
            l2: settings.configuration.l2.into(),
        })
    }

    /// Simulates one: the laser cycles it lasted, whether it ended with an event, and the highest
    /// likelihood ratio.
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
