//! Simulated photons: for each pixel a background, a signal and a pulse, and
//! the effects of light and detector that are switched on.
//!
//! Background photons are Poisson distributed and spread evenly over the bins;
//! signal photons are Poisson distributed and normally distributed around the
//! pulse position (Eq. 1 to 3, one object). A signal photon outside the
//! histogram is not detected.
//!
//! That is the plain model, and all there is unless [`Effects`] say otherwise.
//! With effects the same photons, drawn from the same random numbers, take a
//! longer way:
//!
//! ```text
//! arrivals (f64, bins after the laser fires)
//!   → light      second echo, cover glass, pulse tail, hot pixels
//!   → SPAD       dead time, afterpulsing
//!   → TDC        jitter, hits a laser cycle
//!   → TDC codes
//! ```
//!
//! Each effect has random numbers of its own: switching one on leaves those of
//! all others as they were.

pub mod afterpulsing;
pub mod cover_glass;
pub mod dead_time;
mod detector;
pub mod effects;
pub mod hot_pixels;
pub mod jitter;
pub mod second_echo;
mod stream;
pub mod tail;
pub mod tdc;

use anyhow::{Context, Result};
use dtof_core::PixelAddress;
use dtof_theory::rates::Rates;
use rand_distr::{Bernoulli, Distribution, Normal, Poisson, Uniform};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use crate::source::{Geometry, Photon, PhotonSource, PixelPhotons, Slice};
use detector::Detector;
use effects::{Effects, Timing};

/// Millimetres of range a picosecond, half the speed of light.
pub const MM_PER_PS: f64 = 0.149_896_229;

/// A photon of the plain model.
enum Arrival {
    /// In a bin, anywhere.
    Background(u16),
    /// So many bins from the start of bin 0.
    Signal(f64),
}

/// The plain model at constant rates.
#[derive(Clone, Debug)]
struct Model {
    photons: Option<Poisson<f64>>,
    is_signal: Bernoulli,
    pulse: Normal<f64>,
    bin: Uniform<u16>,
}

impl Model {
    fn new(rates: &Rates, bins: u16) -> Result<Self> {
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
        })
    }

    /// The photons of one laser cycle, in no order.
    fn draw(&self, rng: &mut Pcg64, mut arrival: impl FnMut(Arrival)) {
        let Some(photons) = self.photons else { return };
        // A Poisson sample is a whole number; counting up to it is exact.
        let count = photons.sample(rng);
        let mut made = 0.0;
        while made < count {
            made += 1.0;
            arrival(if self.is_signal.sample(rng) {
                Arrival::Signal(self.pulse.sample(rng))
            } else {
                Arrival::Background(self.bin.sample(rng))
            });
        }
    }
}

/// One pixel.
#[derive(Clone, Debug)]
pub struct SimulatedPixel {
    model: Model,
    rates: Rates,
    bins: u16,
    rng: Pcg64,
    /// If there is an effect.
    detector: Option<Box<Detector>>,
}

impl SimulatedPixel {
    /// A pixel of the plain model with `bins` bins and the random numbers
    /// `rng`.
    ///
    /// # Errors
    /// If a rate is negative or not a number, or `bins` is 0.
    pub fn new(rates: &Rates, bins: u16, rng: Pcg64) -> Result<Self> {
        Ok(Self {
            model: Model::new(rates, bins)?,
            rates: *rates,
            bins,
            rng,
            detector: None,
        })
    }

    /// The same pixel with `effects`, which have random numbers by `seed` and
    /// `address`.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn with_effects(
        mut self,
        effects: &Effects,
        timing: &Timing,
        seed: u64,
        address: PixelAddress,
    ) -> Result<Self> {
        if effects.any() {
            let detector = Detector::new(effects, &self.rates, timing, seed, address)?;
            self.detector = Some(Box::new(detector));
        }
        Ok(self)
    }

    /// From the next laser cycle on the signal and its place are these. The
    /// background and the pulse of the effects stay what they were.
    ///
    /// # Errors
    /// If a rate is negative or not a number.
    pub fn set_rates(&mut self, rates: &Rates) -> Result<()> {
        if *rates != self.rates {
            self.model = Model::new(rates, self.bins)?;
            self.rates = *rates;
        }
        Ok(())
    }

    /// Photons that have to be drawn in a laser cycle.
    fn photons_per_cycle(&self) -> f64 {
        let plain = self.rates.background * f64::from(self.bins) + self.rates.signal;
        let detector = self.detector.as_ref();
        detector.map_or(plain, |detector| detector.photons_per_cycle(plain))
    }

    /// Gives `photon` the TDC code of each photon of the next laser cycle.
    pub fn next_cycle(&mut self, mut photon: impl FnMut(u16)) {
        if let Some(detector) = &mut self.detector {
            detector.begin();
            self.model
                .draw(&mut self.rng, |arrival| detector.arrive(&arrival));
            detector.finish(photon);
            return;
        }
        let end = f64::from(self.bins);
        self.model.draw(&mut self.rng, |arrival| match arrival {
            Arrival::Background(bin) => photon(bin),
            Arrival::Signal(position) if (0.0..end).contains(&position) => photon(code(position)),
            Arrival::Signal(_) => {}
        });
    }
}

/// The bin of a position within the histogram.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "rounded down, within the bins"
)]
fn code(position: f64) -> u16 {
    position as u16
}

/// What a pixel receives in a laser cycle, if that changes.
pub type RatesAt = Box<dyn Fn(PixelAddress, u64) -> Rates + Send + Sync>;

/// An array of simulated pixels.
pub struct SimulatedArray {
    geometry: Geometry,
    cycles: u64,
    next_cycle: u64,
    pixels: Vec<SimulatedPixel>,
    rates_at: Option<RatesAt>,
}

impl SimulatedArray {
    /// `pixels` row by row for `cycles` laser cycles, at the rates they have or
    /// at those of `rates_at`.
    #[must_use]
    pub fn new(
        geometry: Geometry,
        pixels: Vec<SimulatedPixel>,
        cycles: u64,
        rates_at: Option<RatesAt>,
    ) -> Self {
        assert_eq!(pixels.len(), geometry.addresses(), "one for each address");
        Self {
            geometry,
            cycles,
            next_cycle: 0,
            pixels,
            rates_at,
        }
    }
}

impl PhotonSource for SimulatedArray {
    fn geometry(&self) -> Geometry {
        self.geometry
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

    fn next_slice(&mut self, cycles: u16) -> Result<Slice> {
        let first_cycle = self.next_cycle;
        self.next_cycle += u64::from(cycles);
        let rates_at = self.rates_at.as_ref();
        let received = |(index, pixel): (usize, &mut SimulatedPixel)| {
            let address = u16::try_from(index).context("more than 65,536 pixels")?;
            let mut photons = Vec::new();
            for cycle in 0..cycles {
                if let Some(rates_at) = rates_at {
                    let at = first_cycle + u64::from(cycle);
                    pixel.set_rates(&rates_at(PixelAddress(address), at))?;
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
