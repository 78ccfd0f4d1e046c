//! Another LiDAR whose clock is nearly the same, and the dither of the own laser against it.

use crate::studies::failures::case::{BACKGROUND, Case, SIGNAL};
use crate::studies::failures::stray::StrayLight;
use crate::studies::failures::{BINS, FALSE, Method, Rule};
use crate::studies::scenes::one_pixel::in_parts;
use crate::sweep::charts::{joined, joined_key, level, level_key, panel};
use crate::sweep::mean::{Measured, add, add_value};
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, Point, Study, Tally, point, whole};
use anyhow::Result;
use dtof_core::{LaserCycle, Look, OncePerBin, Statistics};
use dtof_data::options::rows::grouped;
use dtof_draw::chart::{Axis, Chart, Panel};
use dtof_draw::palette::{Pen, STEPS};
use dtof_engine::settings::DITHER_BINS;
use rand_pcg::Pcg64;
use std::fmt::Write as _;

/// Ranges of the dither in bins; 0 is none.
pub const RANGES: [f64; 6] = [0.0, 16.0, 32.0, 64.0, DEFAULT, 254.0];
/// The default of a device.
pub const DEFAULT: f64 = DITHER_BINS as f64;
/// Photons of the other LiDAR's pulse, over those of the target's.
pub const STRENGTHS: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// No other LiDAR. A TDC code counts from the own pulse on, so the dither then changes no photon.
const ABSENT: f64 = 0.0;
/// Bins by which the other's pulse comes later in each laser cycle: 20 ppm of 400 bins.
const STEP: f64 = 0.008;
/// The most wrong events with a target if a dither suffices.
pub const MOST_WRONG: f64 = 0.002;
/// The most exposures with an event without a target if a dither suffices.
pub const MOST_FALSE: f64 = 0.015;
/// The false alarms that z is for.
const REQUESTED: f64 = 0.01;

/// The photons that a pixel counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counted {
    /// All.
    All,
    /// Those of one laser cycle in one bin once.
    OncePerBin,
    /// The first of a laser cycle; the pixel is set to the dead time of such a TDC.
    First,
}

impl Counted {
    /// Its name in tables and tallies.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::OncePerBin => "once per bin",
            Self::First => "first",
        }
    }
}

/// A scene, beside the other LiDAR.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scene {
    /// The target of the plain scene.
    Target,
    /// No target.
    Empty,
    /// No target, and a tenth of the background.
    Dark,
    /// No target, and a hundredth of the background.
    VeryDark,
    /// The target in half of the background, seen by a TDC that takes the first photon only.
    FirstPhoton,
    /// The same without the target.
    FirstPhotonEmpty,
    /// No target, and the other's clock is exactly the same.
    EqualClock,
}

impl Scene {
    const ALL: [Self; 7] = [
        Self::Target,
        Self::Empty,
        Self::Dark,
        Self::VeryDark,
        Self::FirstPhoton,
        Self::FirstPhotonEmpty,
        Self::EqualClock,
    ];

    const fn name(self) -> &'static str {
        match self {
            Self::Target => "target",
            Self::Empty => "no target",
            Self::Dark => "no target, a tenth of the background",
            Self::VeryDark => "no target, a hundredth of the background",
            Self::FirstPhoton => "target, first photon only",
            Self::FirstPhotonEmpty => "no target, first photon only",
            Self::EqualClock => "no target, exactly the same clock",
        }
    }

    /// Its place in [`Self::ALL`].
    fn number(self) -> f64 {
        f64::from(self as u8)
    }

    const fn has_target(self) -> bool {
        matches!(self, Self::Target | Self::FirstPhoton)
    }

    fn background(self) -> f64 {
        match self {
            Self::Target | Self::Empty | Self::EqualClock => BACKGROUND,
            Self::Dark => BACKGROUND / 10.0,
            Self::VeryDark => BACKGROUND / 100.0,
            Self::FirstPhoton | Self::FirstPhotonEmpty => BACKGROUND / 2.0,
        }
    }

    /// The pixels, which see the same photons.
    const fn counted(self) -> &'static [Counted] {
        match self {
            Self::FirstPhoton | Self::FirstPhotonEmpty => &[Counted::First],
            _ => &[Counted::All, Counted::OncePerBin],
        }
    }

    /// Exposures of a trial. Without a target they are long.
    const fn exposures(self) -> u64 {
        if self.has_target() { 200 } else { 60 }
    }

    fn case(self, strength: f64, range: u16) -> Case {
        let case = Case::new(self.name()).with_background(self.background());
        let case = if self.has_target() {
            case
        } else {
            case.without_target()
        };
        if strength == ABSENT {
            return case;
        }
        case.with_stray(StrayLight::Laser {
            photons: strength * SIGNAL,
            step: if self == Self::EqualClock { 0.0 } else { STEP },
            dither: range,
        })
    }
}

