//! The scenes in which a method may fail. Each differs from the plain one in one
//! thing.

use anyhow::Result;
use dtof_core::{PixelAddress, RangeGate};
use rand_core::Rng;
use rand_pcg::Pcg64;

use super::{BINS, L1, SIGMA};
use dtof::simulate::SimulatedPixel;
use dtof::simulate::effects::Effects;
use dtof::simulate::effects::dead_time::DeadTime;
use dtof::simulate::effects::limits::Timing;
use dtof::simulate::effects::tail::Tail;
use dtof::simulate::effects::tdc::Tdc;
use dtof_theory::random::pixel_rng;
use dtof_theory::rates::Rates;

/// Of the plain scene: background photons a bin and laser cycle, signal photons a
/// laser cycle, and where they lie.
pub(super) const BACKGROUND: f64 = 0.05;
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

/// A scene.
#[derive(Clone, Debug)]
pub struct Case {
    /// What is special about it.
    pub name: String,
    /// Against its failures; not measured.
    pub advice: Option<&'static str>,
    /// Why no flag tells wrong events, where none does.
    pub silence: Option<&'static str>,
    /// What may hold the peak.
    pub gate: RangeGate<BINS>,
    /// Exposures of a trial.
    pub exposures: u64,
    background: f64,
    pulses: Vec<Pulse>,
    effects: Effects,
    /// By what the background is multiplied after [`CHANGE`] laser cycles.
    change: f64,
    /// Bins that the surfaces go in a laser cycle.
    drift: f64,
}

impl Case {
    fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            advice: None,
            silence: None,
            gate: RangeGate::full(),
            exposures: 10,
            background: BACKGROUND,
            pulses: Vec::new(),
            effects: Effects::default(),
            change: 1.0,
            drift: 0.0,
        }
        .and(SIGNAL, PLACE)
    }

    fn advised(mut self, advice: &'static str) -> Self {
        self.advice = Some(advice);
        self
    }

    fn silent_as(mut self, silence: &'static str) -> Self {
        self.silence = Some(silence);
        self
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

    fn changing(mut self, change: f64) -> Self {
        self.change = change;
        self
    }

    fn drifting(mut self, drift: f64) -> Self {
        self.drift = drift;
        self
    }

    /// Whether its TDC takes one hit a laser cycle, which pixels are told.
    #[must_use]
    pub fn is_one_hit(&self) -> bool {
        self.effects.one_hit_tdc()
    }

    /// Where the surfaces lie at the end of laser cycle number `cycle` of an
    /// exposure, in bins from the start of bin 0.
    pub fn surfaces(&self, cycle: u32) -> impl Iterator<Item = f64> {
        let surfaces = self.pulses.iter().filter(|pulse| pulse.is_surface);
        let moved = self.drift * f64::from(cycle);
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
            drift: self.drift,
        })
    }
}

/// The photons of a scene: independent ones of each pulse, the first with the
/// background.
pub struct CasePixel {
    parts: Vec<(SimulatedPixel, Rates)>,
    change: f64,
    drift: f64,
}

