//! Photons of an array whose pixels see one surface each, and the engine that decides.

use anyhow::{Context, Result};
use dtof::engine::group::{Configs, Group};
use dtof::engine::settings::{AdaptiveBinning, Settings};
use dtof::input::source::{Geometry, Photon, PixelPhotons};
use dtof_core::fixed::types::{I24F8, U4F12, U8F8, U16F16};
use dtof_core::{
    BlockLevel, Count, DepthEvent, EchoNumber, PixelAddress, RangeGate, WindowRule, z_for_levels,
};
use dtof_theory::rates::Rates;
use rand_core::Rng;
use rand_distr::{Distribution, Normal, Poisson};
use rand_pcg::Pcg64;

/// Bins of a histogram.
pub const BINS: usize = 128;
/// Laser cycles between looks, the first look with N > L1, and the longest exposure.
pub const X: u16 = 4;
pub const L1: u16 = 40;
pub const L2: u16 = 1000;
/// Standard deviation of the pulse in bins.
pub const SIGMA: f64 = 1.0;
/// Laser cycles drawn at a time.
const SLICE: u16 = 100;
/// An event farther from the surface, in bins, is wrong.
pub const NEAR: f64 = 3.0;

/// What is on beside the single pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// Levels of blocks.
    pub levels: BlockLevel,
    /// Laser cycles.
    pub patience: u16,
    /// Whether pixels expect their next event.
    pub tracking: bool,
    /// One of so many pixels is to be covered by a false report in L2 laser cycles.
    pub one_in: u32,
}

impl Setting {
    /// The z for it.
    pub fn z(&self) -> U4F12 {
        let gate = RangeGate::<BINS>::full();
        z_for_levels(self.one_in, &gate, X, L1, L2, self.levels)
    }

    /// With this z.
    pub fn settings(&self, z: U4F12) -> Result<Settings> {
        Ok(Settings {
            bins: BINS,
            bin_width_ps: const { U16F16::lit("250") },
            offset_mm: I24F8::ZERO,
            gate: None,
            rule: WindowRule::new(3, z, Count::saturating(5))?.into(),
            sigma_bins: Some(U8F8::from_num(SIGMA)),
            l1: L1,
            l2: L2,
            x: X,
            binning: (self.levels != BlockLevel::PIXEL).then_some(AdaptiveBinning {
                levels: self.levels,
                patience: self.patience,
            }),
            tracking: self.tracking,
            echoes: EchoNumber::FIRST,
            echo_wait: Settings::ECHO_WAIT,
            one_hit_tdc: false,
            frame: None,
            seed: 0,
        })
    }
}

/// The photons of a pixel in X laser cycles.
struct Law {
    background: Poisson<f64>,
    signal: Option<(Poisson<f64>, Normal<f64>)>,
}

impl Law {
    fn new(rates: &Rates) -> Result<Self> {
        let cycles = f64::from(X);
        let signal = (rates.signal > 0.0).then(|| {
            let photons = Poisson::new(rates.signal * cycles)?;
            anyhow::Ok((photons, Normal::new(rates.position, rates.sigma)?))
        });
        Ok(Self {
            background: Poisson::new(rates.background * cycles * BINS as f64)?,
            signal: signal.transpose()?,
        })
    }

    /// Adds photons to `photons`, all in laser cycle `cycle` of the slice: pixels look after
    /// every X of them, so that it does not matter in which.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "whole numbers, and bins of the histogram"
    )]
    fn draw(&self, cycle: u16, photons: &mut Vec<Photon>, rng: &mut Pcg64) {
        let mut left = self.background.sample(rng) as u64;
        while left > 0 {
            // Four bins from one random number.
            let mut random = rng.next_u64();
            for _ in 0..left.min(4) {
                let code = random as u16 % BINS as u16;
                photons.push(Photon { cycle, code });
                random >>= 16;
            }
            left = left.saturating_sub(4);
        }
        if let Some((number, place)) = &self.signal {
            for _ in 0..number.sample(rng) as u64 {
                let bin = place.sample(rng).floor();
                if (0.0..BINS as f64).contains(&bin) {
                    let code = bin as u16;
                    photons.push(Photon { cycle, code });
                }
            }
        }
    }
}

