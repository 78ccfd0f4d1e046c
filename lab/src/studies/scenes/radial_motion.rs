//! A surface that goes away and comes back: how far the depth reported lags behind
//! (section III-D, radial motion).

use super::one_pixel::{
    BIN_WIDTH_PS, CODES, PER_BIN, SENSORS, in_parts, pen, phases, prototype, watch,
};
use crate::sweep::mean::{Measured, add, add_value};
use crate::sweep::results::{Claim, Figure, Results, Verdict};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid};
use anyhow::Result;
use dtof::rows::grouped;
use dtof::simulate::{MM_PER_PS, SimulatedPixel};
use dtof_core::PixelAddress;
use dtof_draw::chart::{Axis, Chart, Key, Panel, Point as Dot, Series, Style};
use dtof_draw::palette::NEUTRAL;
use dtof_theory::random::pixel_rng;
use dtof_theory::rates::Rates;
use rand_core::Rng;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;

/// Runs of a trial, half of them away and half towards the sensor. Either begin
/// evenly spread over a bin: what the centre of mass errs by within a bin cancels,
/// and so does what it always errs by, as the lower of equal bins is the peak.
const RUNS: u32 = 20;
/// Laser cycles of a run.
const CYCLES: u64 = 8000;
/// Where it begins, about 2 m away.
const START: f64 = 50.0;
const MM_PER_BIN: f64 = BIN_WIDTH_PS * MM_PER_PS;
/// Readings farther off are false.
const FALSE: i64 = 8 * PER_BIN;
/// Of the verdict: laser rate in MHz and metres a second.
const PROTOTYPE_MHZ: f64 = 10.0;
const FAST: f64 = 10.0;

/// Held against "no motion blur".
pub const STUDY: Study = Study {
    name: "radial-motion",
    about: "how far the depth of a surface that goes away or comes nearer lags behind the truth",
    revision: 1,
    few_seeds: 10,
    all_seeds: 150,
    points,
    trial,
    results,
};

/// The laser rates of the paper's two systems.
fn points() -> Vec<Point> {
    grid([
        ("laser_rate_mhz", &[PROTOTYPE_MHZ, 1.2]),
        ("metres_per_second", &[0.1, 1.0, FAST, 100.0]),
    ])
}

/// Bins a laser cycle.
fn bins_per_cycle(point: &Point) -> f64 {
    point["metres_per_second"] / point["laser_rate_mhz"] / 1000.0 / MM_PER_BIN
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let config = prototype(40)?;
    let speed = bins_per_cycle(point);
    let mut tally = Tally::new();
    let shift = Uniform::new(0.0, 1.0)?.sample(rng);
    for run in 0..RUNS {
        let direction = if run % 2 == 0 { 1.0 } else { -1.0 };
        let start = START + (f64::from(run / 2) + shift) / f64::from(RUNS / 2);
        let speed = direction * speed;
        // The middle of a laser cycle stands for all of it.
        let rates = |cycle: u64| Rates {
            background: 0.02,
            signal: 0.5,
            position: start + speed * (cycle as f64 + 0.5),
            sigma: 1.0,
        };
        let phases = phases(rng)?;
        let photons = pixel_rng(rng.next_u64(), PixelAddress(0));
        let mut pixel = SimulatedPixel::new(&rates(0), CODES, photons)?;
        let readings = watch(CYCLES, &config, phases, |cycle, photon| {
            pixel.set_rates(&rates(cycle))?;
            pixel.next_cycle(photon);
            Ok(())
        })?;
        for (sensor, readings) in SENSORS.into_iter().zip(&readings) {
            for reading in readings {
                // At the end of the exposure.
                let truth = in_parts(start + speed * (reading.last + 1) as f64);
                let behind = truth - reading.position;
                let lag = if speed < 0.0 { -behind } else { behind };
                if lag.abs() > FALSE {
                    add(&mut tally, sensor, "false", 1);
                } else {
                    add_value(&mut tally, sensor, lag);
                    add(&mut tally, sensor, "cycles", reading.exposure());
                }
            }
        }
    }
    Ok(tally)
}

/// How a sensor fares at a point.
struct Lag {
    /// Behind the truth, in millimetres.
    mm: Measured,
    /// Standard deviation of a reading in millimetres.
    noise_mm: f64,
    /// What the surface goes in a mean exposure, in millimetres.
    path_mm: f64,
}

fn lag(point: &PointTally, sensor: &str) -> Lag {
    let count = |what: &str| point.count(&format!("{sensor} {what}")) as f64;
    let mean = Measured::mean(point, sensor);
    let part = MM_PER_BIN / PER_BIN as f64;
    let variance = count("squares") / count("values") - mean.value.powi(2);
    Lag {
        mm: mean.times(part),
        noise_mm: variance.sqrt() * part,
        path_mm: bins_per_cycle(&point.parameters) * MM_PER_BIN * count("cycles") / count("values"),
    }
}

