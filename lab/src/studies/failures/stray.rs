//! Stray light that is neither the target nor uniform background: rain, smoke, another LiDAR.

use super::{BINS, PERIOD, SIGMA};
use anyhow::Result;
use dtof_sensors::dither::{Added, Dither};
use rand_core::Rng;
use rand_distr::{Distribution, Exp, Normal, Poisson, Uniform};
use rand_pcg::Pcg64;

/// The source of stray light.
#[derive(Clone, Copy, Debug)]
pub enum StrayLight {
    /// Raindrops close by: rarely in the beam, but bright. A drop crosses the beam in a
    /// millisecond, so a laser of some kHz hits it once.
    Drops {
        /// Mean laser cycles between two drops.
        each: f64,
        /// Photons of a drop.
        photons: f64,
        /// Drops lie evenly before this position, in bins.
        before: f64,
    },
    /// Smoke or fog, whose signal decays with depth.
    Smoke {
        /// Photons of a laser cycle.
        photons: f64,
        /// Its first bin, and the bins of a decay to 1/e.
        from: f64,
        decay: f64,
    },
    /// The pulses of another LiDAR, with a random phase and an unsynchronised clock.
    Laser {
        /// Photons of a pulse.
        photons: f64,
        /// Bins by which its pulse comes later in each laser cycle.
        step: f64,
        /// The range of the own laser's dither in bins, 0 for none.
        dither: u16,
    },
}

/// Bins by which a photon is surely nearer to the place of its pulse.
const REACH: f64 = 8.0 * SIGMA;

/// The stray photons of an exposure.
pub struct StrayPhotons {
    stray: StrayLight,
    rng: Pcg64,
    /// The position of the other laser's next pulse, in bins. It may lie before the own pulse: its late photons
    /// come after it.
    place: f64,
    /// By how many bins the own laser cycles are longer than the shortest.
    added: Added,
}

impl StrayPhotons {
    /// At the start of an exposure.
    pub fn new(stray: StrayLight, mut rng: Pcg64) -> Result<Self> {
        let place = Uniform::new(-REACH, PERIOD - REACH)?.sample(&mut rng);
        let range = match stray {
            StrayLight::Laser { dither, .. } => dither,
            _ => 0,
        };
        let added = Dither::new(range, rng.next_u64())?.added();
        Ok(Self {
            stray,
            rng,
            place,
            added,
        })
    }

    /// Calls `photon` with the TDC codes of the next laser cycle.
    pub fn next_cycle(&mut self, photon: impl FnMut(u16)) -> Result<()> {
        let rng = &mut self.rng;
        match self.stray {
            StrayLight::Drops {
                each,
                photons,
                before,
            } => {
                if Uniform::new(0.0, each)?.sample(rng) < 1.0 {
                    let place = Uniform::new(0.0, before)?.sample(rng);
                    pulse(photons, place, rng, photon)?;
                }
            }
            StrayLight::Smoke {
                photons,
                from,
                decay,
            } => {
                let (depth, width) = (Exp::new(1.0 / decay)?, Normal::new(from, SIGMA)?);
                let place = |rng: &mut Pcg64| width.sample(rng) + depth.sample(rng);
                draw(photons, place, rng, photon)?;
            }
            StrayLight::Laser {
                photons,
                step,
                dither,
            } => {
                pulse(photons, self.place, rng, photon)?;
                let added = f64::from(self.added.next().unwrap_or(0)) - f64::from(dither) / 2.0;
                let next = self.place + step - added;
                self.place = (next + REACH).rem_euclid(PERIOD) - REACH;
            }
        }
        Ok(())
    }
}

/// Draws a pulse as wide as that of the own laser.
fn pulse(photons: f64, place: f64, rng: &mut Pcg64, photon: impl FnMut(u16)) -> Result<()> {
    let place = Normal::new(place, SIGMA)?;
    draw(photons, |rng| place.sample(rng), rng, photon)
}

/// Draws a Poisson number of photons at positions from `place`; those outside the histogram are
/// lost.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "whole numbers, and bins of the histogram"
)]
fn draw(
    photons: f64,
    place: impl Fn(&mut Pcg64) -> f64,
    rng: &mut Pcg64,
    mut photon: impl FnMut(u16),
) -> Result<()> {
    for _ in 0..Poisson::new(photons)?.sample(rng) as u64 {
        let place = place(rng);
        if (0.0..BINS as f64).contains(&place) {
            photon(place as u16);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::SeedableRng;

    /// Half of the photons of bin 0 are late ones of a pulse before the own pulse.
    #[test]
    fn another_laser_sends_as_many_photons_into_the_first_and_last_bins_as_into_others() {
        let stray = StrayLight::Laser {
            photons: 20.0,
            step: 0.37,
            dither: 128,
        };
        let mut photons = StrayPhotons::new(stray, Pcg64::seed_from_u64(3)).unwrap();
        let mut counts = [0u32; BINS];
        let cycles = 100_000;
        for _ in 0..cycles {
            photons
                .next_cycle(|code| counts[usize::from(code)] += 1)
                .unwrap();
        }
        // Photons of a pulse come together, so that counts vary more than by Poisson's law.
        let expected = 20.0 * f64::from(cycles) / PERIOD;
        for bin in [0, 1, 2, 64, 125, 126, 127] {
            let off = f64::from(counts[bin]) / expected - 1.0;
            assert!(off.abs() < 0.2, "{bin}: {off}");
        }
    }
}