/// An array and what decides on its photons.
pub struct Field {
    array: Geometry,
    laws: Vec<Law>,
    configs: Configs<BINS>,
    groups: Vec<Group<BINS>>,
    cycle: u64,
}

impl Field {
    /// An array of pixels with these rates, row by row.
    pub fn new(array: Geometry, rates: &[Rates], settings: &Settings) -> Result<Self> {
        let addresses: Vec<PixelAddress> = (0..=u16::MAX)
            .take(array.addresses())
            .map(PixelAddress)
            .collect();
        let groups = match settings.binning {
            Some(binning) => Group::of_array(array, binning, &addresses)?,
            None => {
                let numbered = addresses.iter().enumerate();
                numbered
                    .map(|(number, &address)| Group::of_pixel(number, address))
                    .collect()
            }
        };
        Ok(Self {
            array,
            laws: rates.iter().map(Law::new).collect::<Result<_>>()?,
            configs: Configs {
                pixels: settings.config()?,
                blocks: settings.block_config()?,
                patience: settings.binning.map_or(0, |binning| binning.patience),
            },
            groups,
            cycle: 0,
        })
    }

    /// The laser cycles so far.
    pub fn cycle(&self) -> u64 {
        self.cycle
    }

    /// The surfaces change.
    pub fn set(&mut self, rates: &[Rates]) -> Result<()> {
        self.laws = rates.iter().map(Law::new).collect::<Result<_>>()?;
        Ok(())
    }

    /// The next `cycles` laser cycles, a multiple of [`SLICE`]: events in order of time.
    pub fn run(
        &mut self,
        cycles: u64,
        rng: &mut Pcg64,
        mut visit: impl FnMut(&DepthEvent),
    ) -> Result<()> {
        let end = self.cycle + cycles;
        while self.cycle < end {
            let mut photons = Vec::with_capacity(self.laws.len());
            for law in &self.laws {
                let mut of_pixel = PixelPhotons {
                    cycles: SLICE,
                    photons: Vec::new(),
                };
                for cycle in (X - 1..SLICE).step_by(X.into()) {
                    law.draw(cycle, &mut of_pixel.photons, rng);
                }
                photons.push(of_pixel);
            }
            let mut events = Vec::new();
            for group in &mut self.groups {
                events.extend(group.run(&self.configs, self.cycle, &photons).events);
            }
            events.sort_unstable_by_key(|event| (event.cycle, event.level, event.pixel));
            events.iter().for_each(&mut visit);
            self.cycle += u64::from(SLICE);
        }
        Ok(())
    }

    /// The pixels that an event stands for: those that have not reported by themselves, or in
    /// a smaller block, within its exposure.
    pub fn covered<'a>(
        &'a self,
        event: &'a DepthEvent,
        reports: &'a Reports,
    ) -> impl Iterator<Item = usize> + 'a {
        let first = (event.cycle.0 + 1).saturating_sub(event.exposure.into());
        let pixels = self.array.block(event.pixel, event.level);
        let finer = usize::from(event.level.raw());
        pixels
            .map(|pixel| usize::from(pixel.0))
            .filter(move |&pixel| {
                reports.last[pixel][..finer]
                    .iter()
                    .all(|&last| last <= first)
            })
    }
}

/// When pixels reported last, by themselves or in a block: one more than the laser cycle, 0
/// before.
pub struct Reports {
    last: Vec<[u64; 4]>,
}

impl Reports {
    /// None yet.
    pub fn new(array: Geometry) -> Self {
        Self {
            last: vec![[0; 4]; array.addresses()],
        }
    }

    /// Pixel `pixel` was covered by `event`.
    pub fn note(&mut self, pixel: usize, event: &DepthEvent) {
        self.last[pixel][usize::from(event.level.raw())] = event.cycle.0 + 1;
    }
}

/// Whether an event lies where `position` is, in bins.
pub fn is_right(event: &DepthEvent, position: f64) -> bool {
    (f64::from(event.position().raw()) / 256.0 - position).abs() <= NEAR
}

/// The level of so many.
pub fn level(levels: f64) -> Result<BlockLevel> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    BlockLevel::new(levels as u8).context("a level from 0 to 3")
}
