//! A fan at 120 rpm: how many exposures contain an edge, and what they report (transverse motion:
//! section III-D on the PC, section IV-C on the FPGA).
//!
//! The paper gives the 120 rpm in section IV-C. Distances and brightness are ours.

use super::mixed::{self, add_pair, excess, is_sharp, neither};
use super::one_pixel::{SENSORS, in_parts, phases, watch, watch_step};
use super::systems::{FPGA, L1, PC, PULSES, System};
use crate::sweep::mean::{Measured, add};
use crate::sweep::results::{Claim, Figure, Results, Verdict, span};
use crate::sweep::{Part, Point, PointTally, Study, Tally, Trial, point};
use anyhow::{Result, bail, ensure};
use dtof_core::{AnyRule, PixelAddress, PixelConfig};
use dtof_data::options::rows::grouped;
use dtof_data::random::pixel_rng;
use dtof_draw::chart::{Axis, Chart, Key, Panel, Point as Dot, Series, Style};
use dtof_draw::palette::{NEUTRAL, STEPS};
use dtof_light::SimulatedPixel;
use dtof_light::scene::{Brightness, Fan, Scene, Shape};
use rand_core::Rng;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// Column and row of the pixels, near the tips of the blades.
const PIXELS: [(u16, u16); 8] = [
    (1, 7),
    (14, 8),
    (8, 1),
    (7, 14),
    (3, 3),
    (12, 3),
    (3, 12),
    (12, 12),
];
/// Laser cycles of a trial. Every pixel starts at its own random angle of the fan, so readings of
/// different pixels are independent.
const CYCLES: u64 = 100_000;
/// Edges of a pixel that are simulated separately, each at its own angle.
const EDGES: u32 = 4;
/// Laser cycles after an edge until every exposure across it has ended: L2, the longest frame.
const OVER: u64 = 2000;
/// Bins between the start of the PC's window and the nearest surface.
const BEFORE: f64 = 2.0;
/// The rotation is visible if at least this share of events is nearer to the surface seen than to
/// the other one.
const VISIBLE: f64 = 0.95;

/// Compared with "clearly visible" (PC) and "without motion blur" (FPGA).
pub const STUDY: Study = Study {
    name: "fan-motion",
    about: "exposures that an edge of a fan at 120 rpm passes, and what they report",
    revision: 3,
    few_seeds: 8,
    all_seeds: 200,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    let of_system = |(fpga, sigma)| point([("fpga", fpga), ("sigma", sigma)]);
    PULSES.map(of_system).into()
}

/// The scene of the file, moved away by `shift` bins at equal brightness.
fn scene(point: &Point, shift: f64) -> Result<Scene> {
    let system = System::of(point);
    let text = include_str!("../../../../scenes/fan.toml");
    let mut scene = system.scene(text, point["sigma"])?;
    let before = if system == PC { BEFORE } else { 0.0 };
    let shift_mm = (before + shift) * scene.mm_per_bin();
    for surface in &mut scene.surfaces {
        if let Brightness::Reflectivity(share) = surface.light {
            let metres = surface.range_mm / 1000.0;
            surface.light = Brightness::Signal(scene.signal_at_one_metre * share / metres.powi(2));
        }
        surface.range_mm += shift_mm;
        surface.range_right_mm += shift_mm;
    }
    Ok(scene)
}

/// The fan of the scene.
fn fan(scene: &Scene) -> Result<&Fan> {
    for surface in &scene.surfaces {
        if let Shape::Fan(fan) = &surface.shape {
            return Ok(fan);
        }
    }
    bail!("the scene has no fan")
}

/// Edges that pass a point in a laser cycle.
fn edges_per_cycle(scene: &Scene) -> Result<f64> {
    let fan = fan(scene)?;
    Ok(2.0 * f64::from(fan.blades) * fan.rpm / 60.0 / (scene.laser_rate_mhz * 1e6))
}