/// Another LiDAR over the range of the dither.
pub const STUDY: Study = Study {
    name: "dither",
    about: "wrong events and false alarms next to another LiDAR, over the range of the dither",
    revision: 2,
    few_seeds: 4,
    all_seeds: 200,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    let mut points = Vec::new();
    for scene in Scene::ALL {
        let at = |strength, range| {
            point([
                ("scene", scene.number()),
                ("strength", strength),
                ("range", range),
            ])
        };
        points.push(at(ABSENT, 0.0));
        for strength in STRENGTHS {
            points.extend(RANGES.map(|range| at(strength, range)));
        }
    }
    points
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let scene = Scene::ALL[usize::from(whole(point, "scene"))];
    let case = scene.case(point["strength"], whole(point, "range"));
    let mut tally = Tally::from([("exposures".to_owned(), scene.exposures())]);
    for _ in 0..scene.exposures() {
        exposure(&case, scene.counted(), rng, &mut tally)?;
    }
    Ok(tally)
}

/// One exposure of the same photons for all pixels; each ends it on its own.
fn exposure(case: &Case, counted: &[Counted], rng: &mut Pcg64, tally: &mut Tally) -> Result<()> {
    let mut photons = case.pixel(rng)?;
    let method = Method {
        rule: Rule::Window,
        is_centred: true,
    };
    let pixel = |&counted: &Counted| {
        let mut case = case.clone();
        if counted == Counted::First {
            case.dead_time = u16::try_from(BINS)?;
        }
        let (config, pixel) = method.pixel(&case)?;
        Ok((counted, config, pixel))
    };
    let mut waiting = counted.iter().map(pixel).collect::<Result<Vec<_>>>()?;
    let mut codes = Vec::new();
    let mut cycle = 0;
    while !waiting.is_empty() {
        cycle += 1;
        codes.clear();
        photons.next_cycle(cycle, |code| codes.push(code))?;
        waiting.retain_mut(|(counted, config, pixel)| {
            let statistics = &mut Statistics::new();
            match counted {
                Counted::All => pixel.count_batch(config, &codes),
                Counted::OncePerBin => {
                    let bins = &mut OncePerBin::<{ BINS / 32 }>::new();
                    pixel.count_once_per_bin(config, statistics, bins, &codes);
                }
                Counted::First => pixel.count_batch(config, codes.iter().copied().min().as_slice()),
            }
            let now = LaserCycle::new(cycle.into());
            let look = pixel.end_laser_cycle(config, statistics, now);
            if let Some(event) = pixel.take_event() {
                let position = i64::from(event.position().raw());
                let is_far = |surface| (position - in_parts(surface)).abs() > FALSE;
                let is_wrong = case.surfaces(cycle).all(is_far);
                add_value(tally, counted.name(), cycle.into());
                add(tally, counted.name(), "wrong", is_wrong.into());
            }
            !matches!(look, Look::Event | Look::Expired)
        });
    }
    Ok(())
}

/// The events of a pixel in a scene.
#[derive(Clone, Copy, Debug)]
pub struct DitherOutcome {
    /// With a target the share of wrong events. Without one every event is wrong: the share of exposures that
    /// end with an event.
    pub wrong: Measured,
    /// Mean laser cycles to an event; NaN without events.
    pub cycles: Measured,
    exposures: u64,
}

