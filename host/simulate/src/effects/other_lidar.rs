//! Another LiDAR, whose pulses reach the sensor.

use anyhow::Result;
use dtof_core::PixelAddress;
use dtof_sensors::dither::{Added, Dither};
use rand_distr::{Distribution, Poisson, StandardNormal, Uniform};
use rand_pcg::Pcg64;
use serde::Deserialize;

use super::limits::Timing;
use crate::stream::Stream;
use dtof_photons::range::within;

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
}

/// Its photons in one pixel.
#[derive(Clone, Debug)]
pub(crate) struct OtherPulses {
    photons: Option<Poisson<f64>>,
    sigma: f64,
    /// The place of its next pulse in bins, from the own pulse on, and its laser cycle.
    place: f64,
    period: f64,
    /// The own mean laser cycle less half the dither, and what each laser cycle takes more.
    shortest: f64,
    added: Added,
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
        let period = timing.period * (1.0 + other.ppm / 1e6);
        let mut start = Stream::OtherLidarStart.rng(seed, PixelAddress::new(0));
        let photons = (other.photons > 0.0).then(|| Poisson::new(other.photons));
        let dither = Dither::new(timing.dither_bins, seed)?;
        Ok(Self {
            photons: photons.transpose()?,
            sigma,
            place: Uniform::new(0.0, period)?.sample(&mut start),
            period,
            shortest: timing.period - f64::from(dither.range()) / 2.0,
            added: dither.added(),
            rng: Stream::OtherLidar.rng(seed, pixel),
        })
    }

    /// Gives `photon` the times of its photons in the next laser cycle.
    pub(crate) fn draw(&mut self, mut photon: impl FnMut(f64)) {
        let length = self.shortest + f64::from(self.added.next().unwrap_or(0));
        while self.place < length {
            let mut left = self
                .photons
                .map_or(0.0, |photons| photons.sample(&mut self.rng));
            while left > 0.0 {
                left -= 1.0;
                let spread: f64 = StandardNormal.sample(&mut self.rng);
                photon(self.place + self.sigma * spread);
            }
            self.place += self.period;
        }
        self.place -= length;
    }
}
