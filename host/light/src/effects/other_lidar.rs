//! Another LiDAR, whose pulses reach the sensor.

use anyhow::Result;
use dtof_core::PixelAddress;
use dtof_sensors::dither::{Added, Dither};
use rand_distr::{Distribution, Poisson, StandardNormal, Uniform};
use rand_pcg::Pcg64;
use serde::Deserialize;

use super::limits::Timing;
use crate::stream::Stream;
use dtof_data::photons::range::within;

/// Standard deviations by which a photon is surely nearer to the place of its pulse.
const REACH: f64 = 8.0;

/// Every pixel sees its pulses, once in each of the other's laser cycles. The first one comes at a random time.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OtherLidar {
    /// Photons of a pulse in a pixel.
    pub photons: f64,
    /// By how many millionths its laser cycles are longer than the own ones are in the mean; negative is
    /// shorter.
    #[serde(default)]
    pub ppm: f64,
}

impl OtherLidar {
    pub(super) fn check(&self) -> Result<()> {
        within("photons", self.photons, 0.0..=10_000.0)?;
        within("ppm", self.ppm, -500_000.0..=500_000.0)
    }

    /// Its laser cycle over the mean of the own ones.
    fn slowness(&self) -> f64 {
        1.0 + self.ppm / 1e6
    }

    /// Its photons in an own laser cycle.
    pub(crate) fn photons_per_cycle(&self) -> f64 {
        self.photons / self.slowness()
    }
}

/// Its photons in one pixel.
#[derive(Clone, Debug)]
pub(crate) struct OtherPulses {
    photons: Option<Poisson<f64>>,
    sigma: f64,
    /// The place of the next pulse to draw in bins, from the own pulse on, and its laser cycle.
    place: f64,
    period: f64,
    /// The own mean laser cycle less half the dither, and what each laser cycle takes more.
    shortest: f64,
    added: Added,
    /// Photons that come in a later laser cycle, from its beginning on.
    later: Vec<f64>,
    rng: Pcg64,
}

impl OtherPulses {
    /// All pixels see its pulses at the same times.
    pub(crate) fn new(
        other: &OtherLidar,
        sigma: f64,
        timing: &Timing,
        seed: u64,
        pixel: PixelAddress,
    ) -> Result<Self> {
        let period = timing.period * other.slowness();
        let reach = REACH * sigma;
        let mut start = Stream::OtherLidarStart.rng(seed, PixelAddress::new(0));
        let photons = (other.photons > 0.0).then(|| Poisson::new(other.photons));
        let dither = Dither::new(timing.dither_bins, seed)?;
        Ok(Self {
            photons: photons.transpose()?,
            sigma,
            // The late photons of a pulse before laser cycle 0 come in it.
            place: Uniform::new(-reach, period - reach)?.sample(&mut start),
            period,
            shortest: timing.period - f64::from(dither.range()) / 2.0,
            added: dither.added(),
            later: Vec::new(),
            rng: Stream::OtherLidar.rng(seed, pixel),
        })
    }

    /// Gives `photon` the times of its photons in the next laser cycle. A pulse is drawn as soon as one of its
    /// photons may come, and its photons are kept until their laser cycle.
    pub(crate) fn draw(&mut self, mut photon: impl FnMut(f64)) {
        let length = self.shortest + f64::from(self.added.next().unwrap_or(0));
        while self.place < length + REACH * self.sigma {
            let mut left = self
                .photons
                .map_or(0.0, |photons| photons.sample(&mut self.rng));
            while left > 0.0 {
                left -= 1.0;
                let spread: f64 = StandardNormal.sample(&mut self.rng);
                self.later.push(self.place + self.sigma * spread);
            }
            self.place += self.period;
        }
        self.place -= length;
        self.later.retain_mut(|time| {
            let is_later = *time >= length;
            if is_later {
                *time -= length;
            } else {
                photon(*time);
            }
            is_later
        });
    }
}