/// Columns that the tip of a blade moves in a laser cycle.
fn tip_per_cycle(scene: &Scene) -> Result<f64> {
    let fan = fan(scene)?;
    Ok(TAU * fan.radius * fan.rpm / 60.0 / (scene.laser_rate_mhz * 1e6))
}

/// Laser cycles of a turn to the next blade.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "rounded down"
)]
fn period(scene: &Scene) -> Result<u64> {
    Ok((2.0 / edges_per_cycle(scene)?) as u64)
}

/// The first laser cycle after `from` in which the pixel sees another surface than
/// in the one before.
fn next_edge(scene: &Scene, address: PixelAddress, from: u64) -> Result<u64> {
    let surface = |cycle| scene.truth(address, cycle).map(|view| view.surface);
    let step = period(scene)? / 20;
    let mut before = from;
    while surface(before + step) == surface(before) {
        before += step;
        ensure!(before < from + 40 * step, "no edge passes the pixel");
    }
    let mut after = before + step;
    while after - before > 1 {
        let middle = before.midpoint(after);
        if surface(middle) == surface(before) {
            before = middle;
        } else {
            after = middle;
        }
    }
    Ok(after)
}

/// Adds the readings across an edge, and those of the same laser cycle without the edge. The
/// surface before the edge is a blade as often as the wall.
fn add_edge<const BINS: usize>(
    tally: &mut Tally,
    config: &PixelConfig<BINS, AnyRule>,
    scene: &Scene,
    address: PixelAddress,
    rng: &mut Pcg64,
) -> Result<()> {
    let edge = next_edge(scene, address, Uniform::new(0, period(scene)?)?.sample(rng))?;
    let (before, after) = (scene.rates(address, edge - 1), scene.rates(address, edge));
    // Laser cycles from the start of the readings to the edge.
    let at = 2000 + Uniform::new(0, 4000_u64)?.sample(rng);
    let phases = phases(rng)?;
    let pixel = SimulatedPixel::new(&before, scene.bins, pixel_rng(rng.next_u64(), address))?;
    let readings = |later| watch_step(&pixel, config, later, at, at + OVER, phases);
    let surfaces = [before, after].map(|rates| in_parts(rates.position));
    let (with, without) = (readings(&after)?, readings(&before)?);
    for ((sensor, with), without) in SENSORS.into_iter().zip(&with).zip(&without) {
        add_pair(tally, sensor, [with, without], at, &surfaces);
    }
    Ok(())
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    System::of(point).choose::<Trial>(trial_with_bins::<8>, trial_with_bins::<128>)(point, rng)
}

fn trial_with_bins<const BINS: usize>(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let scene = scene(point, Uniform::new(0.0, 1.0)?.sample(rng))?;
    let system = System::of(point);
    let config = system.settings(system.by, L1, 0).config::<BINS>()?;
    let both = [&scene.surfaces[0], &scene.surfaces[1]].map(|surface| surface.range_mm);
    let mut tally = Tally::new();
    let period = period(&scene)?;
    for (column, row) in PIXELS {
        let address = PixelAddress::new(row * 16 + column);
        for _ in 0..EDGES {
            add_edge(&mut tally, &config, &scene, address, rng)?;
        }
        let start = Uniform::new(0, period)?.sample(rng);
        let phases = phases(rng)?;
        let photons = pixel_rng(rng.next_u64(), address);
        let mut pixel = SimulatedPixel::new(&scene.rates(address, start), scene.bins, photons)?;
        let readings = watch(CYCLES, &config, phases, |cycle, photon| {
            pixel.set_rates(&scene.rates(address, start + cycle))?;
            pixel.next_cycle(photon);
            Ok(())
        })?;
        let range = |cycle| Some(scene.truth(address, start + cycle)?.range_mm);
        for (sensor, readings) in SENSORS.into_iter().zip(&readings) {
            for reading in readings {
                let mixed = range(reading.first) != range(reading.last);
                let exposure = if mixed { "mixed" } else { "clean" };
                add(&mut tally, sensor, exposure, 1);
                add(&mut tally, sensor, "cycles", reading.exposure());
                let off = |mm: f64| (in_parts(mm / scene.mm_per_bin()) - reading.position).abs();
                let is_right = both
                    .iter()
                    .all(|&mm| Some(off(mm)) >= range(reading.last).map(off));
                add(&mut tally, sensor, "right", is_right.into());
            }
        }
    }
    Ok(tally)
}

