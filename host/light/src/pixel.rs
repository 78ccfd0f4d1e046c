//! One simulated pixel: the plain model, and the effects on top of it.

use crate::rates::Rates;
use anyhow::{Context, Result};
use dtof_core::PixelAddress;
use rand_distr::{Bernoulli, Distribution, Normal, Poisson, Uniform};
use rand_pcg::Pcg64;

use super::detector::{Arrival, Detector, code};
use super::effects::Effects;
use super::effects::limits::Timing;
use super::stream::Stream;

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
        // The distribution does not accept a rate of 0.
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
        // A Poisson sample is a whole number, so counting up to it is exact.
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

/// The photons at certain rates.
#[derive(Clone, Debug)]
struct PhotonStream {
    rates: Rates,
    model: Model,
    rng: Pcg64,
}

impl PhotonStream {
    fn new(rates: &Rates, bins: u16, rng: Pcg64) -> Result<Self> {
        Ok(Self {
            rates: *rates,
            model: Model::new(rates, bins)?,
            rng,
        })
    }

    fn set(&mut self, rates: &Rates, bins: u16) -> Result<()> {
        if *rates != self.rates {
            self.model = Model::new(rates, bins)?;
            self.rates = *rates;
        }
        Ok(())
    }

    fn photons_per_cycle(&self, bins: u16) -> f64 {
        self.rates.background * f64::from(bins) + self.rates.signal
    }

    fn draw(&mut self, arrival: impl FnMut(Arrival)) {
        self.model.draw(&mut self.rng, arrival);
    }
}

/// One pixel.
#[derive(Clone, Debug)]
pub struct SimulatedPixel {
    light: PhotonStream,
    /// Photons from behind a surface that lets light through, without background.
    behind: Option<PhotonStream>,
    bins: u16,
    /// The detector, if an effect is on.
    detector: Option<Box<Detector>>,
}

impl SimulatedPixel {
    /// A pixel of the plain model with `bins` bins and the random numbers
    /// `rng`.
    ///
    /// # Errors
    /// Fails if a rate is negative or not a number, or `bins` is 0.
    pub fn new(rates: &Rates, bins: u16, rng: Pcg64) -> Result<Self> {
        Ok(Self {
            light: PhotonStream::new(rates, bins, rng)?,
            behind: None,
            bins,
            detector: None,
        })
    }

    /// Adds light from behind the surface that the pixel sees: the signal of `rates`, without their
    /// background. `seed` and `address` give its random numbers.
    ///
    /// # Errors
    /// Fails if a rate is negative or not a number.
    pub fn with_behind(mut self, rates: &Rates, seed: u64, address: PixelAddress) -> Result<Self> {
        let rng = Stream::Behind.rng(seed, address);
        self.behind = Some(PhotonStream::new(
            &without_background(rates),
            self.bins,
            rng,
        )?);
        Ok(self)
    }

    /// Adds `effects`. `seed` and `address` give their random numbers.
    ///
    /// # Errors
    /// Fails if a parameter is out of its range.
    pub fn with_effects(
        mut self,
        effects: &Effects,
        timing: &Timing,
        seed: u64,
        address: PixelAddress,
    ) -> Result<Self> {
        if effects.any() {
            let detector = Detector::new(effects, &self.light.rates, timing, seed, address)?;
            self.detector = Some(Box::new(detector));
        }
        Ok(self)
    }

    /// Changes the signal and its position from the next laser cycle on. The background and the
    /// pulse of the effects stay as they were.
    ///
    /// # Errors
    /// Fails if a rate is negative or not a number.
    pub fn set_rates(&mut self, rates: &Rates) -> Result<()> {
        self.light.set(rates, self.bins)
    }

    /// Changes the signal from behind the surface from the next laser cycle on. Does nothing if the
    /// pixel has no such light.
    ///
    /// # Errors
    /// Fails if a rate is negative or not a number.
    pub fn set_behind(&mut self, rates: &Rates) -> Result<()> {
        match &mut self.behind {
            Some(behind) => behind.set(&without_background(rates), self.bins),
            None => Ok(()),
        }
    }

    /// Photons to be drawn in a laser cycle.
    pub(super) fn photons_per_cycle(&self) -> f64 {
        let lights = [Some(&self.light), self.behind.as_ref()];
        let lights = lights.into_iter().flatten();
        let plain = lights.map(|light| light.photons_per_cycle(self.bins)).sum();
        let detector = self.detector.as_ref();
        detector.map_or(plain, |detector| detector.photons_per_cycle(plain))
    }

    /// Gives `photon` the TDC code of each photon of the next laser cycle.
    pub fn next_cycle(&mut self, mut photon: impl FnMut(u16)) {
        let lights = [Some(&mut self.light), self.behind.as_mut()];
        let lights = lights.into_iter().flatten();
        if let Some(detector) = &mut self.detector {
            detector.begin();
            for light in lights {
                light.draw(|arrival| detector.arrive(&arrival));
            }
            detector.finish(photon);
            return;
        }
        let end = f64::from(self.bins);
        for light in lights {
            light.draw(|arrival| match arrival {
                Arrival::Background(bin) => photon(bin),
                Arrival::Signal(position) if (0.0..end).contains(&position) => {
                    photon(code(position));
                }
                Arrival::Signal(_) => {}
            });
        }
    }
}

fn without_background(rates: &Rates) -> Rates {
    Rates {
        background: 0.0,
        ..*rates
    }
}