fn at(part: &Part, laser_rate_mhz: f64, speed: f64) -> Result<&PointTally> {
    part.one([
        ("laser_rate_mhz", laser_rate_mhz),
        ("metres_per_second", speed),
    ])
}

fn figure(part: &Part, name: &'static str, laser_rate_mhz: f64) -> Result<Figure> {
    let mut series = Vec::new();
    for (number, sensor) in SENSORS.into_iter().enumerate() {
        let lags = part.at([("laser_rate_mhz", laser_rate_mhz)]);
        let lags = lags.map(|point| (point.parameter("metres_per_second"), lag(point, sensor)));
        let steps = f64::from(u32::try_from(number)?) - 2.0;
        let measured = lags.clone().map(|(x, lag)| {
            let dot = lag.mm.at(x);
            dot.aside(steps)
        });
        let half = lags.map(|(x, lag)| Dot::exact(x, lag.path_mm / 2.0));
        let pen = pen(number);
        series.push(Series::named(sensor, pen, Style::Dashed, half.collect()));
        series.push(Series::unnamed(pen, Style::Dots, measured.collect()));
    }
    let fastest = at(part, laser_rate_mhz, 100.0)?;
    let [events, frames] = [0, 4].map(|sensor| lag(fastest, SENSORS[sensor]).mm);
    let times = frames.value / events.value;
    let chart = Chart {
        finding: format!(
                "At {laser_rate_mhz} MHz events lag {times:.0} times less behind a moving surface than frames of 2000"
            ), holds: events.interval.1 * 10.0 < frames.interval.0,
        note: "Dots of one speed stand side by side. Bars hold 99 %; one that reaches the lower edge includes no lag at all.".to_owned(),
        x: Axis::logarithmic("speed, m/s").within(0.06, 150.0),
        y: Axis::logarithmic("lag of a reading at the end of its exposure, mm").within(1e-4, 200.0),
        key: vec![
            Key::new(NEUTRAL, Style::Dots, "simulated"),
            Key::new(NEUTRAL, Style::Dashed, "half of the path in a mean exposure"),
        ],
        columns: 1,
        panels: vec![Panel::only(series)],
    };
    Figure::new(name, &chart)
}

fn results(part: &Part) -> Result<Results> {
    let fast = at(part, PROTOTYPE_MHZ, FAST)?;
    let (event, frame) = (lag(fast, SENSORS[0]), lag(fast, SENSORS[4]));
    let slow_laser = at(part, 1.2, FAST)?;
    let (slow_event, slow_frame) = (lag(slow_laser, SENSORS[0]), lag(slow_laser, SENSORS[4]));
    Ok(Results {
        figures: vec![
            figure(part, "radial-lag", PROTOTYPE_MHZ)?,
            figure(part, "radial-lag-1.2-mhz", 1.2)?,
        ],
        claims: vec![Claim::new(
            "blur",
            format!(
                "at 10 m/s and 10 MHz {:.2} mm within an event's exposure (noise of an event {:.1} mm), {:.1} mm within a frame of 2000 (noise {:.1} mm); at 1.2 MHz {:.1} and {:.0} mm; lag at 10 MHz {} and {} mm; at 10 MHz an event smears as much as it is noisy at {:.0} m/s, a frame of 2000 at {:.0} m/s",
                event.path_mm,
                event.noise_mm,
                frame.path_mm,
                frame.noise_mm,
                slow_event.path_mm,
                slow_frame.path_mm,
                event.mm.text(2),
                frame.mm.text(2),
                FAST * event.noise_mm / event.path_mm,
                FAST * frame.noise_mm / frame.path_mm,
            ),
            Verdict::of(event.path_mm < event.noise_mm && slow_event.path_mm < slow_event.noise_mm),
        )],
        values: [("runs", grouped(u64::from(RUNS) * part.seed_count()))].into(),
        ..Results::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::point;
    use rand_core::SeedableRng;

    /// Frames have a known exposure, and so a known lag.
    #[test]
    fn frames_lag_by_half_of_their_exposure() {
        let parameters = point([("laser_rate_mhz", 1.2), ("metres_per_second", 100.0)]);
        let mut tally = Tally::new();
        for seed in 0..20 {
            for (name, count) in trial(&parameters, &mut Pcg64::seed_from_u64(seed)).unwrap() {
                *tally.entry(name).or_default() += count;
            }
        }
        let point = PointTally { parameters, tally };
        for (sensor, length) in SENSORS[1..].iter().zip([100.0, 500.0]) {
            let lag = lag(&point, sensor);
            // 100 m/s are 83.3 µm a laser cycle.
            assert!((lag.path_mm - length / 12.0).abs() < 1e-6);
            let (low, high) = lag.mm.interval;
            assert!(
                (low..=high).contains(&(lag.path_mm / 2.0)),
                "{sensor}: {low} to {high}"
            );
        }
    }
}
