//! How soon a pixel reports a surface that is suddenly there, and what it reports
//! of an exposure that saw two (section III-D).

use anyhow::Result;
use dtof_core::PixelAddress;
use rand_core::Rng;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;

use super::one_pixel::{CODES, FRAMES, PER_BIN, Reading, SENSORS, in_parts, prototype, watch};
use crate::chart::{self, Axis, Chart, Series, Style, line_chart};
use crate::simulation::{Rates, SimulatedPixel};
use crate::source::pixel_rng;
use crate::summary::grouped;
use crate::sweep::mean::{Measured, add, add_value};
use crate::sweep::results::{Claim, Figure, Results, Share, Verdict};
use crate::sweep::{Part, Point, PointTally, Study, Tally, point};

/// Steps of a trial.
const STEPS: u64 = 10;
/// Laser cycles after it in which it must be reported.
const AFTER: u64 = 6000;
/// Background photons a bin and laser cycle.
const BACKGROUND: f64 = 0.02;
/// The paper's bound of a false detection: half a bin from the surface.
const BELONGS: i64 = PER_BIN / 2;
/// A reading so near has noticed the new surface; others are false.
const NOTICED: i64 = 3 * PER_BIN;
/// Signal photons a laser cycle of the verdict, and its step in bins.
const SIGNAL: f64 = 0.5;
const EDGE: f64 = 20.0;
/// Of the brightest pixel and of the dimmest.
const BRIGHT: f64 = 2.0;
const DIM: f64 = 0.1;

/// Held against "reduces latency" and "no motion blur".
pub const STUDY: Study = Study {
    name: "depth-step",
    about: "laser cycles to notice a step in depth, and readings of both surfaces at once",
    revision: 1,
    few_seeds: 10,
    all_seeds: 300,
    points,
    trial,
    results,
};

/// Steps towards the sensor of 75 mm to 0.75 m.
fn points() -> Vec<Point> {
    let mut points = Vec::new();
    for step in [2.0, 4.0, EDGE] {
        for signal in [DIM, 0.2, SIGNAL, 1.0, BRIGHT] {
            points.push(point([("step", step), ("signal", signal)]));
        }
    }
    points
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let config = prototype(40)?;
    let mut tally = Tally::new();
    for _ in 0..STEPS {
        // A random place in a bin, and random phases of exposures and frames.
        let old = 60.0 + Uniform::new(0.0, 1.0)?.sample(rng);
        let new = old - point["step"];
        let at = 2000 + Uniform::new(0, 4000_u64)?.sample(rng);
        let mut phases = FRAMES;
        for phase in &mut phases {
            *phase = Uniform::new(0, *phase)?.sample(rng);
        }
        let rates = |position| Rates {
            background: BACKGROUND,
            signal: point["signal"],
            position,
            sigma: 1.0,
        };
        let mut pixel = SimulatedPixel::new(
            &rates(old),
            CODES,
            pixel_rng(rng.next_u64(), PixelAddress(0)),
        )?;
        let readings = watch(at + AFTER, &config, phases, |cycle, photon| {
            if cycle == at {
                pixel.set_rates(&rates(new))?;
            }
            pixel.next_cycle(photon);
            Ok(())
        })?;
        for (sensor, readings) in SENSORS.into_iter().zip(&readings) {
            add_step(
                &mut tally,
                sensor,
                readings,
                at,
                [in_parts(old), in_parts(new)],
            );
        }
    }
    Ok(tally)
}

/// What `readings` say of a step from `old` to `new` at the start of laser cycle
/// `at`.
fn add_step(tally: &mut Tally, sensor: &str, readings: &[Reading], at: u64, [old, new]: [i64; 2]) {
    let off = |reading: &Reading, surface: i64| (reading.position - surface).abs();
    let later = readings.iter().filter(|reading| reading.last >= at);
    let noticed = later
        .clone()
        .find(|reading| off(reading, new) < off(reading, old) && off(reading, new) <= NOTICED);
    match noticed {
        Some(reading) => {
            let cycles = i64::try_from(reading.last + 1 - at).unwrap_or(i64::MAX);
            add_value(tally, sensor, cycles);
        }
        None => add(tally, sensor, "not noticed", 1),
    }
    let neither =
        |reading: &Reading| u64::from(off(reading, old) > BELONGS && off(reading, new) > BELONGS);
    if let Some(mixed) = later.clone().find(|reading| reading.first < at) {
        add(tally, sensor, "mixed", 1);
        add(tally, sensor, "mixed, neither", neither(mixed));
    }
    if let Some(clean) = later.clone().find(|reading| reading.first >= at) {
        add(tally, sensor, "clean", 1);
        add(tally, sensor, "clean, neither", neither(clean));
    }
}

