//! The scenes in which a method may fail. Each differs from the plain one in one
//! thing.

use anyhow::Result;
use dtof_core::{PixelAddress, RangeGate};
use rand_core::Rng;
use rand_pcg::Pcg64;

use super::{BINS, L1, SIGMA};
use crate::simulation::dead_time::DeadTime;
use crate::simulation::effects::{Effects, Timing};
use crate::simulation::tail::Tail;
use crate::simulation::tdc::Tdc;
use crate::simulation::{Rates, SimulatedPixel};
use crate::source::pixel_rng;

/// Of the plain scene: background photons a bin and laser cycle, signal photons a
/// laser cycle, and where they lie.
const BACKGROUND: f64 = 0.05;
const SIGNAL: f64 = 0.5;
const PLACE: f64 = 80.3;
/// A signal that takes the window rule some 250 laser cycles.
const WEAK: f64 = 0.12;
/// When a background changes, in laser cycles.
const CHANGE: u32 = 200;
/// Background counts a bin after L1 laser cycles.
pub const BACKGROUNDS: [f64; 5] = [0.05, 0.5, 5.0, 50.0, 500.0];

/// What the case of a background is called, with the signal of the plain scene or a
/// weak one.
#[must_use]
pub fn background_name(counts: f64, is_weak: bool) -> String {
    let weak = if is_weak { ", weak signal" } else { "" };
    format!("background {counts}{weak}")
}

/// A Gaussian pulse.
#[derive(Clone, Copy, Debug)]
struct Pulse {
    signal: f64,
    position: f64,
    /// Not the cover glass.
    is_surface: bool,
}

/// What changes in an exposure.
#[derive(Clone, Copy, Debug)]
enum Change {
    Nothing,
    /// The background, by a factor, after [`CHANGE`] laser cycles.
    Background(f64),
    /// The position, by so many bins a laser cycle.
    Position(f64),
}

/// A scene.
#[derive(Clone, Debug)]
pub struct Case {
    /// What is special about it.
    pub name: String,
    /// Against its failures.
    pub advice: &'static str,
    /// What may hold the peak.
    pub gate: RangeGate<BINS>,
    /// Exposures of a trial.
    pub exposures: u64,
    background: f64,
    pulses: Vec<Pulse>,
    effects: Effects,
    change: Change,
}

impl Case {
    fn new(name: impl Into<String>, advice: &'static str) -> Self {
        Self {
            name: name.into(),
            advice,
            gate: RangeGate::full(),
            exposures: 10,
            background: BACKGROUND,
            pulses: Vec::new(),
            effects: Effects::default(),
            change: Change::Nothing,
        }
        .and(SIGNAL, PLACE)
    }

    /// One more surface.
    fn and(mut self, signal: f64, position: f64) -> Self {
        self.pulses.push(Pulse {
            signal,
            position,
            is_surface: true,
        });
        self
    }

    /// The only surface.
    fn only(mut self, signal: f64, position: f64) -> Self {
        self.pulses.clear();
        self.and(signal, position)
    }

    fn with_cover_glass(mut self) -> Self {
        self.pulses.push(Pulse {
            signal: 10.0 * SIGNAL,
            position: 3.5,
            is_surface: false,
        });
        self
    }

    fn with_background(mut self, background: f64) -> Self {
        self.background = background;
        self
    }

    fn with_effects(mut self, effects: Effects) -> Self {
        self.effects = effects;
        self
    }

    fn changing(mut self, change: Change) -> Self {
        self.change = change;
        self
    }

    /// Where the surfaces lie at the end of laser cycle number `cycle` of an
    /// exposure, in bins from the start of bin 0.
    pub fn surfaces(&self, cycle: u32) -> impl Iterator<Item = f64> {
        let surfaces = self.pulses.iter().filter(|pulse| pulse.is_surface);
        let moved = match self.change {
            Change::Position(bins) => bins * f64::from(cycle),
            _ => 0.0,
        };
        surfaces.map(move |pulse| pulse.position + moved)
    }

    /// A pixel before it.
    ///
    /// # Errors
    /// If a rate or an effect is out of its range.
    pub fn pixel(&self, rng: &mut Pcg64) -> Result<CasePixel> {
        let timing = Timing {
            bins: u16::try_from(BINS)?,
            bin_width_ps: 250.0,
            period: 400.0,
        };
        let mut parts = Vec::new();
        for (index, pulse) in self.pulses.iter().enumerate() {
            let rates = Rates {
                background: if index == 0 { self.background } else { 0.0 },
                signal: pulse.signal,
                position: pulse.position,
                sigma: SIGMA,
            };
            let (seed, address) = (rng.next_u64(), PixelAddress(0));
            let part = SimulatedPixel::new(&rates, timing.bins, pixel_rng(seed, address))?;
            parts.push((
                part.with_effects(&self.effects, &timing, seed, address)?,
                rates,
            ));
        }
        Ok(CasePixel {
            parts,
            change: self.change,
        })
    }
}

/// The photons of a scene: independent ones of each pulse, the first with the
/// background.
pub struct CasePixel {
    parts: Vec<(SimulatedPixel, Rates)>,
    change: Change,
}

