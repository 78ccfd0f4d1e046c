//! The scenes in which a method may fail. Each differs from the plain scene in one respect.

use anyhow::Result;
use dtof_core::RangeGate;
use dtof_engine::settings::DITHER_BINS;

use super::L1;
use super::case::{BACKGROUND, Case, PLACE, SIGNAL};
use super::rows::{self, Row};
use super::stray::StrayLight;
use dtof_light::effects::Effects;
use dtof_light::effects::cover_glass::CoverGlass;
use dtof_light::effects::tail::Tail;
use dtof_light::effects::tdc::Tdc;

/// A signal for which the window rule needs some 250 laser cycles.
const WEAK: f64 = 0.12;
/// The laser cycle at which the background changes: with a weak signal, and in the plain scene,
/// whose first look is after 44 laser cycles.
const CHANGE: u32 = 200;
const EARLY_CHANGE: u32 = 20;
/// Raindrops are seen up to this bin, 0.9 m away; a gate begins after the end of their pulses.
const RAIN_ENDS: f64 = 24.0;
const RAIN_GATE: u16 = 28;
/// A cover glass: signal and position.
const GLASS: (f64, f64) = (10.0 * SIGNAL, 3.5);
/// Background counts a bin after L1 laser cycles.
pub const BACKGROUNDS: [f64; 5] = [0.05, 0.5, 5.0, 50.0, 500.0];

/// The name of the case of a background, with the signal of the plain scene or a weak one.
#[must_use]
pub fn background_name(counts: f64, is_weak: bool) -> String {
    let weak = if is_weak { ", weak signal" } else { "" };
    format!("background {counts}{weak}")
}

/// All cases, in the order of the table.
///
/// # Errors
/// Fails if a gate does not fit the bins.
pub fn cases() -> Result<Vec<Case>> {
    let mut cases = vec![Case::new("plain"), Case::new("no target").without_target()];
    for is_weak in [false, true] {
        for counts in BACKGROUNDS {
            let background = counts / f64::from(L1);
            let plain = if is_weak { WEAK } else { SIGNAL };
            let row = match (is_weak, counts > 5.0, counts > 100.0) {
                (false, _, false) => rows::PLAIN,
                (false, _, true) => rows::MUCH_LIGHT,
                (true, false, _) => rows::WEAK,
                (true, true, false) => rows::WEAK_50,
                (true, true, true) => rows::WEAK_500,
            };
            let mut case = Case::new(background_name(counts, is_weak))
                .only(plain * (background / BACKGROUND).sqrt(), PLACE)
                .with_background(background)
                .in_row(row);
            if counts > 100.0 {
                // The background fills a counter in 82 laser cycles.
                case.exposures = 2;
            }
            cases.push(case);
        }
    }
    let shape = |name: &str| Case::new(name).in_row(rows::SHAPES);
    cases.extend([
        shape("signal of 40 photons").only(40.0, PLACE),
        shape("signal of 80 photons (the peak counter is full)").only(80.0, PLACE),
        shape("signal of 400 photons (five counters are full)")
            .only(400.0, PLACE)
            .in_row(rows::FULL),
        shape("pulse on a bin edge").only(SIGNAL, 80.0),
        shape("pulse between bins 31 and 32").only(SIGNAL, 32.0),
        shape("pulse between bins 63 and 64").only(SIGNAL, 64.0),
        Case::new("pulse at 0.3 bins")
            .only(SIGNAL, 0.3)
            .in_row(rows::ENDS),
        Case::new("pulse at 127.7 bins")
            .only(SIGNAL, 127.7)
            .in_row(rows::ENDS),
        shape("second echo 0.5, same half").and(0.5 * SIGNAL, 110.3),
        shape("second echo 1.5, same half").and(1.5 * SIGNAL, 110.3),
        shape("second echo 0.5, other half")
            .only(SIGNAL, 20.3)
            .and(0.5 * SIGNAL, PLACE),
        shape("second echo 1.5, other half")
            .only(SIGNAL, 20.3)
            .and(1.5 * SIGNAL, PLACE),
        shape("a pulse in each half").and(SIGNAL, 48.3),
        Case::new("a pulse in each quadrant")
            .and(SIGNAL, 16.3)
            .and(SIGNAL, 48.3)
            .and(SIGNAL, 112.3)
            .in_row(rows::QUADRANTS),
        shape("pulse tail of 30 bins, 40 %").with_effects(Effects {
            tail: Some(Tail {
                share: 0.4,
                decay_bins: 30.0,
            }),
            ..Effects::default()
        }),
    ]);
    cases.extend(pile_up()?);
    cases.extend([
        Case::new("hot pixel, 100 × background")
            .with_background(100.0 * BACKGROUND)
            .in_row(rows::HOT),
        Case::new("cover glass 10 × the signal")
            .behind(GLASS.0, GLASS.1)
            .in_row(rows::GLASS),
        Case::new("cover glass 10 × the signal, gate from bin 10")
            .behind(GLASS.0, GLASS.1)
            .gated(RangeGate::new(10, 127)?)
            .in_row(rows::GATE),
        Case::new("weak signal")
            .only(WEAK, PLACE)
            .in_row(rows::WEAK),
        Case::new("weak signal, background × 4 at 200")
            .only(WEAK, PLACE)
            .changing(4.0, CHANGE)
            .in_row(rows::WEAK_50),
        Case::new("weak signal, background / 4 at 200")
            .only(WEAK, PLACE)
            .changing(0.25, CHANGE)
            .in_row(rows::WEAK),
        Case::new("drift of 5 bins in 1000 laser cycles")
            .drifting(0.005)
            .in_row(rows::DRIFT),
        Case::new("weak signal, the same drift")
            .only(WEAK, PLACE)
            .drifting(0.005)
            .in_row(rows::WEAK_DRIFT),
    ]);
    cases.extend(weather()?);
    cases.extend(others());
    cases.extend(dead_times_one_bin_off()?);
    Ok(cases)
}