/// Of the exposures with both surfaces (`mixed`) or one (`clean`), those read as
/// neither.
fn neither(point: &PointTally, sensor: &str, exposures: &str) -> Share {
    point.share(
        &format!("{sensor} {exposures}, neither"),
        &format!("{sensor} {exposures}"),
    )
}

fn results(part: &Part) -> Result<Results> {
    let axis = |label, logarithmic| Axis {
        label,
        logarithmic,
        range: None,
    };
    let series = |step: f64, y: &dyn Fn(&PointTally, &str) -> Measured| {
        let sensors = SENSORS.into_iter().enumerate();
        let lines = sensors.map(|(colour, sensor)| Series {
            name: Some(sensor.to_owned()),
            colour,
            style: Style::JoinedDots,
            points: part
                .at([("step", step)])
                .map(|point| {
                    let measured = y(point, sensor);
                    chart::Point {
                        x: point.parameter("signal"),
                        y: measured.value,
                        interval: Some(measured.interval),
                    }
                })
                .collect(),
        });
        lines.collect::<Vec<_>>()
    };
    let x = Axis {
        range: Some((0.08, 8.0)),
        ..axis("signal photons a laser cycle", true)
    };
    let reaction = line_chart(&Chart {
        title: "From a step of 20 bins to the first reading of the new surface",
        x,
        y: axis("laser cycles, mean", true),
        series: series(EDGE, &Measured::mean),
    })?;
    let blur = line_chart(&Chart {
        title: "Exposures over a step of 2 bins that are read as neither surface",
        x,
        y: axis("share", false),
        series: series(2.0, &|point, sensor| {
            let Share { value, interval } = neither(point, sensor, "mixed");
            Measured { value, interval }
        }),
    })?;
    let steps = grouped(STEPS * part.seed_count());
    Ok(Results {
        figures: vec![
            Figure {
                name: "step-reaction",
                svg: reaction,
                caption: format!(
                    "Mean laser cycles from a step of 20 bins (0.75 m) to the end of the first reading nearer to the \
                     new surface (within 3 bins of it): events at α = 8, L1 = 40, X = 4, L2 = 2000, and frames of \
                     the same photons at a random phase; 0.02 background photons a bin and laser cycle. {steps} steps a \
                     dot; those that {AFTER} laser cycles did not bring are left out. Short frames of a dim pixel are mostly false: see the next figure"
                ),
            },
            Figure {
                name: "step-blur",
                svg: blur,
                caption: format!(
                    "Of the exposures in which the surface steps by 2 bins (75 mm), those read farther than half a bin \
                     from both ranges: blur, and the noise of the reading. The centre of mass sees three bins, so that \
                     surfaces farther apart do not mix. At most {steps} exposures a dot"
                ),
            },
        ],
        claims: claims(part)?,
        tables: Vec::new(),
    })
}

