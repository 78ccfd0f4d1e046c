//! A surface that goes away and comes back: how far the depth reported lags behind
//! (section III-D, radial motion).

use anyhow::Result;
use dtof_core::PixelAddress;
use rand_core::Rng;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;

use super::one_pixel::{BIN_WIDTH_PS, CODES, FRAMES, PER_BIN, SENSORS, in_parts, prototype, watch};
use crate::sweep::mean::{Measured, add, add_value};
use crate::sweep::results::{Claim, Figure, Results, Verdict};
use crate::sweep::{Part, Point, PointTally, Study, Tally, point};
use dtof::chart::{self, Axis, Chart, Series, Style, line_chart};
use dtof::rows::grouped;
use dtof::simulate::{MM_PER_PS, SimulatedPixel};
use dtof_theory::random::pixel_rng;
use dtof_theory::rates::Rates;

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
    let mut points = Vec::new();
    for laser_rate_mhz in [PROTOTYPE_MHZ, 1.2] {
        for speed in [0.1, 1.0, FAST, 100.0] {
            points.push(point([
                ("laser_rate_mhz", laser_rate_mhz),
                ("metres_per_second", speed),
            ]));
        }
    }
    points
}

/// Bins a laser cycle.
fn bins_per_cycle(point: &Point) -> f64 {
    point["metres_per_second"] / point["laser_rate_mhz"] / 1000.0 / MM_PER_BIN
}

#[allow(clippy::cast_precision_loss, reason = "some thousand laser cycles")]
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
        let mut phases = FRAMES;
        for phase in &mut phases {
            *phase = Uniform::new(0, *phase)?.sample(rng);
        }
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

#[allow(clippy::cast_precision_loss, reason = "far fewer than 2^52")]
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

fn figure(part: &Part, name: &'static str, laser_rate_mhz: f64) -> Result<Figure> {
    let mut series = Vec::new();
    for (colour, sensor) in SENSORS.into_iter().enumerate() {
        let lags = part.at([("laser_rate_mhz", laser_rate_mhz)]);
        let lags = lags.map(|point| (point.parameter("metres_per_second"), lag(point, sensor)));
        let measured = lags.clone().map(|(x, lag)| chart::Point {
            x,
            y: lag.mm.value,
            interval: Some(lag.mm.interval),
        });
        series.push(Series {
            name: Some(sensor.to_owned()),
            colour,
            style: Style::Dots,
            points: measured.collect(),
        });
        series.push(Series {
            name: None,
            colour,
            style: Style::Thin,
            points: lags
                .map(|(x, lag)| chart::Point::exact(x, lag.path_mm / 2.0))
                .collect(),
        });
    }
    let title =
        format!("Lag behind a surface that goes away or comes nearer, {laser_rate_mhz} MHz");
    let svg = line_chart(&Chart {
        title: &title,
        x: Axis::logarithmic("speed, m/s"),
        y: Axis {
            label: "how far the reading is behind at the end of the exposure, mm",
            logarithmic: true,
            range: Some((1e-4, 200.0)),
        },
        series,
    })?;
    let readings = part.one([("laser_rate_mhz", laser_rate_mhz)])?;
    let count = |sensor: &str| grouped(readings.count(&format!("{sensor} values")));
    Ok(Figure {
        name,
        svg,
        caption: format!(
            "How far the depth reported lags behind a surface that goes away or comes nearer, at α = 8, L1 = 40, X = 4, L2 = 2000, \
             {laser_rate_mhz} MHz, 0.5 signal photons a laser cycle and 0.02 background photons a bin; lines: half of \
             what the surface goes in a mean exposure. Means of {} events to {} frames of 2000 a dot; where the \
             interval reaches the lower edge the lag is too small to be seen, and a mean below the axis is not drawn",
            count(SENSORS[0]),
            count(SENSORS[4]),
        ),
    })
}

fn results(part: &Part) -> Result<Results> {
    let at = |laser_rate_mhz, speed| {
        part.one([
            ("laser_rate_mhz", laser_rate_mhz),
            ("metres_per_second", speed),
        ])
    };
    let fast = at(PROTOTYPE_MHZ, FAST)?;
    let (event, frame) = (lag(fast, SENSORS[0]), lag(fast, SENSORS[4]));
    let slow_laser = at(1.2, FAST)?;
    let (slow_event, slow_frame) = (lag(slow_laser, SENSORS[0]), lag(slow_laser, SENSORS[4]));
    Ok(Results {
        figures: vec![
            figure(part, "radial-lag", PROTOTYPE_MHZ)?,
            figure(part, "radial-lag-1.2-mhz", 1.2)?,
        ],
        claims: vec![Claim {
            claim: "radial motion at α = 8, L1 = 40 without motion blur (section III-D)",
            paper: "depth follows the car",
            here: format!(
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
            verdict: Verdict::of(
                event.path_mm < event.noise_mm && slow_event.path_mm < slow_event.noise_mm,
            ),
            why: "agrees if an event's exposure smears less than the event is noisy; the lag is half of what the surface goes in an exposure; at speeds of indoor objects and 10 MHz frames do not smear beyond their noise either",
        }],
        tables: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
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
