//! A scene in which a method may fail, and its photons.

use anyhow::Result;
use dtof_core::{PixelAddress, RangeGate};
use rand_core::Rng;
use rand_pcg::Pcg64;

use super::rows::{self, Row};
use super::stray::{StrayLight, StrayPhotons};
use super::{BINS, PERIOD, SIGMA};
use dtof_data::random::pixel_rng;
use dtof_light::SimulatedPixel;
use dtof_light::effects::Effects;
use dtof_light::effects::limits::Timing;
use dtof_light::rates::Rates;

/// The plain scene: background photons a bin and laser cycle, signal photons a laser cycle, and
/// their position in bins.
pub(in crate::studies) const BACKGROUND: f64 = 0.05;
pub(in crate::studies) const SIGNAL: f64 = 0.5;
pub(super) const PLACE: f64 = 80.3;

/// A Gaussian pulse.
#[derive(Clone, Copy, Debug)]
struct Pulse {
    signal: f64,
    position: f64,
    /// Whether it is a surface, not the cover glass.
    is_surface: bool,
}

/// A scene.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its difference from the plain scene.
    pub name: String,
    /// Its row of the page.
    pub row: Row,
    /// The range gate.
    pub gate: RangeGate<BINS>,
    /// Exposures of a trial.
    pub exposures: u64,
    background: f64,
    pulses: Vec<Pulse>,
    effects: Effects,
    stray: Option<StrayLight>,
    /// A factor for the background, and the laser cycle from which it applies.
    change: (f64, u32),
    /// Motion of the surfaces in bins a laser cycle.
    drift: f64,
    /// The dead time of the TDC in bins, as pixels are set to; 0 if they are not.
    pub dead_time: u16,
    /// Whether photons of one laser cycle in one bin count once.
    pub once_per_bin: bool,
}

impl Case {
    /// The plain scene, named `name`.
    pub(in crate::studies) fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            row: rows::PLAIN,
            gate: RangeGate::full(),
            exposures: 10,
            background: BACKGROUND,
            pulses: Vec::new(),
            effects: Effects::default(),
            stray: None,
            change: (1.0, 0),
            drift: 0.0,
            dead_time: 0,
            once_per_bin: false,
        }
        .and(SIGNAL, PLACE)
    }

    pub(super) const fn in_row(mut self, row: Row) -> Self {
        self.row = row;
        self
    }

    /// Adds a surface.
    pub(super) fn and(mut self, signal: f64, position: f64) -> Self {
        self.pulses.push(Pulse {
            signal,
            position,
            is_surface: true,
        });
        self
    }

    /// Replaces the surfaces by one.
    pub(super) fn only(mut self, signal: f64, position: f64) -> Self {
        self.pulses.clear();
        self.and(signal, position)
    }

    /// Adds a pulse in front of the surface that is not a target.
    pub(super) fn behind(mut self, signal: f64, position: f64) -> Self {
        self.pulses.push(Pulse {
            signal,
            position,
            is_surface: false,
        });
        self
    }

    /// Removes the target.
    pub(in crate::studies) fn without_target(mut self) -> Self {
        self.pulses.clear();
        self.behind(0.0, PLACE)
    }

    pub(in crate::studies) fn with_background(mut self, background: f64) -> Self {
        self.background = background;
        self
    }

    pub(super) fn with_effects(mut self, effects: Effects) -> Self {
        self.effects = effects;
        self
    }

    /// Sets pixels to the dead time of the TDC.
    pub(super) fn set_to_dead_time(mut self) -> Self {
        self.dead_time = self.effects.tdc_dead_time();
        self
    }

    pub(super) fn counting_once_per_bin(mut self) -> Self {
        self.once_per_bin = true;
        self
    }

    /// Multiplies the background by `factor` after laser cycle `cycle`.
    pub(super) fn changing(mut self, factor: f64, cycle: u32) -> Self {
        self.change = (factor, cycle);
        self
    }

    pub(in crate::studies) fn with_stray(mut self, stray: StrayLight) -> Self {
        self.stray = Some(stray);
        self
    }

    pub(super) fn gated(mut self, gate: RangeGate<BINS>) -> Self {
        self.gate = gate;
        self
    }

    pub(super) fn drifting(mut self, drift: f64) -> Self {
        self.drift = drift;
        self
    }

    /// The positions of the surfaces at the end of laser cycle `cycle` of an exposure, in bins from
    /// the start of bin 0.
    pub fn surfaces(&self, cycle: u32) -> impl Iterator<Item = f64> {
        let surfaces = self.pulses.iter().filter(|pulse| pulse.is_surface);
        let moved = self.drift * f64::from(cycle);
        surfaces.map(move |pulse| pulse.position + moved)
    }

    /// A simulated pixel in front of the scene.
    ///
    /// # Errors
    /// Fails if a rate or an effect is out of its range.
    pub fn pixel(&self, rng: &mut Pcg64) -> Result<CasePixel> {
        let timing = Timing {
            bins: u16::try_from(BINS)?,
            bin_width_ps: 250.0,
            period: PERIOD,
            dither_bins: 0,
        };
        let mut parts = Vec::new();
        for (index, pulse) in self.pulses.iter().enumerate() {
            let rates = Rates {
                background: if index == 0 { self.background } else { 0.0 },
                signal: pulse.signal,
                position: pulse.position,
                sigma: SIGMA,
            };
            let (seed, address) = (rng.next_u64(), PixelAddress::new(0));
            let part = SimulatedPixel::new(&rates, timing.bins, pixel_rng(seed, address))?;
            parts.push((
                part.with_effects(&self.effects, &timing, seed, address)?,
                rates,
            ));
        }
        let stray = self.stray.map(|stray| {
            let seed = rng.next_u64();
            StrayPhotons::new(stray, pixel_rng(seed, PixelAddress::new(0)))
        });
        Ok(CasePixel {
            parts,
            stray: stray.transpose()?,
            change: self.change,
            drift: self.drift,
        })
    }
}

/// The photons of a scene: independent photons of each pulse, the first with the background, and
/// stray light.
pub struct CasePixel {
    parts: Vec<(SimulatedPixel, Rates)>,
    stray: Option<StrayPhotons>,
    change: (f64, u32),
    drift: f64,
}

impl CasePixel {
    /// Calls `photon` with the TDC codes of laser cycle `cycle`, counted from 1.
    ///
    /// # Errors
    /// Fails if the change makes a rate negative.
    pub fn next_cycle(&mut self, cycle: u32, mut photon: impl FnMut(u16)) -> Result<()> {
        let (factor, after) = self.change;
        let factor = if cycle > after { factor } else { 1.0 };
        for (part, rates) in &mut self.parts {
            part.set_rates(&Rates {
                background: rates.background * factor,
                position: rates.position + self.drift * f64::from(cycle),
                ..*rates
            })?;
            part.next_cycle(&mut photon);
        }
        if let Some(stray) = &mut self.stray {
            stray.next_cycle(photon)?;
        }
        Ok(())
    }
}