/// Rain, a veil, and sunlight that changes.
fn weather() -> Result<Vec<Case>> {
    let drops = |each, photons| StrayLight::Drops {
        each,
        photons,
        before: RAIN_ENDS,
    };
    // A net or a curtain is 20 bins in front of the surface, and smoke begins there. Neither is a
    // target: their events are false.
    let veil = PLACE - 20.0;
    let smoke = StrayLight::Smoke {
        photons: 2.0 * SIGNAL,
        from: veil,
        decay: 10.0,
    };
    let gated = RangeGate::new(RAIN_GATE, 127)?;
    Ok(vec![
        Case::new("rain, a drop of 3 photons each 20 laser cycles")
            .with_stray(drops(20.0, 3.0))
            .in_row(rows::SMALL_DROPS),
        Case::new("rain, a drop of 30 photons each 200 laser cycles")
            .with_stray(drops(200.0, 30.0))
            .in_row(rows::RAIN),
        Case::new("rain, a drop of 3 photons each 20 laser cycles, once per bin")
            .with_stray(drops(20.0, 3.0))
            .counting_once_per_bin()
            .in_row(rows::RAIN_ONCE),
        Case::new("rain, a drop of 30 photons each 200 laser cycles, once per bin")
            .with_stray(drops(200.0, 30.0))
            .counting_once_per_bin()
            .in_row(rows::RAIN_ONCE),
        Case::new("heavy rain, a drop of 30 photons each 50 laser cycles")
            .with_stray(drops(50.0, 30.0))
            .in_row(rows::RAIN),
        Case::new("heavy rain, a drop of 30 photons each 50 laser cycles, once per bin")
            .with_stray(drops(50.0, 30.0))
            .counting_once_per_bin()
            .in_row(rows::RAIN_ONCE),
        Case::new("weak signal, rain of 30 photons each 200 laser cycles")
            .only(WEAK, PLACE)
            .with_stray(drops(200.0, 30.0))
            .in_row(rows::RAIN),
        Case::new("weak signal, rain of 30 photons each 200 laser cycles, once per bin")
            .only(WEAK, PLACE)
            .with_stray(drops(200.0, 30.0))
            .counting_once_per_bin()
            .in_row(rows::RAIN_ONCE),
        Case::new("the same rain, gate from bin 28")
            .with_stray(drops(200.0, 30.0))
            .gated(gated)
            .in_row(rows::GATE),
        Case::new("veil of half the signal")
            .behind(0.5 * SIGNAL, veil)
            .in_row(rows::THIN),
        Case::new("veil of twice the signal")
            .behind(2.0 * SIGNAL, veil)
            .in_row(rows::VEIL),
        Case::new("smoke of twice the signal")
            .with_stray(smoke)
            .in_row(rows::THIN),
        Case::new("background × 4 at 20").changing(4.0, EARLY_CHANGE),
        Case::new("background / 4 at 20").changing(0.25, EARLY_CHANGE),
    ])
}

