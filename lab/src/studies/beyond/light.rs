//! The photons of one pixel that sees several surfaces.

use super::setting::{BINS, SIGMA};
use anyhow::Result;
use rand_core::Rng;
use rand_distr::{Distribution, Normal, Poisson};
use rand_pcg::Pcg64;

/// The photons of a background and some surfaces.
pub struct Light {
    background: Poisson<f64>,
    surfaces: Vec<(Poisson<f64>, Normal<f64>)>,
}

impl Light {
    /// With `background` photons a bin; a surface is its photons and its position.
    pub fn new(background: f64, surfaces: &[(f64, f64)]) -> Result<Self> {
        let surface = |&(photons, position): &(f64, f64)| {
            Ok((Poisson::new(photons)?, Normal::new(position, SIGMA)?))
        };
        Ok(Self {
            background: Poisson::new(background * BINS as f64)?,
            surfaces: surfaces.iter().map(surface).collect::<Result<_>>()?,
        })
    }

    /// Draws photons; returns their bins.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "bins"
    )]
    pub fn draw(&self, rng: &mut Pcg64) -> Vec<u16> {
        let number = self.background.sample(rng) as u64;
        let mut codes: Vec<u16> = (0..number)
            .map(|_| rng.next_u32() as u16 % BINS as u16)
            .collect();
        for (number, place) in &self.surfaces {
            for _ in 0..number.sample(rng) as u64 {
                let bin = place.sample(rng).floor();
                if (0.0..BINS as f64).contains(&bin) {
                    codes.push(bin as u16);
                }
            }
        }
        codes
    }
}