impl CasePixel {
    /// Gives `photon` the TDC codes of laser cycle number `cycle`, from 1.
    ///
    /// # Errors
    /// If the change leaves a rate negative.
    pub fn next_cycle(&mut self, cycle: u32, mut photon: impl FnMut(u16)) -> Result<()> {
        for (part, rates) in &mut self.parts {
            match self.change {
                Change::Nothing => {}
                Change::Background(factor) if cycle == CHANGE + 1 => part.set_rates(&Rates {
                    background: rates.background * factor,
                    ..*rates
                })?,
                Change::Background(_) => {}
                Change::Position(bins) => part.set_rates(&Rates {
                    position: rates.position + bins * f64::from(cycle),
                    ..*rates
                })?,
            }
            part.next_cycle(&mut photon);
        }
        Ok(())
    }
}

/// All of them, in the order of the table.
///
/// # Errors
/// If a gate does not fit the bins.
pub fn cases() -> Result<Vec<Case>> {
    let mut cases = vec![Case::new("plain", "-")];
    for is_weak in [false, true] {
        for counts in BACKGROUNDS {
            let background = counts / f64::from(L1);
            let plain = if is_weak { WEAK } else { SIGNAL };
            let advice = match (counts > 100.0, is_weak) {
                (true, _) => {
                    "wider counters, or a rule that fires before they are full (82 laser cycles)"
                }
                (_, true) => "the window rule",
                _ => "nothing",
            };
            let mut case = Case::new(background_name(counts, is_weak), advice)
                .only(plain * (background / BACKGROUND).sqrt(), PLACE)
                .with_background(background);
            if counts > 100.0 {
                case.exposures = 2;
            }
            cases.push(case);
        }
    }
    let bright = "the centred window, a shorter L1, or leave out saturated events";
    let ends = "leave out clipped events, or shift the histogram";
    let echoes = "nothing: mostly the brighter surface is reported";
    cases.extend([
        Case::new("signal of 40 photons", "nothing").only(40.0, PLACE),
        Case::new("signal of 80 photons (the peak counter is full)", bright).only(80.0, PLACE),
        Case::new("signal of 400 photons (five counters are full)", bright).only(400.0, PLACE),
        Case::new("pulse on a bin edge", "nothing").only(SIGNAL, 80.0),
        Case::new("pulse between bins 31 and 32", "nothing").only(SIGNAL, 32.0),
        Case::new("pulse between bins 63 and 64", "nothing").only(SIGNAL, 64.0),
        Case::new("pulse at 0.3 bins", ends).only(SIGNAL, 0.3),
        Case::new("pulse at 127.7 bins", ends).only(SIGNAL, 127.7),
        Case::new("second echo 0.5, same half", echoes).and(0.5 * SIGNAL, 110.3),
        Case::new("second echo 1.5, same half", echoes).and(1.5 * SIGNAL, 110.3),
        Case::new("second echo 0.5, other half", echoes)
            .only(SIGNAL, 20.3)
            .and(0.5 * SIGNAL, PLACE),
        Case::new("second echo 1.5, other half", echoes)
            .only(SIGNAL, 20.3)
            .and(1.5 * SIGNAL, PLACE),
        Case::new("a pulse in each half", "nothing: either is reported").and(SIGNAL, 48.3),
        Case::new("a pulse in each quadrant", "the window rule, or a gate")
            .and(SIGNAL, 16.3)
            .and(SIGNAL, 48.3)
            .and(SIGNAL, 112.3),
        Case::new(
            "pulse tail of 30 bins, 40 %",
            "nothing: events take twice as long",
        )
        .with_effects(Effects {
            tail: Some(Tail {
                share: 0.4,
                decay_bins: 30.0,
            }),
            ..Effects::default()
        }),
    ]);
    let one_hit = Effects {
        tdc: Some(Tdc { hits_per_cycle: 1 }),
        ..Effects::default()
    };
    let background = |photons: f64| (photons - SIGNAL) / 128.0;
    let pile_up = "less light; at 2 photons the window rule or α = 8";
    cases.extend([
        Case::new("one hit, 2 photons a laser cycle", pile_up)
            .with_background(background(2.0))
            .with_effects(one_hit.clone()),
        Case::new("one hit, 6 photons a laser cycle", pile_up)
            .with_background(background(6.0))
            .with_effects(one_hit),
        Case::new("dead time 20 bins, 6 photons a laser cycle", "nothing")
            .with_background(background(6.0))
            .with_effects(Effects {
                dead_time: Some(DeadTime {
                    duration_ps: 5000.0,
                }),
                ..Effects::default()
            }),
        Case::new("hot pixel, 100 × background", "switch the pixel off")
            .with_background(100.0 * BACKGROUND),
        Case::new("cover glass 10 × the signal", "a gate").with_cover_glass(),
        Case {
            gate: RangeGate::new(10, 127)?,
            ..Case::new("cover glass 10 × the signal, gate from bin 10", "-").with_cover_glass()
        },
        Case::new("weak signal", "the window rule").only(WEAK, PLACE),
        Case::new("weak signal, background × 4 at 200", "the window rule")
            .only(WEAK, PLACE)
            .changing(Change::Background(4.0)),
        Case::new("weak signal, background / 4 at 200", "nothing")
            .only(WEAK, PLACE)
            .changing(Change::Background(0.25)),
        Case::new(
            "drift of 5 bins in 1000 laser cycles",
            "a rule that fires sooner",
        )
        .changing(Change::Position(0.005)),
        Case::new(
            "weak signal, the same drift",
            "more light, so that exposures are shorter",
        )
        .only(WEAK, PLACE)
        .changing(Change::Position(0.005)),
    ]);
    Ok(cases)
}
