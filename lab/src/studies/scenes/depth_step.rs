//! How soon a pixel reports a surface that appears suddenly, and what it reports for an exposure
//! that saw two surfaces.
//!
//! With the FPGA's settings. The first is compared with "reduces latency" (abstract). The second is
//! our own question: the paper does not mention a step within an exposure.

use super::mixed::{self, add_pair, excess, is_sharp, neither};
use super::one_pixel::{
    CODES, PER_BIN, Reading, SENSORS, in_parts, pen, phases, prototype, watch_step,
};
use super::systems::{FPGA, FPGA_SIGMAS, L1};
use crate::sweep::mean::{Measured, add, add_value};
use crate::sweep::results::{Claim, Figure, Results, Verdict};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid};
use anyhow::Result;
use dtof_core::PixelAddress;
use dtof_data::options::rows::grouped;
use dtof_data::random::pixel_rng;
use dtof_draw::chart::{Axis, Chart, Panel, Series, Style};
use dtof_light::SimulatedPixel;
use dtof_light::rates::Rates;
use rand_core::Rng;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;

/// Steps of a trial.
const STEPS: u64 = 10;
/// Laser cycles after a step within which it must be reported.
const AFTER: u64 = 6000;
/// Laser cycles after a step until every exposure across it has ended: L2, the longest frame.
const OVER: u64 = 2000;
/// The largest distance of a reading that counts as the new surface.
const NOTICED: i64 = 3 * PER_BIN;
/// The pulse of the figures, with jitter.
const SIGMA: f64 = FPGA_SIGMAS[1];
/// For the verdict: signal photons a laser cycle, and the step in bins.
const SIGNAL: f64 = 0.5;
const EDGE: f64 = 20.0;
/// The steps, in bins.
const STEPS_BINS: [f64; 3] = [2.0, 4.0, EDGE];
/// The share of blurred exposures in the title of a figure.
const LITTLE: f64 = 0.05;
/// A claim agrees if it holds over a range of signals of this factor.
const RANGE: f64 = 5.0;
/// Signal of the brightest and of the dimmest pixel.
const BRIGHT: f64 = 2.0;
const DIM: f64 = 0.05;
const SIGNALS: [f64; 6] = [DIM, 0.1, 0.2, SIGNAL, 1.0, BRIGHT];

/// Compared with "reduces latency".
pub const STUDY: Study = Study {
    name: "depth-step",
    about: "laser cycles to notice a step in depth, and readings of both surfaces at once",
    revision: 3,
    few_seeds: 8,
    all_seeds: 150,
    points,
    trial,
    results,
};

/// Steps towards the sensor of 75 mm to 0.75 m.
fn points() -> Vec<Point> {
    grid([
        ("sigma", &FPGA_SIGMAS),
        ("step", &STEPS_BINS),
        ("signal", &SIGNALS),
    ])
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let config = prototype(L1)?;
    let mut tally = Tally::new();
    for _ in 0..STEPS {
        // A random place in a bin, and random phases of exposures and frames.
        let old = 60.0 + Uniform::new(0.0, 1.0)?.sample(rng);
        let new = old - point["step"];
        let at = 2000 + Uniform::new(0, 4000_u64)?.sample(rng);
        let phases = phases(rng)?;
        let rates = |position| Rates {
            background: FPGA.background,
            signal: point["signal"],
            position,
            sigma: point["sigma"],
        };
        let photons = pixel_rng(rng.next_u64(), PixelAddress::new(0));
        let pixel = SimulatedPixel::new(&rates(old), CODES, photons)?;
        let readings =
            |later, cycles| watch_step(&pixel, &config, &rates(later), at, cycles, phases);
        let (with, without) = (readings(new, at + AFTER)?, readings(old, at + OVER)?);
        let surfaces = [in_parts(old), in_parts(new)];
        for ((sensor, with), without) in SENSORS.into_iter().zip(&with).zip(&without) {
            add_step(&mut tally, sensor, with, at, surfaces);
            add_pair(&mut tally, sensor, [with, without], at, &surfaces);
        }
    }
    Ok(tally)
}

/// Adds the time until `readings` show a step from `old` to `new` at the start of laser cycle `at`.
/// A step that is not noticed counts as [`AFTER`] laser cycles, and separately.
fn add_step(tally: &mut Tally, sensor: &str, readings: &[Reading], at: u64, [old, new]: [i64; 2]) {
    let off = |reading: &Reading, surface: i64| (reading.position - surface).abs();
    let later = readings.iter().filter(|reading| reading.last >= at);
    let noticed = later
        .into_iter()
        .find(|reading| off(reading, new) < off(reading, old) && off(reading, new) <= NOTICED);
    let cycles = noticed.map_or(AFTER, |reading| reading.last + 1 - at);
    add_value(tally, sensor, i64::try_from(cycles).unwrap_or(i64::MAX));
    add(tally, sensor, "not noticed", noticed.is_none().into());
}