/// The outcome next to a LiDAR of this strength, with a dither of this range.
#[must_use]
pub fn outcome(
    part: &Part,
    scene: Scene,
    counted: Counted,
    strength: f64,
    range: f64,
) -> DitherOutcome {
    let point = part.one([
        ("scene", scene.number()),
        ("strength", strength),
        ("range", range),
    ]);
    let name = counted.name();
    let trials = if scene.has_target() {
        format!("{name} values")
    } else {
        "exposures".to_owned()
    };
    DitherOutcome {
        wrong: point.share(&format!("{name} wrong"), &trials),
        cycles: Measured::mean(point, name),
        exposures: point.count("exposures"),
    }
}

/// The outcome without another LiDAR.
#[must_use]
pub fn undisturbed(part: &Part, scene: Scene, counted: Counted) -> DitherOutcome {
    outcome(part, scene, counted, ABSENT, 0.0)
}

/// The smallest range with surely at most [`MOST_WRONG`] next to a target and at most [`MOST_FALSE`] in the scene
/// `empty` without one: the intervals end there. `None` if no range is large enough.
#[must_use]
pub fn least_range(part: &Part, empty: Scene, counted: Counted, strength: f64) -> Option<f64> {
    let most = |scene, range| {
        outcome(part, scene, counted, strength, range)
            .wrong
            .interval
            .1
    };
    let suffices =
        |&range: &f64| most(Scene::Target, range) <= MOST_WRONG && most(empty, range) <= MOST_FALSE;
    RANGES.into_iter().find(suffices)
}

/// Panels, row by row.
const PANELS: [(Scene, Counted, &str); 6] = [
    (Scene::Target, Counted::All, "target: wrong events"),
    (Scene::Empty, Counted::All, "no target: false alarms"),
    (Scene::Dark, Counted::All, "the same, background / 10"),
    (Scene::Dark, Counted::OncePerBin, "… and once per bin"),
    (
        Scene::FirstPhoton,
        Counted::First,
        "first photon only, target",
    ),
    (
        Scene::FirstPhotonEmpty,
        Counted::First,
        "first photon only, no target",
    ),
];
/// Panels of the laser cycles to an event.
const TIMES: [(Scene, Counted, &str); 2] = [
    (Scene::Target, Counted::All, "all photons"),
    (Scene::FirstPhoton, Counted::First, "first photon only"),
];
const PENS: [Pen; 4] = [STEPS[0], STEPS[1], STEPS[2], STEPS[3]];

/// A panel: a curve for each strength, and a line to compare with.
fn strengths(
    part: &Part,
    (scene, counted, title): (Scene, Counted, &str),
    reference: f64,
    of: fn(DitherOutcome) -> Measured,
) -> Panel {
    let mut series = vec![level(&[0.0, 254.0], reference)];
    for (strength, pen) in STRENGTHS.into_iter().zip(PENS) {
        let dot = |range| of(outcome(part, scene, counted, strength, range)).at(range);
        series.push(joined(pen, RANGES.map(dot)));
    }
    panel(title, series)
}

/// A chart of such panels.
fn chart(finding: String, holds: bool, y: Axis, reference: &str, panels: Vec<Panel>) -> Chart {
    let strengths = STRENGTHS.into_iter().zip(PENS);
    let strengths = strengths.map(|(strength, pen)| joined_key(pen, format!("{strength} ×")));
    Chart {
        finding,
        holds,
        note: format!(
            "Key: photons of the other LiDAR's pulse over the target's {SIGNAL}. Its clock is 20 ppm off. Bars hold \
             99 %. Background {BACKGROUND} a bin and laser cycle; half of it for the first photon only."
        ),
        x: Axis::linear("range of the dither, bins"),
        y,
        key: strengths.chain([level_key(reference)]).collect(),
        columns: 2,
        panels,
    }
}

