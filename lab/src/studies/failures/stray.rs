//! Light that is neither the target's nor even: rain, smoke, another LiDAR.

use super::{BINS, PERIOD, SIGMA};
use anyhow::Result;
use rand_distr::{Distribution, Exp, Normal, Poisson, Uniform};
use rand_pcg::Pcg64;

/// What it comes from.
#[derive(Clone, Copy, Debug)]
pub enum Stray {
    /// Raindrops close by: seldom is one in the beam, and then it is bright. It crosses the beam
    /// in a millisecond, so a laser of some kHz meets it once.
    Drops {
        /// Laser cycles from one to the next, on average.
        each: f64,
        /// Photons of a drop.
        photons: f64,
        /// Where they end, in bins. They lie evenly before that.
        before: f64,
    },
    /// Smoke or fog, which grows dim with its depth.
    Smoke {
        /// Photons of a laser cycle.
        photons: f64,
        /// Its first bin, and bins until it is 1/e as bright.
        from: f64,
        decay: f64,
    },
    /// Another LiDAR's pulses, from a random place of the period on: no clock keeps two together.
    Laser {
        /// Photons of a pulse.
        photons: f64,
        /// How many bins later its pulse comes in each laser cycle than in the one before.
        step: f64,
    },
    /// The same where the own laser pulses at random times: another place in each laser cycle.
    Dithered {
        /// Photons of a pulse.
        photons: f64,
    },
}

/// Its photons in an exposure.
pub struct StrayPhotons {
    stray: Stray,
    rng: Pcg64,
    /// Where the other laser's next pulse comes, in bins.
    place: f64,
}

impl StrayPhotons {
    /// Of an exposure.
    pub fn new(stray: Stray, mut rng: Pcg64) -> Result<Self> {
        let place = Uniform::new(0.0, PERIOD)?.sample(&mut rng);
        Ok(Self { stray, rng, place })
    }

    /// Gives `photon` the TDC codes of the next laser cycle.
    pub fn next_cycle(&mut self, photon: impl FnMut(u16)) -> Result<()> {
        let rng = &mut self.rng;
        match self.stray {
            Stray::Drops {
                each,
                photons,
                before,
            } => {
                if Uniform::new(0.0, each)?.sample(rng) < 1.0 {
                    let place = Uniform::new(0.0, before)?.sample(rng);
                    pulse(photons, place, rng, photon)?;
                }
            }
            Stray::Smoke {
                photons,
                from,
                decay,
            } => {
                let (depth, width) = (Exp::new(1.0 / decay)?, Normal::new(from, SIGMA)?);
                let place = |rng: &mut Pcg64| width.sample(rng) + depth.sample(rng);
                draw(photons, place, rng, photon)?;
            }
            Stray::Laser { photons, step } => {
                pulse(photons, self.place, rng, photon)?;
                self.place = (self.place + step).rem_euclid(PERIOD);
            }
            Stray::Dithered { photons } => {
                let place = Uniform::new(0.0, PERIOD)?.sample(rng);
                pulse(photons, place, rng, photon)?;
            }
        }
        Ok(())
    }
}

/// A pulse as wide as the own.
fn pulse(photons: f64, place: f64, rng: &mut Pcg64, photon: impl FnMut(u16)) -> Result<()> {
    let place = Normal::new(place, SIGMA)?;
    draw(photons, |rng| place.sample(rng), rng, photon)
}

/// A Poisson number of photons, each in a `place`, of which those in the histogram count.
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