impl CasePixel {
    /// Gives `photon` the TDC codes of laser cycle number `cycle`, from 1.
    ///
    /// # Errors
    /// If the change leaves a rate negative.
    pub fn next_cycle(&mut self, cycle: u32, mut photon: impl FnMut(u16)) -> Result<()> {
        for (part, rates) in &mut self.parts {
            let factor = if cycle > CHANGE { self.change } else { 1.0 };
            part.set_rates(&Rates {
                background: rates.background * factor,
                position: rates.position + self.drift * f64::from(cycle),
                ..*rates
            })?;
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
    let mut cases = vec![Case::new("plain"), Case::new("no target").only(0.0, PLACE)];
    cases[1].pulses[0].is_surface = false;
    for is_weak in [false, true] {
        for counts in BACKGROUNDS {
            let background = counts / f64::from(L1);
            let plain = if is_weak { WEAK } else { SIGNAL };
            let mut case = Case::new(background_name(counts, is_weak))
                .only(plain * (background / BACKGROUND).sqrt(), PLACE)
                .with_background(background);
            if counts > 100.0 {
                // 82 laser cycles fill a counter of background.
                case = case.advised("wider counters, or a rule that fires before they are full");
                case.exposures = 2;
            }
            cases.push(case);
        }
    }
    let bright = "a shorter L1; leave out saturated events";
    let ends = "leave out clipped events, or shift the histogram";
    cases.extend([
        Case::new("signal of 40 photons").only(40.0, PLACE),
        Case::new("signal of 80 photons (the peak counter is full)")
            .only(80.0, PLACE)
            .advised(bright),
        Case::new("signal of 400 photons (five counters are full)")
            .only(400.0, PLACE)
            .advised(bright),
        Case::new("pulse on a bin edge").only(SIGNAL, 80.0),
        Case::new("pulse between bins 31 and 32").only(SIGNAL, 32.0),
        Case::new("pulse between bins 63 and 64").only(SIGNAL, 64.0),
        Case::new("pulse at 0.3 bins")
            .only(SIGNAL, 0.3)
            .advised(ends),
        Case::new("pulse at 127.7 bins")
            .only(SIGNAL, 127.7)
            .advised(ends),
        Case::new("second echo 0.5, same half").and(0.5 * SIGNAL, 110.3),
        Case::new("second echo 1.5, same half").and(1.5 * SIGNAL, 110.3),
        Case::new("second echo 0.5, other half")
            .only(SIGNAL, 20.3)
            .and(0.5 * SIGNAL, PLACE),
        Case::new("second echo 1.5, other half")
            .only(SIGNAL, 20.3)
            .and(1.5 * SIGNAL, PLACE),
        Case::new("a pulse in each half").and(SIGNAL, 48.3),
        Case::new("a pulse in each quadrant")
            .and(SIGNAL, 16.3)
            .and(SIGNAL, 48.3)
            .and(SIGNAL, 112.3)
            .advised("a gate, if one of them is known"),
        Case::new("pulse tail of 30 bins, 40 %").with_effects(Effects {
            tail: Some(Tail {
                share: 0.4,
                decay_bins: 30.0,
            }),
            ..Effects::default()
        }),
    ]);
    cases.extend(pile_up());
    let glass = "The histogram is that of a bright target at 3.5 bins before another one. A gate needs to know of the glass";
    let moved = "The histogram is that of a still target, where it was on average. The event tells its exposure";
    let smeared = "In 390 laser cycles, the window's, the target goes 2 bins. That widens the pulse from σ 1 to 1.15, and \
                   its 47 signal photons tell the width to 10 % at best. No test of the width is built";
    let hot = "The threshold lets one exposure in 100 bring a false alarm, and hardly any brings another event. That events \
               are so rare tells, no single histogram does";
    cases.extend([
        Case::new("hot pixel, 100 × background")
            .with_background(100.0 * BACKGROUND)
            .advised("switch the pixel off")
            .silent_as(hot),
        Case::new("cover glass 10 × the signal")
            .with_cover_glass()
            .advised("a gate: see the next row")
            .silent_as(glass),
        Case {
            gate: RangeGate::new(10, 127)?,
            ..Case::new("cover glass 10 × the signal, gate from bin 10").with_cover_glass()
        },
        Case::new("weak signal").only(WEAK, PLACE),
        Case::new("weak signal, background × 4 at 200")
            .only(WEAK, PLACE)
            .changing(4.0),
        Case::new("weak signal, background / 4 at 200")
            .only(WEAK, PLACE)
            .changing(0.25),
        Case::new("drift of 5 bins in 1000 laser cycles")
            .drifting(0.005)
            .advised("a rule that fires sooner")
            .silent_as(moved),
        Case::new("weak signal, the same drift")
            .only(WEAK, PLACE)
            .drifting(0.005)
            .advised("more light or a shorter L2, so that exposures are shorter")
            .silent_as(smeared),
    ]);
    Ok(cases)
}

/// Scenes in which photons hide each other.
fn pile_up() -> Vec<Case> {
    let one_hit = Effects {
        tdc: Some(Tdc { hits_per_cycle: 1 }),
        ..Effects::default()
    };
    let background = |photons: f64| (photons - SIGNAL) / 128.0;
    let mut cases = Vec::new();
    for photons in [0.7, 1.5, 2.0, 6.0] {
        let case = Case::new(format!("one hit, {photons} photons a laser cycle"))
            .with_background(background(photons))
            .with_effects(one_hit.clone());
        cases.push(if photons > 1.0 {
            case.advised("less light")
        } else {
            case
        });
    }
    for photons in [0.7, 3.0] {
        cases.push(
            Case::new(format!("one hit, a pulse of {photons} photons alone"))
                .only(photons, PLACE)
                .with_background(0.001)
                .with_effects(one_hit.clone()),
        );
    }
    cases.push(
        Case::new("dead time 20 bins, 6 photons a laser cycle")
            .with_background(background(6.0))
            .with_effects(Effects {
                dead_time: Some(DeadTime {
                    duration_ps: 5000.0,
                }),
                ..Effects::default()
            }),
    );
    cases
}
