//! A surface that moves away or closer: the lag of the reported depth (section III-D, radial
//! motion, on the PC; here also on the FPGA).
//!
//! The paper gives neither speed nor brightness; both are our choices, with several values.

use super::one_pixel::{PER_BIN, SENSORS, in_parts, pen, phases, watch};
use super::systems::{FPGA, L1, PC, PULSES, System};
use crate::sweep::mean::{Measured, add, add_value};
use crate::sweep::results::{Claim, Figure, Results, Verdict, span};
use crate::sweep::{Part, Point, PointTally, Study, Tally, Trial, grid};
use anyhow::Result;
use dtof_core::PixelAddress;
use dtof_data::options::rows::grouped;
use dtof_data::random::pixel_rng;
use dtof_draw::chart::{Axis, Chart, Key, Panel, Point as Dot, Series, Style};
use dtof_draw::palette::NEUTRAL;
use dtof_light::SimulatedPixel;
use dtof_light::rates::Rates;
use rand_core::Rng;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;

/// Runs of a trial, half of them away from and half towards the sensor. Both halves begin at
/// positions evenly spread over a bin, so that the bias of the centre of mass within a bin cancels,
/// as does its constant bias from the lower of equal bins.
const RUNS: u32 = 20;
/// Laser cycles of a run.
const CYCLES: u64 = 8000;
/// The start in bins: 3.3 m into the window of the PC, 1.9 m in front of the FPGA.
const START: [f64; 2] = [2.5, 50.0];
/// The largest error of a reading that is not false.
const FALSE: i64 = 2 * PER_BIN;
/// For the verdict: metres a second, and signal photons a laser cycle.
const FAST: f64 = 10.0;
const SIGNALS: [f64; 3] = [0.2, SIGNAL, 2.0];
const SIGNAL: f64 = 0.5;
/// Compared with "the depth of the peak events follows the programmed motion".
pub const STUDY: Study = Study {
    name: "radial-motion",
    about: "how far the depth of a surface that goes away or comes nearer lags behind the truth",
    revision: 2,
    few_seeds: 4,
    all_seeds: 60,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    let of_system = |(fpga, sigma)| {
        grid([
            ("fpga", &[fpga]),
            ("sigma", &[sigma]),
            ("signal", &SIGNALS),
            ("metres_per_second", &[0.1, 1.0, FAST, 100.0]),
        ])
    };
    PULSES.into_iter().flat_map(of_system).collect()
}

/// Bins a laser cycle.
fn bins_per_cycle(point: &Point) -> f64 {
    let system = System::of(point);
    point["metres_per_second"] / system.laser_rate_mhz / 1000.0 / system.mm_per_bin()
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    System::of(point).choose::<Trial>(trial_with_bins::<8>, trial_with_bins::<128>)(point, rng)
}

