//! Harder conditions, made from the photons of any source.
//!
//! Poisson counts stay Poisson counts if photons are dropped at random or others are added. So half of the
//! signal is half of all photons, plus new photons for the missing half of the background.

use anyhow::{Context, Result};
use dtof_core::{Array, PixelAddress};
use rand_distr::{Bernoulli, Distribution, Normal, Poisson, StandardUniform};
use rand_pcg::Pcg64;

use dtof_data::photons::source::{Photon, PhotonSource, PixelPhotons, Slice};
use dtof_data::random::pixel_rng;

/// A change of the photons.
#[derive(Clone, Debug, PartialEq)]
pub struct Stress {
    /// Its name.
    pub name: &'static str,
    /// The name above the column of a table, in two lines. Columns with the same first line stand side by side.
    pub short: [&'static str; 2],
    /// The share of the photons that stays.
    pub keep: f64,
    /// Background photons a bin and laser cycle that are added.
    pub background: f64,
    /// Background photons that are added in one hot pixel of each block of 8×8.
    pub hot: f64,
    /// Bins that all photons move until the last laser cycle, and the true ranges with them.
    pub drift_bins: f64,
    /// A second pulse in each laser cycle: its photons, its bin in the first laser cycle, and the bins
    /// that it moves each laser cycle.
    pub pulse: Option<(f64, f64, f64)>,
}

/// Background, signal and pulse.
#[derive(Clone, Copy, Debug)]
pub struct Light {
    /// Background photons a bin and laser cycle of the median pixel.
    pub background: f64,
    /// Signal photons a laser cycle of the median pixel with a target.
    pub signal: f64,
    /// Standard deviation of the pulse in bins.
    pub sigma: f64,
}

/// The period of the second laser, in lengths of the histogram.
const PERIODS: f64 = 8.0;

impl Stress {
    /// No change.
    pub const NONE: Self = Self {
        name: "as it is",
        short: ["as it", "is"],
        keep: 1.0,
        background: 0.0,
        hot: 0.0,
        drift_bins: 0.0,
        pulse: None,
    };

    /// All stresses; the first is [`Self::NONE`]. The gate begins at `first_bin`.
    #[must_use]
    pub fn all(light: &Light, first_bin: u16) -> Vec<Self> {
        let Light {
            background, signal, ..
        } = *light;
        let glass = f64::from(first_bin) + 4.0;
        vec![
            Self::NONE,
            Self {
                name: "twice the background",
                short: ["background", "×2"],
                background,
                ..Self::NONE
            },
            Self {
                name: "four times the background",
                short: ["background", "×4"],
                background: 3.0 * background,
                ..Self::NONE
            },
            Self {
                name: "half the signal",
                short: ["signal", "÷2"],
                keep: 0.5,
                background: 0.5 * background,
                ..Self::NONE
            },
            Self {
                name: "a quarter of the signal",
                short: ["signal", "÷4"],
                keep: 0.25,
                background: 0.75 * background,
                ..Self::NONE
            },
            Self {
                name: "a hot pixel in each block",
                short: ["hot", "pixel"],
                hot: 99.0 * background,
                ..Self::NONE
            },
            Self {
                name: "drift of 4 bins",
                short: ["", "drift"],
                drift_bins: 4.0,
                ..Self::NONE
            },
            Self {
                name: "a glass inside the gate, ten times the signal",
                short: ["cover", "glass"],
                pulse: Some((10.0 * signal, glass, 0.0)),
                ..Self::NONE
            },
            Self {
                name: "a second LiDAR",
                short: ["second", "LiDAR"],
                pulse: Some((signal, 0.0, 4.37)),
                ..Self::NONE
            },
        ]
    }

    /// Bins that photons have moved in laser cycle `cycle` of `cycles`.
    #[must_use]
    pub fn moved(&self, cycle: u64, cycles: u64) -> f64 {
        self.drift_bins * cycle as f64 / cycles.max(1) as f64
    }

