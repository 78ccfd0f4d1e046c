//! An array of simulated pixels.

use anyhow::{Context, Result};
use dtof_core::{Array, PixelAddress};
use dtof_theory::rates::Rates;
use rayon::prelude::*;

use super::pixel::SimulatedPixel;
use dtof_photons::source::{Photon, PhotonSource, PixelPhotons, Slice};

/// The rates of a pixel in a laser cycle, for scenes that change: those of what it sees, and of
/// what is behind.
pub type RatesAt = Box<dyn Fn(PixelAddress, u64) -> [Rates; 2] + Send + Sync>;

/// An array of simulated pixels.
pub struct SimulatedArray {
    array: Array,
    cycles: u64,
    next_cycle: u64,
    pixels: Vec<SimulatedPixel>,
    rates_at: Option<RatesAt>,
    laser_hz: Option<u64>,
    /// Whether photons of a pixel are not wanted.
    spared: Vec<bool>,
}

impl SimulatedArray {
    /// `pixels` row by row for `cycles` laser cycles, at the rates they have or
    /// at those of `rates_at`.
    #[must_use]
    pub fn new(
        array: Array,
        pixels: Vec<SimulatedPixel>,
        cycles: u64,
        rates_at: Option<RatesAt>,
    ) -> Self {
        assert_eq!(
            pixels.len(),
            array.pixels() as usize,
            "one for each address"
        );
        Self {
            array,
            cycles,
            next_cycle: 0,
            pixels,
            rates_at,
            laser_hz: None,
            spared: vec![false; array.pixels() as usize],
        }
    }

    /// The same with a laser of `hz` cycles a second.
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

    fn spare(&mut self, is_wanted: &dyn Fn(PixelAddress) -> bool) {
        for (address, spared) in (0..=u16::MAX).map(PixelAddress).zip(&mut self.spared) {
            *spared = !is_wanted(address);
        }
    }

    fn next_slice(&mut self, cycles: u16) -> Result<Slice> {
        let first_cycle = self.next_cycle;
        self.next_cycle += u64::from(cycles);
        let (rates_at, spared) = (self.rates_at.as_ref(), &self.spared);
        let received = |(index, pixel): (usize, &mut SimulatedPixel)| {
            let address = u16::try_from(index).context("more than 65,536 pixels")?;
            let mut photons = Vec::new();
            if spared[index] {
                return Ok(PixelPhotons { cycles, photons });
            }
            for cycle in 0..cycles {
                if let Some(rates_at) = rates_at {
                    let at = first_cycle + u64::from(cycle);
                    let [rates, behind] = rates_at(PixelAddress(address), at);
                    pixel.set_rates(&rates)?;
                    pixel.set_behind(&behind)?;
                }
                pixel.next_cycle(|code| photons.push(Photon { cycle, code }));
            }
            Ok(PixelPhotons { cycles, photons })
        };
        let pixels = self.pixels.par_iter_mut().enumerate().map(received);
        Ok(Slice {
            first_cycle,
            pixels: pixels.collect::<Result<_>>()?,
        })
    }
}