fn trial_with_bins<const BINS: usize>(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let system = System::of(point);
    let config = system.settings(system.by, L1, 0).config::<BINS>()?;
    let speed = bins_per_cycle(point);
    let mut tally = Tally::new();
    let shift = Uniform::new(0.0, 1.0)?.sample(rng);
    for run in 0..RUNS {
        let direction = if run % 2 == 0 { 1.0 } else { -1.0 };
        let start =
            START[usize::from(system == FPGA)] + (f64::from(run / 2) + shift) / f64::from(RUNS / 2);
        let speed = direction * speed;
        // The position in the middle of the laser cycle.
        let rates = |cycle: u64| Rates {
            background: system.background,
            signal: point["signal"],
            position: start + speed * (cycle as f64 + 0.5),
            sigma: point["sigma"],
        };
        let phases = phases(rng)?;
        let photons = pixel_rng(rng.next_u64(), PixelAddress::new(0));
        let mut pixel = SimulatedPixel::new(&rates(0), system.bins, photons)?;
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

/// The lag of a sensor at a point.
struct Lag {
    /// The lag behind the truth, in millimetres.
    mm: Measured,
    /// Standard deviation of a reading in millimetres.
    noise_mm: f64,
    /// The path of the surface in a mean exposure, in millimetres.
    path_mm: f64,
}

fn lag(point: &PointTally, sensor: &str) -> Lag {
    let count = |what: &str| point.count(&format!("{sensor} {what}")) as f64;
    let mean = Measured::mean(point, sensor);
    let mm_per_bin = System::of(&point.parameters).mm_per_bin();
    let part = mm_per_bin / PER_BIN as f64;
    let variance = count("squares") / count("values") - mean.value.powi(2);
    Lag {
        mm: mean.times(part),
        noise_mm: variance.sqrt() * part,
        path_mm: bins_per_cycle(&point.parameters) * mm_per_bin * count("cycles") / count("values"),
    }
}

fn at(part: &Part, (fpga, sigma): (f64, f64), signal: f64, speed: f64) -> &PointTally {
    part.one([
        ("fpga", fpga),
        ("sigma", sigma),
        ("signal", signal),
        ("metres_per_second", speed),
    ])
}

fn figure(part: &Part, name: &'static str, pulse: (f64, f64)) -> Result<Figure> {
    let mut series = Vec::new();
    for (number, sensor) in SENSORS.into_iter().enumerate() {
        let (fpga, sigma) = pulse;
        let lags = part.at([("fpga", fpga), ("sigma", sigma), ("signal", SIGNAL)]);
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
    let fastest = at(part, pulse, SIGNAL, 100.0);
    let system = System::of(&fastest.parameters).name;
    let [events, frames] = [0, 4].map(|sensor| lag(fastest, SENSORS[sensor]).mm);
    let times = frames.value / events.value;
    let chart = Chart {
        finding: format!(
            "On the {system}, events lag {times:.0} times less behind a moving surface than frames of 2000"
        ),
        holds: events.interval.1 * 10.0 < frames.interval.0,
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
    let (mut here, mut details) = (Vec::new(), Vec::new());
    let mut verdicts = Vec::new();
    for pulse in PULSES {
        let mut texts = Vec::new();
        let mut follows = true;
        let mut shares = Vec::new();
        for signal in SIGNALS {
            let fast = at(part, pulse, signal, FAST);
            let [event, frame] = [0, 4].map(|sensor| lag(fast, SENSORS[sensor]));
            follows &= event.path_mm < event.noise_mm;
            shares.push(100.0 * event.path_mm / event.noise_mm);
            texts.push(format!(
                "{signal} photons {:.2} mm in an event's exposure (noise {:.1} mm, as much at {:.0} m/s), \
                 {:.1} mm in a frame of 2000 (noise {:.1} mm, as much at {:.0} m/s)",
                event.path_mm,
                event.noise_mm,
                FAST * event.noise_mm / event.path_mm,
                frame.path_mm,
                frame.noise_mm,
                FAST * frame.noise_mm / frame.path_mm,
            ));
        }
        let system = if pulse.0 > 0.0 { FPGA } else { PC };
        let system = system.with_pulse(pulse.1);
        here.push(format!("{system}: {}", span(shares, 1)));
        details.push(format!("{system}: {}", texts.join("; ")));
        verdicts.push(follows);
    }
    Ok(Results {
        figures: vec![
            figure(part, "radial-lag", PULSES[0])?,
            figure(part, "radial-lag-fpga", PULSES[2])?,
        ],
        claims: vec![
            Claim::new(
                "blur",
                format!(
                    "path in an event's exposure, % of its noise, at 10 m/s: {}",
                    here.join("; ")
                ),
                Verdict::graded(verdicts.iter().all(|&follows| follows), verdicts[0]),
            )
            .with_details(format!("at 10 m/s; {}", details.join("; "))),
        ],
        values: [("runs", grouped(u64::from(RUNS) * part.seed_count()))].into(),
        ..Results::default()
    })
}

#[cfg(test)]
mod tests {
    use super::super::systems::FPGA_SIGMAS;
    use super::*;
    use crate::sweep::point;
    use rand_core::SeedableRng;

    /// Frames have a fixed exposure, and so a known lag.
    #[test]
    fn frames_lag_by_half_of_their_exposure() {
        let parameters = point([
            ("fpga", 1.0),
            ("sigma", FPGA_SIGMAS[1]),
            ("signal", 0.5),
            ("metres_per_second", 100.0),
        ]);
        let mut tally = Tally::new();
        for seed in 0..20 {
            for (name, count) in trial(&parameters, &mut Pcg64::seed_from_u64(seed)).unwrap() {
                *tally.entry(name).or_default() += count;
            }
        }
        let point = PointTally { parameters, tally };
        for (sensor, length) in SENSORS[1..].iter().zip([100.0, 500.0]) {
            let lag = lag(&point, sensor);
            // 100 m/s are 10 µm a laser cycle.
            assert!((lag.path_mm - length / 100.0).abs() < 1e-6);
            let (low, high) = lag.mm.interval;
            assert!(
                (low..=high).contains(&(lag.path_mm / 2.0)),
                "{sensor}: {low} to {high}"
            );
        }
    }
}