fn claims(part: &Part) -> Result<Vec<Claim>> {
    let edge = part.one([("step", EDGE), ("signal", SIGNAL)])?;
    let events = Measured::mean(edge, SENSORS[0]);
    let frames = SENSORS.map(|sensor| Measured::mean(edge, sensor));
    let bright = part.one([("step", EDGE), ("signal", BRIGHT)])?;
    // Than frames of L2, at every signal.
    let mut steps = part.at([("step", EDGE)]);
    let faster = steps.all(|point| {
        let [events, .., frames] = SENSORS.map(|sensor| Measured::mean(point, sensor));
        events.interval.1 < frames.interval.0
    });
    let dim = part.one([("step", EDGE), ("signal", DIM)])?;
    let small = part.one([("step", 2.0), ("signal", SIGNAL)])?;
    let percent = |share: Share| {
        let (low, high) = share.interval;
        format!(
            "{:.1} % ({:.1} to {:.1})",
            share.value * 100.0,
            low * 100.0,
            high * 100.0
        )
    };
    let [of_events, clean, of_frames] = [
        neither(edge, SENSORS[0], "mixed"),
        neither(edge, SENSORS[0], "clean"),
        neither(edge, SENSORS[4], "mixed"),
    ];
    let small_events = neither(small, SENSORS[0], "mixed");
    let small_frames = neither(small, SENSORS[4], "mixed");
    // Blur is what comes on top of the noise of an exposure of one surface.
    let sharp = of_events.interval.0 <= clean.interval.1;
    let small_sharp = small_events.interval.0 <= neither(small, SENSORS[0], "clean").interval.1;
    Ok(vec![
        Claim {
            claim: "asynchronous operation reduces latency (abstract, section V)",
            paper: "no number for a change in depth",
            here: format!(
                "a step is noticed after {} laser cycles; by frames of 100 after {:.0}, of 500 {:.0}, of 1000 {:.0}, of 2000 {:.0} (0.5 signal photons a laser cycle); events {} and frames of 100 {} at {BRIGHT} photons; events {} and frames of 2000 {} at {DIM}",
                events.text(0),
                frames[1].value,
                frames[2].value,
                frames[3].value,
                frames[4].value,
                Measured::mean(bright, SENSORS[0]).text(0),
                Measured::mean(bright, SENSORS[1]).text(0),
                Measured::mean(dim, SENSORS[0]).text(0),
                Measured::mean(dim, SENSORS[4]).text(0),
            ),
            verdict: match (faster, events.interval.1 < frames[4].interval.0) {
                (true, _) => Verdict::Agrees,
                (false, true) => Verdict::Differs,
                _ => Verdict::Refuted,
            },
            why: "against frames of L2: a bright pixel need not wait for the darkest; a dim one waits longer than a frame, as events ask for α = 8 where a frame takes any peak; frames as short as the exposures of events are as quick",
        },
        Claim {
            claim: "an edge that passes within an exposure does not blur (sections III-D, IV-C)",
            paper: "without motion blur",
            here: format!(
                "read as neither surface: step of 20 bins {} of mixed and {} of clean exposures, frames of 2000 {}; step of 2 bins {}, frames of 2000 {}",
                percent(of_events),
                percent(clean),
                percent(of_frames),
                percent(small_events),
                percent(small_frames)
            ),
            verdict: match (sharp, small_sharp) {
                (true, true) => Verdict::Agrees,
                (false, false) => Verdict::Refuted,
                _ => Verdict::Differs,
            },
            why: "a peak is of one surface or of the other if they lie farther apart than the centre of mass sees, for frames as well; surfaces two bins apart mix in every exposure that saw both",
        },
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One photon a laser cycle, in bin 40 and from laser cycle 1,010 on in bin 20.
    /// The exposure from 968 to 1,011 holds both; so do frames.
    #[test]
    fn the_step_is_noticed_when_its_photons_are_the_peak() {
        let readings = watch(5000, &prototype(40).unwrap(), [0; 4], |cycle, photon| {
            photon(if cycle < 1010 { 40 } else { 20 });
            Ok(())
        })
        .unwrap();
        let mut tally = Tally::new();
        for (sensor, readings) in SENSORS.into_iter().zip(&readings) {
            add_step(
                &mut tally,
                sensor,
                readings,
                1010,
                [in_parts(40.5), in_parts(20.5)],
            );
        }
        // Exposures of 44: 968 to 1011 reads the old surface, 1012 to 1055 the new.
        assert_eq!(tally["events above 0"], 46);
        assert_eq!(tally["events mixed, neither"], 0);
        // The frame up to 1099 has 90 of its 100 photons from the new surface.
        assert_eq!(tally["frames of 100 above 0"], 90);
        // That up to 1999 has 990 of 2,000: the next one is the first.
        assert_eq!(tally["frames of 2000 above 0"], 2990);
        assert_eq!(tally["frames of 2000 mixed"], 1);
    }

    #[test]
    fn a_reading_between_the_surfaces_is_neither() {
        let reading = |first, last, position| Reading {
            first,
            last,
            position,
        };
        let readings = [
            reading(0, 99, 0),
            reading(100, 199, 512),
            reading(200, 299, 1024),
        ];
        let mut tally = Tally::new();
        add_step(&mut tally, "frames", &readings, 150, [0, 1024]);
        assert_eq!(
            (tally["frames mixed"], tally["frames mixed, neither"]),
            (1, 1)
        );
        assert_eq!(
            (tally["frames clean"], tally["frames clean, neither"]),
            (1, 0)
        );
        assert_eq!(tally["frames above 0"], 150);
        let mut none = Tally::new();
        add_step(&mut none, "frames", &readings[..1], 150, [0, 1024]);
        assert_eq!(none["frames not noticed"], 1);
    }
}