fn results(part: &Part) -> Result<Results> {
    let by_signal = |step: f64, y: &dyn Fn(&PointTally, &str) -> Measured| {
        let at = [("sigma", SIGMA), ("step", step)];
        let sensors = SENSORS.into_iter().enumerate();
        let series = sensors.map(|(number, sensor)| {
            let dots = part.dots(at, "signal", |point| y(point, sensor));
            Series::named(sensor, pen(number), Style::JoinedDots, dots)
        });
        Panel::only(series.collect())
    };
    let signal = || Axis::logarithmic("signal photons a laser cycle");
    let [events, frames] = [0, 4].map(|sensor| {
        [BRIGHT, DIM].map(|signal| Measured::mean(edge(part, signal), SENSORS[sensor]))
    });
    let reaction = Chart {
        finding: format!(
            "A bright pixel reports a step after {:.0} laser cycles, a dim one no sooner than a long frame",
            events[0].value
        ),
        holds: events[0].interval.1 < frames[0].interval.0 / 10.0
            && events[1].interval.1 > frames[1].interval.0,
        note: format!(
            "Bars hold 99 %. A step not noticed in {} laser cycles counts as that many. Short frames of dim pixels are mostly false alarms.",
            grouped(AFTER)
        ),
        x: signal(),
        y: Axis::logarithmic("laser cycles from a step of 0.75 m to its first reading, mean"),
        key: Vec::new(),
        columns: 1,
        panels: vec![by_signal(EDGE, &Measured::mean)],
    };
    let blurs_little = |point: &PointTally| {
        let mut sensors = SENSORS.into_iter();
        sensors.all(|sensor| excess(point, sensor).interval.1 < LITTLE)
    };
    // Signals with enough photons for right readings without a step.
    let bright = |point: &&PointTally| point.parameter("signal") >= SIGNAL;
    let mut nearest = part.at([("step", STEPS_BINS[0])]).filter(bright);
    let blur = Chart {
        finding: format!(
            "From {SIGNAL} signal photons on, a step of two bins blurs less than 5 % of exposures"
        ),
        holds: nearest.all(blurs_little),
        note:
            "Bars hold 99 %. Short frames of dim pixels are mostly false alarms, without a step as well."
                .to_owned(),
        x: signal(),
        y: Axis::linear("exposures over a step of 75 mm that read as neither surface, %").percent(),
        key: Vec::new(),
        columns: 1,
        panels: vec![by_signal(STEPS_BINS[0], &|point, sensor| {
            neither(point, sensor, "mixed")
        })],
    };
    Ok(Results {
        figures: vec![
            Figure::new("step-reaction", &reaction)?,
            Figure::new("step-blur", &blur)?,
        ],
        claims: vec![latency_claim(part), blur_claim(part)],
        values: [("steps", grouped(STEPS * part.seed_count()))].into(),
        ..Results::default()
    })
}

/// The point of the step of the verdict.
fn edge(part: &Part, signal: f64) -> &PointTally {
    part.one([("sigma", SIGMA), ("step", EDGE), ("signal", signal)])
}

/// The count `what` at every signal of a step, from dim to bright.
fn at_signals(part: &Part, step: f64, what: &str) -> String {
    let counts = part
        .at([("sigma", SIGMA), ("step", step)])
        .map(|point| grouped(point.count(what)));
    counts.collect::<Vec<_>>().join(", ")
}

