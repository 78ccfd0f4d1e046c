//! One simulated pixel: the plain model, and the effects on top of it.

use anyhow::{Context, Result};
use dtof_core::PixelAddress;
use dtof_theory::rates::Rates;
use rand_distr::{Bernoulli, Distribution, Normal, Poisson, Uniform};
use rand_pcg::Pcg64;

use super::arrival::{Arrival, code};
use super::detector::Detector;
use super::effects::Effects;
use super::effects::limits::Timing;

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
        let photons = (total != 0.0).then(|| Poisson::new(total));
        Ok(Self {
            photons: photons.transpose()?,
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
    pub(super) fn photons_per_cycle(&self) -> f64 {
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