    /// Whether `pixel` of an array of `columns` columns is hot: one of each 8×8.
    #[must_use]
    pub fn is_hot(&self, pixel: PixelAddress, columns: u32) -> bool {
        let place = [
            u32::from(pixel.raw()) / columns.max(1),
            u32::from(pixel.raw()) % columns.max(1),
        ];
        self.hot > 0.0 && place.map(|side| side % 8) == [0, 0]
    }
}

/// A source under stress.
pub struct Stressed {
    source: Box<dyn PhotonSource>,
    stress: Stress,
    sigma: f64,
    bins: u16,
    cycles: u64,
    columns: u32,
    pixels: Vec<(PixelAddress, Pcg64)>,
}

impl Stressed {
    /// `source`, of `bins` bins and with a pulse of standard deviation `sigma`, under `stress`.
    #[must_use]
    pub fn new(
        source: Box<dyn PhotonSource>,
        stress: &Stress,
        bins: u16,
        sigma: f64,
        seed: u64,
    ) -> Self {
        let pixels = source.addresses().into_iter();
        // Random numbers other than those of the source.
        let seed = seed.wrapping_add(0x5eed_0f57_2e55_0000);
        Self {
            cycles: source.cycles(),
            columns: source.array().columns(),
            pixels: pixels
                .map(|pixel| (pixel, pixel_rng(seed, pixel)))
                .collect(),
            source,
            stress: stress.clone(),
            sigma,
            bins,
        }
    }
}

impl PhotonSource for Stressed {
    fn inner(&self) -> Option<&dyn PhotonSource> {
        Some(&*self.source)
    }

    fn array(&self) -> Array {
        self.source.array()
    }

    fn cycles(&self) -> u64 {
        self.cycles
    }

    /// It adds photons.
    fn sparse_cycles(&self, _photons: u64) -> u64 {
        0
    }

    fn next_slice(&mut self, cycles: u16) -> Result<Slice> {
        use rayon::prelude::*;

        let slice = self.source.next_slice(cycles)?;
        if self.stress == Stress::NONE {
            return Ok(slice);
        }
        let Self {
            stress,
            sigma,
            bins,
            cycles,
            columns,
            pixels,
            ..
        } = self;
        let first = slice.first_cycle;
        let stressed = pixels.par_iter_mut().zip(slice.pixels);
        let stressed = stressed.map(|((address, rng), photons)| {
            let slice = StressedSlice {
                stress,
                background: stress.background
                    + if stress.is_hot(*address, *columns) {
                        stress.hot
                    } else {
                        0.0
                    },
                sigma: *sigma,
                bins: *bins,
                first,
                cycles: *cycles,
            };
            slice.photons(&photons, rng)
        });
        Ok(Slice {
            first_cycle: first,
            pixels: stressed.collect::<Result<_>>()?,
        })
    }
}

/// One pixel in one slice.
struct StressedSlice<'a> {
    stress: &'a Stress,
    background: f64,
    sigma: f64,
    bins: u16,
    first: u64,
    cycles: u64,
}

impl StressedSlice<'_> {
    fn photons(&self, before: &PixelPhotons, rng: &mut Pcg64) -> Result<PixelPhotons> {
        let bins = f64::from(self.bins);
        let stays = Bernoulli::new(self.stress.keep).context("a share of the photons")?;
        let even = self.background * bins;
        let even = (even > 0.0).then(|| Poisson::new(even)).transpose()?;
        let pulse = self.stress.pulse.filter(|pulse| pulse.0 > 0.0);
        let of_pulse = pulse.map(|pulse| Poisson::new(pulse.0)).transpose()?;
        let mut photons = Vec::with_capacity(before.photons.len());
        let mut left = before.photons.iter().peekable();
        for cycle in 0..before.cycles {
            let now = self.first + u64::from(cycle);
            let moved = self.stress.moved(now, self.cycles);
            let mut put = |place: f64| {
                if (0.0..bins).contains(&place) {
                    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                    let code = place as u16;
                    photons.push(Photon { cycle, code });
                }
            };
            while let Some(photon) = left.next_if(|photon| photon.cycle == cycle) {
                if self.stress.keep < 1.0 && !stays.sample(rng) {
                    continue;
                }
                let code = f64::from(photon.code);
                // A moved photon lies anywhere in its bin.
                put(if moved == 0.0 {
                    code
                } else {
                    code + moved + uniform(rng)
                });
            }
            if let Some(even) = &even {
                for _ in 0..count(even, rng) {
                    put(uniform(rng) * bins);
                }
            }
            if let (Some(of_pulse), Some((_, at, step))) = (&of_pulse, pulse) {
                let place = (at + step * now as f64).rem_euclid(PERIODS * bins);
                let place = Normal::new(place, self.sigma)?;
                for _ in 0..count(of_pulse, rng) {
                    put(place.sample(rng));
                }
            }
        }
        Ok(PixelPhotons {
            cycles: before.cycles,
            photons,
        })
    }
}

/// A Poisson number.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "whole and small"
)]
pub(super) fn count(poisson: &Poisson<f64>, rng: &mut Pcg64) -> u64 {
    poisson.sample(rng) as u64
}

/// A number from 0 to 1, without 1.
fn uniform(rng: &mut Pcg64) -> f64 {
    StandardUniform.sample(rng)
}