fn latency_claim(part: &Part) -> Claim {
    let of = |signal| SENSORS.map(|sensor| Measured::mean(edge(part, signal), sensor));
    let [bright, middle, dim] = [BRIGHT, SIGNAL, DIM].map(of);
    // The signal from which events are faster than frames of L2, with both pulses.
    let is_faster = |signal: f64| {
        let mut points = part.at([("step", EDGE), ("signal", signal)]);
        points.all(|point| {
            let [events, .., frames] = SENSORS.map(|sensor| Measured::mean(point, sensor));
            events.interval.1 < frames.interval.0
        })
    };
    let brightest_first = SIGNALS.into_iter().rev();
    let from = brightest_first.take_while(|&at| is_faster(at)).last();
    Claim::new(
        "latency",
        format!(
            "sooner than by frames of 2000 {}; a step is noticed after {:.0} laser cycles, by frames of 2000 after {:.0} \
             ({SIGNAL} photons a laser cycle); after {:.0} and {:.0} at {DIM}",
            from.map_or("at no signal".to_owned(), |from| format!(
                "from {from} photons on"
            )),
            middle[0].value,
            middle[4].value,
            dim[0].value,
            dim[4].value,
        ),
        Verdict::graded(
            from.is_some_and(|from| BRIGHT >= RANGE * from),
            from.is_some(),
        ),
    )
    .with_details(format!(
            "a step is noticed after {} laser cycles; by frames of 100 after {:.0}, of 500 {:.0}, of 1000 {:.0}, of 2000 {:.0} ({SIGNAL} signal photons a laser cycle); events {} and frames of 100 {} at {BRIGHT} photons; events {} and frames of 2000 {} at {DIM}; not noticed in {AFTER} laser cycles, and counted as {AFTER}: at 0.05, 0.1, 0.2, 0.5, 1, 2 photons {} of {} by events, {} by frames of 100, {} by frames of 2000",
            middle[0].text(0),
            middle[1].value,
            middle[2].value,
            middle[3].value,
            middle[4].value,
            bright[0].text(0),
            bright[1].text(0),
            dim[0].text(0),
            dim[4].text(0),
            at_signals(part, EDGE, "events not noticed"),
            grouped(STEPS * part.seed_count()),
            at_signals(part, EDGE, "frames of 100 not noticed"),
            at_signals(part, EDGE, "frames of 2000 not noticed"),
        ))
}

fn blur_claim(part: &Part) -> Claim {
    let mut details = Vec::new();
    let mut verdicts = Vec::new();
    for sigma in FPGA_SIGMAS {
        for step in STEPS_BINS {
            let points = part.at([("sigma", sigma), ("step", step)]);
            let excesses = |sensor| points.clone().map(move |point| excess(point, sensor));
            verdicts.push(is_sharp(&excesses(SENSORS[0]).collect::<Vec<_>>()));
            let texts = excesses(SENSORS[0]).map(mixed::points);
            let frames = mixed::worst(excesses(SENSORS[4])).map_or(String::new(), mixed::points);
            details.push(format!(
                "σ {sigma}, step of {step} bins {}, worst of frames of 2000 {frames}",
                texts.collect::<Vec<_>>().join(", "),
            ));
        }
    }
    let worst = STEPS_BINS.map(|step| {
        let points = part.at([("step", step)]);
        let worst = mixed::worst(points.map(|point| excess(point, SENSORS[0])));
        worst.map_or("none".to_owned(), mixed::points)
    });
    let is = |verdict| verdicts.iter().filter(|&&other| other == verdict).count();
    Claim::new(
        "blur",
        format!(
            "more often read as neither surface than without the step, percentage points at worst, for steps of {} bins: {}",
            STEPS_BINS.map(|step| step.to_string()).join(", "),
            worst.join(", ")
        ),
        match (is(Verdict::Agrees), is(Verdict::Refuted)) {
            (agrees, _) if agrees == verdicts.len() => Verdict::Agrees,
            (_, refuted) if refuted == verdicts.len() => Verdict::Refuted,
            (1.., _) => Verdict::Differs,
            _ => Verdict::NotDecided,
        },
    )
    .with_details(format!(
            "percentage points by which an event over the step is read as neither surface more often than the same exposure without it, at 0.05, 0.1, 0.2, 0.5, 1, 2 signal photons a laser cycle: {}",
            details.join("; ")
        ))
}

#[cfg(test)]
mod tests {
    use super::super::one_pixel::{prototype, watch};
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
            let surfaces = [40.5, 20.5].map(in_parts);
            add_step(&mut tally, sensor, readings, 1010, surfaces);
        }
        // Exposures of 44: 968 to 1011 reads the old surface, 1012 to 1055 the new.
        assert_eq!(tally["events above 0"], 46);
        // The frame up to 1099 has 90 of its 100 photons from the new surface.
        assert_eq!(tally["frames of 100 above 0"], 90);
        // That up to 1999 has 990 of 2,000: the next one is the first.
        assert_eq!(tally["frames of 2000 above 0"], 2990);
    }

    #[test]
    fn a_step_that_is_not_noticed_counts_as_the_time_it_had() {
        let readings = [Reading {
            first: 100,
            last: 199,
            position: 512,
        }];
        let mut tally = Tally::new();
        add_step(&mut tally, "frames", &readings, 150, [0, 1024]);
        assert_eq!(tally["frames not noticed"], 1);
        assert_eq!(
            (tally["frames values"], tally["frames above 0"]),
            (1, AFTER)
        );
    }
}
