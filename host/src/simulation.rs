//! Simulated photons: for each pixel a background, a signal and a pulse, no
//! more.
//!
//! Background photons are Poisson distributed and spread evenly over the bins;
//! signal photons are Poisson distributed and normally distributed around the
//! pulse position (Eq. 1 to 3, one object). A signal photon outside the
//! histogram is not detected.

use anyhow::{Context, Result};
use dtof_core::PixelAddress;
use rand_distr::{Bernoulli, Distribution, Normal, Poisson, Uniform};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use crate::source::{Geometry, Photon, PhotonSource, PixelPhotons, Slice, pixel_rng};

/// What one pixel receives in a laser cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// Background photons a bin (B).
    pub background: f64,
    /// Signal photons (A).
    pub signal: f64,
    /// Where the pulse lies, in bins from the start of bin 0 (µ).
    pub position: f64,
    /// Its standard deviation in bins (σ).
    pub sigma: f64,
}

/// One pixel that receives photons at constant rates.
#[derive(Clone, Debug)]
pub struct SimulatedPixel {
    photons: Option<Poisson<f64>>,
    is_signal: Bernoulli,
    pulse: Normal<f64>,
    bin: Uniform<u16>,
    bins: u16,
    rng: Pcg64,
}

impl SimulatedPixel {
    /// A pixel with `bins` bins and the random numbers `rng`.
    ///
    /// # Errors
    /// If a rate is negative or not a number, or `bins` is 0.
    pub fn new(rates: &Rates, bins: u16, rng: Pcg64) -> Result<Self> {
        let background = rates.background * f64::from(bins);
        let total = background + rates.signal;
        let signal_share = if total > 0.0 {
            rates.signal / total
        } else {
            0.0
        };
        // No photons at all is a rate the distribution does not take.
        let photons = if total == 0.0 {
            None
        } else {
            Some(Poisson::new(total)?)
        };
        Ok(Self {
            photons,
            is_signal: Bernoulli::new(signal_share).context("a photon rate is negative")?,
            pulse: Normal::new(rates.position, rates.sigma)
                .context("the pulse is not a normal one")?,
            bin: Uniform::new(0, bins)?,
            bins,
            rng,
        })
    }

    /// Gives `photon` the TDC code of each photon of the next laser cycle.
    pub fn next_cycle(&mut self, mut photon: impl FnMut(u16)) {
        let Some(photons) = self.photons else { return };
        // A Poisson sample is a whole number; counting up to it is exact.
        let count = photons.sample(&mut self.rng);
        let mut made = 0.0;
        while made < count {
            made += 1.0;
            if !self.is_signal.sample(&mut self.rng) {
                photon(self.bin.sample(&mut self.rng));
                continue;
            }
            let position = self.pulse.sample(&mut self.rng);
            if (0.0..f64::from(self.bins)).contains(&position) {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                photon(position as u16); // the bin: rounded down, within `bins`
            }
        }
    }
}

/// An array of simulated pixels.
#[derive(Clone, Debug)]
pub struct SimulatedArray {
    geometry: Geometry,
    cycles: u64,
    next_cycle: u64,
    pixels: Vec<SimulatedPixel>,
}

impl SimulatedArray {
    /// `rates` row by row for `cycles` laser cycles.
    ///
    /// # Errors
    /// If there are more pixels than addresses, or a rate is not one.
    pub fn new(
        geometry: Geometry,
        rates: &[Rates],
        bins: u16,
        cycles: u64,
        seed: u64,
    ) -> Result<Self> {
        assert_eq!(
            rates.len(),
            geometry.addresses(),
            "one set of rates a pixel"
        );
        let pixels = rates
            .iter()
            .enumerate()
            .map(|(index, rates)| {
                let address = u16::try_from(index).context("more than 65,536 pixels")?;
                SimulatedPixel::new(rates, bins, pixel_rng(seed, PixelAddress(address)))
            })
            .collect::<Result<_>>()?;
        Ok(Self {
            geometry,
            cycles,
            next_cycle: 0,
            pixels,
        })
    }
}

impl PhotonSource for SimulatedArray {
    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn cycles(&self) -> u64 {
        self.cycles
    }

    fn next_slice(&mut self, cycles: u16) -> Result<Slice> {
        let first_cycle = self.next_cycle;
        self.next_cycle += u64::from(cycles);
        let pixels = self
            .pixels
            .par_iter_mut()
            .map(|pixel| {
                let mut photons = Vec::new();
                for cycle in 0..cycles {
                    pixel.next_cycle(|code| photons.push(Photon { cycle, code }));
                }
                PixelPhotons { cycles, photons }
            })
            .collect();
        Ok(Slice {
            first_cycle,
            pixels,
        })
    }
}