/// The blur of a sensor at a laser rate.
struct Blur {
    readings: u64,
    /// Mean exposure in laser cycles.
    exposure: f64,
    /// The share of exposures that contain an edge.
    mixed: Measured,
}

fn blur(point: &PointTally, sensor: &str) -> Blur {
    let count = |what: &str| point.count(&format!("{sensor} {what}"));
    let (mixed, clean) = (count("mixed"), count("clean"));
    Blur {
        readings: mixed + clean,
        exposure: count("cycles") as f64 / (mixed + clean) as f64,
        mixed: Measured::share(mixed, mixed + clean),
    }
}

fn results(part: &Part) -> Result<Results> {
    let mut series = Vec::new();
    let mut holds = true;
    for (pulse, pen) in [PULSES[2], PULSES[0]].into_iter().zip(STEPS) {
        let point = at(part, pulse);
        let blurs = SENSORS.map(|sensor| blur(point, sensor));
        let edges = edges_per_cycle(&scene(&point.parameters, 0.0)?)?;
        let dots = blurs.iter().map(|blur| blur.mixed.at(blur.exposure));
        let expected = blurs
            .iter()
            .map(|blur| Dot::exact(blur.exposure, blur.exposure * edges));
        // Within a factor of two of the expected share.
        holds &= blurs.iter().all(|blur| {
            let (low, high) = blur.mixed.interval;
            let expected = blur.exposure * edges;
            low < 2.0 * expected && high > expected / 2.0
        });
        let name = System::of(&point.parameters).name;
        series.push(Series::named(name, pen, Style::Dashed, expected.collect()));
        series.push(Series::unnamed(pen, Style::Dots, dots.collect()));
    }
    let chart = Chart {
        finding: "The shorter its exposure, the more rarely an edge of the fan passes a reading"
            .to_owned(),
        holds,
        note: "Dots from left to right: events, frames of 100, 500, 1000 and 2000 laser cycles. \
               Bars hold 99 %."
            .to_owned(),
        x: Axis::logarithmic("mean exposure, laser cycles"),
        y: Axis::logarithmic("readings that an edge passes, %").percent(),
        key: vec![
            Key::new(NEUTRAL, Style::Dots, "simulated"),
            Key::new(NEUTRAL, Style::Dashed, "edges a laser cycle × exposure"),
        ],
        columns: 1,
        panels: vec![Panel::only(series)],
    };
    let fpga = at(part, PULSES[2]);
    let readings = |sensor: usize| grouped(blur(fpga, SENSORS[sensor]).readings);
    Ok(Results {
        figures: vec![Figure::new("fan-mixed", &chart)?],
        claims: vec![visible(part)?, sharp(part)?],
        values: [("events", readings(0)), ("frames", readings(4))].into(),
        ..Results::default()
    })
}

fn at(part: &Part, (fpga, sigma): (f64, f64)) -> &PointTally {
    part.one([("fpga", fpga), ("sigma", sigma)])
}

/// The motion of a tip during the exposure of an event, in pixels, and the text about it.
fn path(point: &PointTally) -> Result<(f64, String)> {
    let tip = tip_per_cycle(&scene(&point.parameters, 0.0)?)?;
    let (events, frames) = (blur(point, SENSORS[0]), blur(point, SENSORS[4]));
    let path = events.exposure * tip;
    let text = format!(
        "a tip goes {path:.5} pixels in an event's exposure, {:.4} in a frame of 2000; an edge passes {:.3} % of events and {:.2} % of frames",
        2000.0 * tip,
        events.mixed.value * 100.0,
        frames.mixed.value * 100.0,
    );
    Ok((path, text))
}

