//! Photons of an array whose pixels see one surface each, and the engine that decides.

use super::setting::{BINS, X};
use anyhow::Result;
use dtof_core::{Array, DepthEvent, PixelAddress};
use dtof_data::events::last_events::LastEvents;
use dtof_data::photons::source::{Photon, PixelPhotons, Slice};
use dtof_engine::Engine;
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_light::rates::Rates;
use rand_core::Rng;
use rand_distr::{Distribution, Normal, Poisson};
use rand_pcg::Pcg64;

/// Laser cycles drawn at a time.
const SLICE: u16 = 100;
/// The largest distance of a right event from its surface, in bins.
pub const NEAR: f64 = 3.0;

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

    /// Adds photons to `photons`, all in laser cycle `cycle` of the slice. Pixels look every X
    /// laser cycles, so the exact cycle does not matter.
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

/// An array and the engine that decides on its photons.
pub struct SimulatedArray {
    laws: Vec<Law>,
    engine: Box<dyn Engine>,
    cycle: u64,
}

impl SimulatedArray {
    /// An array of pixels with `rates`, row by row.
    pub fn new(array: Array, rates: &[Rates], settings: &Settings) -> Result<Self> {
        let addresses: Vec<PixelAddress> = (0..=u16::MAX)
            .take(array.pixels() as usize)
            .map(PixelAddress::new)
            .collect();
        Ok(Self {
            laws: rates.iter().map(Law::new).collect::<Result<_>>()?,
            engine: host_engine(settings, array, &addresses)?,
            cycle: 0,
        })
    }

    /// The laser cycles so far.
    pub fn cycle(&self) -> u64 {
        self.cycle
    }

    /// Changes the rates.
    pub fn set(&mut self, rates: &[Rates]) -> Result<()> {
        self.laws = rates.iter().map(Law::new).collect::<Result<_>>()?;
        Ok(())
    }

    /// Runs the next `cycles` laser cycles, a multiple of [`SLICE`]. Returns the events in order of
    /// time.
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
            let events = self.engine.run(&Slice {
                first_cycle: self.cycle,
                pixels: photons,
            })?;
            events.iter().for_each(&mut visit);
            self.cycle += u64::from(SLICE);
        }
        Ok(())
    }
}

/// When each pixel reported last, alone or in a block.
pub struct Reports {
    array: Array,
    last: Vec<LastEvents>,
}

impl Reports {
    /// Before any report.
    pub fn new(array: Array) -> Self {
        Self {
            array,
            last: vec![LastEvents::default(); array.pixels() as usize],
        }
    }

    /// Adds an event, and returns the pixels it stands for.
    pub fn take(&mut self, event: &DepthEvent) -> Vec<usize> {
        let pixels = self.array.pixels_of(event.pixel, event.level);
        pixels
            .map(|pixel| usize::from(pixel.raw()))
            .filter(|&pixel| {
                self.last[pixel].record(event.level, event.cycle, event.exposure.into())
            })
            .collect()
    }
}

/// Whether an event lies at `position`, in bins.
pub fn is_right(event: &DepthEvent, position: f64) -> bool {
    (f64::from(event.position().raw()) / 256.0 - position).abs() <= NEAR
}

/// The name of the verdict in a tally.
pub fn verdict(event: &DepthEvent, position: f64) -> &'static str {
    if is_right(event, position) {
        "right"
    } else {
        "wrong"
    }
}