/// Another LiDAR. Clocks of the same rate differ by some 20 ppm, 0.008 bins a laser cycle. Different rates may
/// differ by any amount, here 1 %.
fn others() -> Vec<Case> {
    let mut cases = Vec::new();
    for (clock, step) in [
        ("of the same clock", 0.0),
        ("clock 20 ppm off", 0.008),
        ("rate 1 % off", 4.0),
    ] {
        for strength in [0.5, 1.0, 2.0, 4.0] {
            for has_target in [true, false] {
                for dither in [0, DITHER_BINS] {
                    cases.push(other((clock, step), strength, has_target, dither));
                }
            }
        }
    }
    // The remedy for what dither leaves.
    for strength in [2.0, 4.0] {
        for has_target in [true, false] {
            let clock = ("clock 20 ppm off", 0.008);
            let mut case = other(clock, strength, has_target, DITHER_BINS)
                .counting_once_per_bin()
                .in_row(rows::DITHER_ONCE);
            case.name += ", once per bin";
            cases.push(case);
        }
    }
    cases
}

/// Another LiDAR of a clock, which brings its pulse by so many bins later in each laser cycle.
fn other((clock, step): (&str, f64), strength: f64, has_target: bool, dither: u16) -> Case {
    let target = if has_target { "" } else { ", no target" };
    let dithered = match dither {
        0 => String::new(),
        range => format!(", dither of {range}"),
    };
    let name = format!("another LiDAR, {clock}, {strength} × the signal{target}{dithered}");
    let case = Case::new(name).with_stray(StrayLight::Laser {
        photons: strength * SIGNAL,
        step,
        dither,
    });
    let case = if has_target {
        case
    } else {
        case.without_target()
    };
    // At another rate the pulse never stays, with or without dither.
    let is_dim = strength < 1.0 && has_target;
    case.in_row(match (dither > 0, step > 1.0) {
        (true, _) => rows::DITHER,
        (_, true) => rows::OTHER_RATE,
        _ if is_dim => rows::DIM_LIDAR,
        _ => rows::LIDAR,
    })
}

