//! Dynamic depth: how many events it removes, which changes it reports, and how many of them are
//! false (section III-E).
//!
//! On the PC, as in the paper, and additionally a car in front of the FPGA. The paper gives neither
//! brightness, speed nor distances. These are our choices, with several brightnesses.

mod claims;
mod observed_pixel;
mod outcome;
mod results;

use anyhow::Result;
use dtof_core::events::{DynamicDepthConfig, Reference};
use dtof_core::fixed::types::{I24F8, U24F8};
use dtof_core::{PixelAddress, RangeScale};
use rand_core::Rng;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;

use self::observed_pixel::{ObservedPixel, true_steps};
use super::systems::{Background, FPGA_SIGMAS, L1, PC_SIGMA, System};
use crate::sweep::mean::add;
use crate::sweep::{Point, Study, Tally, grid, point};
use dtof_data::photons::source::PhotonSource;
use dtof_engine::host::host_engine;
use dtof_light::scene::{Brightness, Scene, Shape};

/// Laser cycles handled at a time.
const SLICE: u16 = 250;
/// Laser cycles of a frame (L2).
const FRAME: u64 = 2000;
/// The paper's threshold: millimetres by which a mean has to change.
const THRESHOLD_MM: u32 = 100;
/// Signal photons a laser cycle of all surfaces; the paper gives none.
const SIGNALS: [f64; 6] = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0];
/// The signal of the FPGA's car.
const FPGA_SIGNAL: f64 = 0.5;
/// What a mean is compared with; in the paper, the previous mean.
const REFERENCES: [(Reference, &str); 2] = [
    (Reference::Previous, "previous"),
    (Reference::Reported, "reported"),
];

/// Compared with the paper's dynamic depth.
pub const STUDY: Study = Study {
    name: "dynamic-depth",
    about: "which changes of depth dynamic depth reports, and how many events it takes away",
    revision: 3,
    few_seeds: 1,
    all_seeds: 8,
    points,
    trial,
    results: results::results,
};

fn points() -> Vec<Point> {
    let mut points = grid([("fpga", &[0.0]), ("fan", &[0.0, 1.0]), ("signal", &SIGNALS)]);
    points.push(point([
        ("fpga", 1.0),
        ("fan", 0.0),
        ("signal", FPGA_SIGNAL),
    ]));
    points
}

/// The properties of a scene that the paper does not give.
struct Run {
    /// The car's speed: it moves half a metre in a run on the PC, a third on the FPGA.
    metres_per_second: f64,
    /// Two edges of a fan at 120 rpm on the PC.
    cycles: u64,
    sigma: f64,
    /// Bins between the start of the window and the nearest surface.
    before: f64,
}

fn run(point: &Point) -> Run {
    let is_fan = point["fan"] > 0.0;
    if point["fpga"] > 0.0 {
        Run {
            metres_per_second: 10.0,
            cycles: 350_000,
            sigma: FPGA_SIGMAS[1],
            before: 0.0,
        }
    } else {
        Run {
            metres_per_second: 5.0,
            cycles: if is_fan { 200_000 } else { 120_000 },
            sigma: PC_SIGMA,
            before: 2.0,
        }
    }
}