fn results(part: &Part) -> Result<Results> {
    let wrong = |shown| strengths(part, shown, REQUESTED, |outcome| outcome.wrong);
    let as_bright = |scene| {
        let outcome = outcome(part, scene, Counted::All, 1.0, DEFAULT);
        outcome.wrong.interval
    };
    let wrong = chart(
        format!("{DEFAULT} bins hide an equal LiDAR, not in the dark"),
        as_bright(Scene::Target).1 <= MOST_WRONG
            && as_bright(Scene::Empty).1 <= MOST_FALSE
            && as_bright(Scene::Dark).0 > MOST_FALSE,
        Axis::logarithmic("events or exposures, %")
            .percent()
            .within(2e-5, 1.0),
        "1 %, as requested",
        PANELS.map(wrong).into(),
    );
    let alone = |scene, counted| undisturbed(part, scene, counted).cycles.value;
    let cycles = |shown: (Scene, Counted, &str)| {
        let alone = alone(shown.0, shown.1);
        strengths(part, shown, alone, |outcome| outcome.cycles)
    };
    let slower = |scene, counted| {
        let cycles = outcome(part, scene, counted, 2.0, DEFAULT).cycles.value;
        cycles / alone(scene, counted)
    };
    let times = chart(
        "A TDC of the first photon loses more time".to_owned(),
        slower(Scene::FirstPhoton, Counted::First) > slower(Scene::Target, Counted::All),
        Axis::linear("laser cycles an event"),
        "without the other",
        TIMES.map(cycles).into(),
    );
    let exposures = |scene: Scene| grouped(undisturbed(part, scene, scene.counted()[0]).exposures);
    Ok(Results {
        figures: vec![
            Figure::new("dither", &wrong)?,
            Figure::new("dither-time", &times)?,
        ],
        values: [
            ("exposures", exposures(Scene::Target)),
            ("empty exposures", exposures(Scene::Empty)),
        ]
        .into(),
        tables: vec![("results/data/dither.csv", csv(part)?)],
        ..Results::default()
    })
}

fn csv(part: &Part) -> Result<String> {
    let mut csv = "scene,counted,strength,range,exposures,wrong,wrong_low,wrong_high,cycles,cycles_low,cycles_high\n"
        .to_owned();
    for scene in Scene::ALL {
        for &counted in scene.counted() {
            for point in part.at([("scene", scene.number())]) {
                let [strength, range] = ["strength", "range"].map(|name| point.parameter(name));
                let outcome = outcome(part, scene, counted, strength, range);
                writeln!(
                    csv,
                    "\"{}\",{},{strength},{range},{},{},{}",
                    scene.name(),
                    counted.name(),
                    outcome.exposures,
                    outcome.wrong.cells(5),
                    outcome.cycles.cells(2),
                )?;
            }
        }
    }
    Ok(csv)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::run_seeds;
    use rand_core::SeedableRng;

    /// Of 200 events, 29 % are wrong without a dither and 0.03 % with the default.
    #[test]
    fn a_pulse_that_stays_is_a_target_and_one_that_wanders_is_not() {
        let wrong = |range| {
            let scene = Scene::Target.number();
            let point = point([("scene", scene), ("strength", 2.0), ("range", range)]);
            trial(&point, &mut Pcg64::seed_from_u64(1)).unwrap()["all wrong"]
        };
        assert!((30..90).contains(&wrong(0.0)), "{}", wrong(0.0));
        assert!(wrong(DEFAULT) <= 2, "{}", wrong(DEFAULT));
    }

    /// Of 10,000, at most 20 with a target and 150 without one, less 2.6 standard deviations.
    #[test]
    fn the_least_range_has_surely_few_wrong_events_in_both_scenes() {
        fn made_up(point: &Point, _: &mut Pcg64) -> Result<Tally> {
            let wrong = match (whole(point, "scene"), whole(point, "range")) {
                (0, ..=16) => 15,
                (0, _) => 8,
                (1, ..=32) => 130,
                (1, _) => 110,
                _ => 130,
            };
            Ok(Tally::from([
                ("exposures".to_owned(), 10_000),
                ("all values".to_owned(), 10_000),
                ("all wrong".to_owned(), wrong),
            ]))
        }
        let study = Study {
            trial: made_up,
            ..STUDY
        };
        let part = run_seeds(&study, 0..1).unwrap();
        let least = |empty| least_range(&part, empty, Counted::All, 1.0);
        assert_eq!(least(Scene::Empty), Some(64.0));
        assert_eq!(least(Scene::Dark), None);
    }
}