/// Scenes with pile-up: photons that hide later ones. Pixels are set to the dead time of the TDC where the
/// name says so.
fn pile_up() -> Result<Vec<Case>> {
    let tdc = |tdc: Tdc| Effects {
        tdc: Some(tdc),
        ..Effects::default()
    };
    let one_hit = tdc(Tdc {
        hits_per_cycle: Some(1),
        dead_time_bins: None,
    });
    let dead_for = |bins| {
        tdc(Tdc {
            hits_per_cycle: None,
            dead_time_bins: Some(bins),
        })
    };
    let tdcs = [
        ("first photon only".to_owned(), one_hit.clone()),
        ("dead for 20 bins".to_owned(), dead_for(20)),
        ("dead for 5 bins".to_owned(), dead_for(5)),
    ];
    let background = |photons: f64| photons / 128.0;
    let mut cases = Vec::new();
    let one_hit_row = |is_many| {
        if is_many {
            rows::ONE_HIT
        } else {
            rows::FEW_PHOTONS
        }
    };
    for photons in [0.7, 1.5, 2.0] {
        let case = Case::new(format!("one hit, {photons} photons a laser cycle"))
            .with_background(background(photons - SIGNAL))
            .with_effects(one_hit.clone())
            .in_row(one_hit_row(photons > 1.5));
        cases.push(case.set_to_dead_time());
    }
    for photons in [0.7, 3.0] {
        let case = Case::new(format!("one hit, a pulse of {photons} photons alone"))
            .only(photons, PLACE)
            .with_background(0.001)
            .with_effects(one_hit.clone())
            .in_row(one_hit_row(photons > 1.0));
        cases.push(case.set_to_dead_time());
    }
    // Not set to the dead time, and set.
    let mut both = |case: Case, [row, row_if_set]: [Row; 2]| {
        cases.push(case.clone().in_row(row));
        let mut case = case.set_to_dead_time().in_row(row_if_set);
        case.name += ", set";
        cases.push(case);
    };
    let (few, first) = ([rows::FEW_PHOTONS; 2], [rows::FIRST, rows::FIRST_SET]);
    let (dead_20, dead_5) = ([rows::DEAD_20; 2], [rows::DEAD_5; 2]);
    let dead_20_12 = [rows::DEAD_20_12, rows::DEAD_20_12_SET];
    let dead_20_empty = [rows::DEAD_20_EMPTY, rows::DEAD_20_EMPTY_SET];
    let first_12 = [rows::FIRST, rows::FIRST_12_SET];
    let by_photons = [
        [few, first, first, first_12],
        [dead_20, dead_20, dead_20, dead_20_12],
        [dead_5; 4],
    ];
    for ((name, tdc), rows) in tdcs.iter().zip(by_photons) {
        for (photons, rows) in [1.0, 3.0, 6.0, 12.0].into_iter().zip(rows) {
            let plural = if photons > 1.0 { "s" } else { "" };
            let name = format!("{name}, {photons} photon{plural} a laser cycle");
            let case = Case::new(name).with_background(background(photons - SIGNAL));
            both(case.with_effects(tdc.clone()), rows);
        }
    }
    for ((name, tdc), rows) in tdcs.iter().zip([first, dead_20_empty, dead_5]) {
        let case = Case::new(format!("{name}, 6 photons, no target")).without_target();
        let case = case.with_background(background(6.0));
        both(case.with_effects(tdc.clone()), rows);
    }
    for ((name, tdc), rows) in tdcs.iter().zip([first, dead_20, dead_5]) {
        let name = format!("{name}, 6 photons, 2 of them crosstalk before the gate");
        let case = Case::new(name).with_background(background(4.0 - SIGNAL));
        let effects = Effects {
            cover_glass: Some(CoverGlass {
                signal: 2.0,
                position_bins: 3.5,
            }),
            ..tdc.clone()
        };
        let case = case.with_effects(effects).gated(RangeGate::new(8, 127)?);
        both(case, rows);
    }
    Ok(cases)
}

/// A TDC that is dead for 20 bins, with crosstalk before the gate and no target, and a setting one bin off.
fn dead_times_one_bin_off() -> Result<Vec<Case>> {
    let effects = Effects {
        tdc: Some(Tdc {
            hits_per_cycle: None,
            dead_time_bins: Some(20),
        }),
        cover_glass: Some(CoverGlass {
            signal: 2.0,
            position_bins: 3.5,
        }),
        ..Effects::default()
    };
    let cases = [19, 20, 21].map(|dead_time| {
        let name = "dead for 20 bins, 6 photons, 2 of them crosstalk before the gate, no target";
        let mut case = Case::new(format!("{name}, set to {dead_time}"));
        case.dead_time = dead_time;
        let case = case.without_target().with_background(4.0 / 128.0);
        let row = if dead_time > 20 {
            rows::CROSSTALK_21
        } else {
            rows::CROSSTALK
        };
        let gate = RangeGate::new(8, 127)?;
        Ok(case.with_effects(effects.clone()).gated(gate).in_row(row))
    });
    cases.into_iter().collect()
}
