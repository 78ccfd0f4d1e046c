//! An array of simulated pixels.

use crate::rates::Rates;
use anyhow::{Result, ensure};
use dtof_core::{Array, PixelAddress};
use rayon::prelude::*;

use super::pixel::SimulatedPixel;
use dtof_data::photons::source::{Photon, PhotonSource, PixelPhotons, Slice};

/// The rates of a pixel in a laser cycle, for scenes that change: of the surface it sees, and of
/// the one behind.
pub type RatesFn = Box<dyn Fn(PixelAddress, u64) -> [Rates; 2] + Send + Sync>;

/// An array of simulated pixels.
pub struct SimulatedArray {
    array: Array,
    cycles: u64,
    next_cycle: u64,
    pixels: Vec<SimulatedPixel>,
    rates_at: Option<RatesFn>,
    laser_hz: Option<u64>,
    /// Whether the photons of each pixel are left out.
    skipped: Vec<bool>,
}

impl SimulatedArray {
    /// `pixels` row by row for `cycles` laser cycles, at their own rates or those of `rates_at`.
    ///
    /// # Errors
    /// Fails unless there is one for each address.
    pub fn new(
        array: Array,
        pixels: Vec<SimulatedPixel>,
        cycles: u64,
        rates_at: Option<RatesFn>,
    ) -> Result<Self> {
        let addresses = array.pixels() as usize;
        ensure!(
            pixels.len() == addresses,
            "{} simulated pixels for {addresses} addresses",
            pixels.len()
        );
        Ok(Self {
            array,
            cycles,
            next_cycle: 0,
            pixels,
            rates_at,
            laser_hz: None,
            skipped: vec![false; addresses],
        })
    }

    /// Sets the laser rate in hertz.
    #[must_use]
    pub fn with_laser_hz(self, hz: u64) -> Self {
        Self {
            laser_hz: Some(hz),
            ..self
        }
    }
}

impl PhotonSource for SimulatedArray {
    fn array(&self) -> Array {
        self.array
    }

    fn cycles(&self) -> u64 {
        self.cycles
    }

    fn photons_per_cycle(&self) -> f64 {
        self.pixels
            .iter()
            .map(SimulatedPixel::photons_per_cycle)
            .sum()
    }

    fn laser_hz(&self) -> Option<u64> {
        self.laser_hz
    }

    fn limit_to(&mut self, is_needed: &dyn Fn(PixelAddress) -> bool) {
        for (address, skipped) in (0..=u16::MAX).map(PixelAddress::new).zip(&mut self.skipped) {
            *skipped = !is_needed(address);
        }
    }

    fn next_slice(&mut self, cycles: u16) -> Result<Slice> {
        let first_cycle = self.next_cycle;
        self.next_cycle += u64::from(cycles);
        let (rates_at, addresses) = (self.rates_at.as_ref(), self.addresses());
        let received = |((pixel, &address), &skipped): ((&mut SimulatedPixel, _), _)| {
            let mut photons = Vec::new();
            if skipped {
                return Ok(PixelPhotons { cycles, photons });
            }
            for cycle in 0..cycles {
                if let Some(rates_at) = rates_at {
                    let at = first_cycle + u64::from(cycle);
                    let [rates, behind] = rates_at(address, at);
                    pixel.set_rates(&rates)?;
                    pixel.set_behind(&behind)?;
                }
                pixel.next_cycle(|code| photons.push(Photon { cycle, code }));
            }
            Ok(PixelPhotons { cycles, photons })
        };
        let pixels = self
            .pixels
            .par_iter_mut()
            .zip(&addresses)
            .zip(&self.skipped);
        Ok(Slice {
            first_cycle,
            pixels: pixels.map(received).collect::<Result<_>>()?,
        })
    }
}