/// The scene of a point on 8×8 macropixels, moved away by `shift` bins.
fn scene(point: &Point, shift: f64, goes_away: bool) -> Result<Scene> {
    let text = if point["fan"] > 0.0 {
        include_str!("../../../../scenes/fan.toml")
    } else {
        include_str!("../../../../scenes/radial.toml")
    };
    let run = run(point);
    let mut scene = Scene {
        size: [8, 8],
        ..System::of(point).scene(text, run.sigma)?
    };
    let shift_mm = (run.before + shift) * scene.mm_per_bin();
    for surface in &mut scene.surfaces {
        surface.light = Brightness::Signal(point["signal"]);
        if surface.velocity_m_per_s != 0.0 {
            surface.velocity_m_per_s = run.metres_per_second;
            if !goes_away {
                surface.velocity_m_per_s *= -1.0;
                surface.range_mm += 600.0;
                surface.range_right_mm += 600.0;
            }
        }
        surface.range_mm += shift_mm;
        surface.range_right_mm += shift_mm;
        if let Shape::Fan(fan) = &mut surface.shape {
            fan.rpm = if goes_away { fan.rpm } else { -fan.rpm };
        }
    }
    Ok(scene)
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let shift = Uniform::new(0.0, 1.0)?.sample(rng);
    let scene = scene(point, shift, rng.next_u64().is_multiple_of(2))?;
    let cycles = run(point).cycles;
    let seed = rng.next_u64();
    let mut photons = scene.photons(seed, cycles)?;
    let addresses = photons.addresses();
    let mut rules = Vec::new();
    for background in Background::ALL {
        let settings = System::of(point).settings(background, L1, seed);
        let scale = RangeScale::new(settings.configuration.bin_width_ps, I24F8::ZERO)?;
        let mut ways = Vec::new();
        for (reference, name) in REFERENCES {
            let config = DynamicDepthConfig::new(U24F8::from_num(THRESHOLD_MM), &scale, reference)?;
            let pixel = ObservedPixel::new(config, THRESHOLD_MM.into());
            ways.push((name, vec![pixel; addresses.len()]));
        }
        rules.push((
            background,
            host_engine(&settings, photons.array(), &addresses)?,
            ways,
        ));
    }
    let mut tally = Tally::new();
    for _ in 0..cycles / u64::from(SLICE) {
        let slice = photons.next_slice(SLICE)?;
        for (_, engine, ways) in &mut rules {
            for event in engine.run(&slice)? {
                let first = (event.cycle.raw() + 1).saturating_sub(event.exposure.into());
                let truth =
                    [first, event.cycle.raw()].map(|cycle| range_mm(&scene, event.pixel, cycle));
                let pixel = usize::from(event.pixel.raw());
                for (_, pixels) in ways.iter_mut() {
                    pixels[pixel].observe(&event, truth);
                }
            }
        }
    }
    for (pixel, &address) in addresses.iter().enumerate() {
        let all_steps = steps(&scene, address, cycles, f64::from(THRESHOLD_MM));
        let is_still = steps(&scene, address, cycles, 0.0).is_empty();
        let surface = if is_still { "still" } else { "moving" };
        // Every frame of a pixel with a photon is a reading.
        add(&mut tally, surface, "frames", cycles / FRAME);
        for (background, _, ways) in &rules {
            for (reference, pixels) in ways {
                let name = name(*background, reference);
                pixels[pixel].add_steps(&mut tally, &name, &all_steps, cycles);
                pixels[pixel].add_counts(&mut tally, &format!("{name} {surface}"));
            }
        }
    }
    Ok(tally)
}

/// The name of a background and reference in a tally.
fn name(background: Background, reference: &str) -> String {
    format!("{} {reference}", background.name())
}

/// The true steps of a pixel.
fn steps(scene: &Scene, address: PixelAddress, cycles: u64, threshold_mm: f64) -> Vec<(u64, i8)> {
    let truth = (0..cycles).step_by(50);
    let truth = truth.map(|cycle| (cycle, range_mm(scene, address, cycle)));
    true_steps(truth, threshold_mm)
}

/// The range that a pixel sees in millimetres; 0 if none.
fn range_mm(scene: &Scene, address: PixelAddress, cycle: u64) -> f64 {
    let view = scene.truth(address, cycle);
    view.map_or(0.0, |view| view.range_mm)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(fpga: f64, fan: f64) -> Point {
        point([("fpga", fpga), ("fan", fan), ("signal", 0.5)])
    }

    #[test]
    fn the_car_makes_a_step_each_tenth_of_a_metre_and_the_wall_none() {
        for (fpga, goes_away, count) in [(0.0, true, 4), (0.0, false, 4), (1.0, true, 3)] {
            let point = at(fpga, 0.0);
            let scene = scene(&point, 0.3, goes_away).unwrap();
            let cycles = run(&point).cycles;
            let car = steps(&scene, PixelAddress::new(3 * 8 + 3), cycles, 100.0);
            assert_eq!(car.len(), count, "{car:?}"); // strictly more than 0.1 m each
            let side = if goes_away { 1 } else { -1 };
            assert!(car.iter().all(|step| step.1 == side));
            assert!(steps(&scene, PixelAddress::new(0), cycles, 100.0).is_empty());
        }
    }

    #[test]
    fn the_fan_makes_two() {
        let scene = scene(&at(0.0, 1.0), 0.7, true).unwrap();
        for pixel in [11, 25, 52] {
            let steps = steps(&scene, PixelAddress::new(pixel), 200_000, 100.0);
            assert_eq!(steps.len(), 2);
            assert_eq!(steps[0].1, -steps[1].1);
        }
    }

    #[test]
    fn all_surfaces_lie_in_the_window() {
        for point in points() {
            for (shift, goes_away) in [(0.0, true), (1.0, true), (0.0, false), (1.0, false)] {
                let scene = scene(&point, shift, goes_away).unwrap();
                for pixel in 0..64 {
                    for cycle in [0, run(&point).cycles] {
                        let position =
                            range_mm(&scene, PixelAddress::new(pixel), cycle) / scene.mm_per_bin();
                        assert!((1.5..f64::from(scene.bins) - 1.5).contains(&position));
                    }
                }
            }
        }
    }
}