/// The PC's claim.
fn visible(part: &Part) -> Result<Claim> {
    let point = at(part, PULSES[0]);
    let (path, text) = path(point)?;
    let right = |sensor: usize| {
        let readings = blur(point, SENSORS[sensor]).readings;
        Measured::share(point.count(&format!("{} right", SENSORS[sensor])), readings)
    };
    let [events, frames] = [right(0), right(4)];
    Ok(Claim::new(
        "visible",
        format!(
            "{:.2} % of events, {:.2} % of frames of 2000 are nearer to the surface seen, of two 0.8 m apart; a tip \
             goes {path:.5} pixels in an event's exposure",
            events.value * 100.0,
            frames.value * 100.0
        ),
        Verdict::of(events.interval.0 > VISIBLE && path < 0.1),
    )
    .with_details(text))
}

/// The FPGA's.
fn sharp(part: &Part) -> Result<Claim> {
    let (mut paths, mut details) = (Vec::new(), Vec::new());
    let mut excesses = Vec::new();
    let mut is_short = true;
    for pulse in [PULSES[1], PULSES[2]] {
        let point = at(part, pulse);
        let (path, text) = path(point)?;
        is_short &= path < 0.1;
        paths.push(path);
        excesses.push(excess(point, SENSORS[0]));
        let percent = |share: Measured| share.value * 100.0;
        details.push(format!(
            "{}: {text}; of {} edges {:.1} % of the events over them are read as neither surface and {:.1} % without the edge, {} percentage points more (frames {}), {} expired",
            FPGA.with_pulse(pulse.1),
            grouped(point.count("events pairs")),
            percent(neither(point, SENSORS[0], "mixed")),
            percent(neither(point, SENSORS[0], "clean")),
            mixed::points(excess(point, SENSORS[0])),
            mixed::points(excess(point, SENSORS[4])),
            grouped(point.count("events mixed, not read")),
        ));
    }
    let verdict = if is_short {
        is_sharp(&excesses)
    } else {
        Verdict::Refuted
    };
    let worst = mixed::worst(excesses.iter().copied()).map_or("none".to_owned(), mixed::points);
    let here = format!(
        "events over an edge are read as neither surface {worst} percentage points more often than without it; a tip \
         goes {} pixels in an event's exposure",
        span(paths, 5)
    );
    Ok(Claim::new("blur", here, verdict).with_details(details.join("; ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_pass_as_often_as_the_scene_says() {
        let scene = scene(&points()[0], 0.0).unwrap();
        // Three blades, two edges each, two turns a second: 100,000 laser cycles
        // from one edge to the next.
        assert!((edges_per_cycle(&scene).unwrap() - 1e-5).abs() < 1e-12);
        for (column, row) in PIXELS {
            let address = PixelAddress::new(row * 16 + column);
            let surface = |cycle| scene.truth(address, cycle).unwrap().surface;
            let views: Vec<usize> = (0..600_000).step_by(100).map(surface).collect();
            let edges = views.windows(2).filter(|pair| pair[0] != pair[1]);
            assert_eq!(edges.count(), 6);
        }
    }

    #[test]
    fn the_next_edge_is_where_the_surface_changes() {
        let scene = scene(&points()[0], 0.0).unwrap();
        for (column, row) in PIXELS {
            let address = PixelAddress::new(row * 16 + column);
            let surface = |cycle| scene.truth(address, cycle).unwrap().surface;
            let edge = next_edge(&scene, address, 1234).unwrap();
            assert!((1235..=101_235).contains(&edge));
            let mut before = (1234..edge).step_by(50);
            assert!(before.all(|cycle| surface(cycle) == surface(1234)));
            assert_eq!(surface(edge - 1), surface(1234));
            assert_ne!(surface(edge), surface(1234));
        }
    }
}
