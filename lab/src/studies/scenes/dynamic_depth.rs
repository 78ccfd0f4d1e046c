//! Dynamic depth: how many events it takes away, which changes it reports, and how many
//! that there were not (section III-E).

mod results;
mod watched;

use anyhow::Result;
use dtof_core::fixed::types::{I24F8, U16F16, U24F8};
use dtof_core::{DynamicDepthConfig, PixelAddress, RangeScale, Reference};
use rand_core::Rng;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;

use self::watched::{Watched, true_steps};
use crate::sweep::mean::add;
use crate::sweep::{Point, Study, Tally, grid, whole};
use dtof::engine::host::host_engine;
use dtof::input::source::{Geometry, PhotonSource};
use dtof::simulate::scene::{self, Light, Scene, Shape};

/// Laser cycles a trial lasts: half a metre of the car, four edges of the fan.
const CYCLES: [u64; 4] = [120_000, 120_000, 400_000, 120_000];
/// Laser cycles handled at a time.
const SLICE: u16 = 250;
/// That of the paper's system with which it shows dynamic depth.
const LASER_RATE_MHZ: f64 = 1.2;
/// What the car goes in a second; the paper does not say.
const CAR_M_PER_S: f64 = 5.0;
/// Millimetres by which a mean has to change; the paper's is 100.
const THRESHOLDS: [u32; 5] = [50, 100, 200, 500, 1000];
const REFERENCES: [(Reference, &str); 2] = [
    (Reference::Previous, "previous"),
    (Reference::Reported, "reported"),
];
/// What a point's `scene` stands for.
const SCENES: [&str; 4] = [
    "a car that goes away",
    "a car that comes nearer",
    "a fan",
    "the same car, 8 bins of 8.75 ns",
];

/// Held against the paper's dynamic depth.
pub const STUDY: Study = Study {
    name: "dynamic-depth",
    about: "which changes of depth dynamic depth reports, and how many events it takes away",
    revision: 2,
    few_seeds: 2,
    all_seeds: 20,
    points,
    trial,
    results: results::results,
};

fn points() -> Vec<Point> {
    grid([("scene", &[0.0, 1.0, 2.0, 3.0])])
}

/// The scene of a point on 8×8 macropixels, everything `shift` bins farther away.
fn scene(point: &Point, shift: f64) -> Result<Scene> {
    let number = whole(point, "scene");
    let text = if number == 2 {
        include_str!("../../../../scenes/fan.toml")
    } else {
        include_str!("../../../../scenes/radial.toml")
    };
    let mut scene = Scene {
        geometry: Geometry {
            columns: 8,
            rows: 8,
        },
        laser_rate_mhz: LASER_RATE_MHZ,
        ..Scene::parse(text)?
    };
    for surface in &mut scene.surfaces {
        if surface.velocity_m_per_s != 0.0 {
            surface.velocity_m_per_s = CAR_M_PER_S;
            if number == 1 {
                surface.velocity_m_per_s = -CAR_M_PER_S;
                surface.range_mm += 600.0;
                surface.range_right_mm += 600.0;
            }
        }
        if number == 3 {
            // The bins of the paper's first system, of the pulse's width; the car in
            // the third of them, the wall in the sixth.
            let range_mm = if surface.velocity_m_per_s == 0.0 {
                7000.0
            } else {
                3000.0
            };
            (surface.range_mm, surface.range_right_mm) = (range_mm, range_mm);
            surface.light = Light::Signal(0.5);
        }
    }
    if number == 3 {
        scene.bins = 8;
        scene.bin_width_ps = 8750.0;
        scene.background = 0.05;
        scene.pulse_sigma_bins = 0.5;
    }
    let shift_mm = shift * scene.mm_per_bin();
    for surface in &mut scene.surfaces {
        surface.range_mm += shift_mm;
        surface.range_right_mm += shift_mm;
        // The fan may begin anywhere.
        if let Shape::Fan(fan) = &mut surface.shape {
            fan.rpm = fan.rpm.copysign(shift - 0.5);
        }
    }
    Ok(scene)
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let scene = scene(point, Uniform::new(0.0, 1.0)?.sample(rng))?;
    let cycles = CYCLES[usize::from(whole(point, "scene"))];
    let mut settings = scene::settings(rng.next_u64());
    (settings.l1, settings.x) = (40, 4);
    settings.bins = scene.bins.into();
    settings.bin_width_ps = U16F16::from_num(scene.bin_width_ps);
    let scale = RangeScale::new(settings.bin_width_ps, I24F8::ZERO)?;

    let mut photons = scene.photons(settings.seed, cycles)?;
    let addresses = photons.addresses();
    let mut engine = host_engine(&settings, &addresses)?;
    let mut ways = Vec::new();
    for threshold_mm in THRESHOLDS {
        for (reference, name) in REFERENCES {
            let config = DynamicDepthConfig::new(U24F8::from_num(threshold_mm), &scale, reference)?;
            let watched = Watched::new(config, threshold_mm.into());
            ways.push((threshold_mm, name, vec![watched; addresses.len()]));
        }
    }
    let mut tally = Tally::new();
    for _ in 0..cycles / u64::from(SLICE) {
        let slice = photons.next_slice(SLICE)?;
        for event in engine.run(&slice)? {
            add(&mut tally, "depth", "events", 1);
            let first = (event.cycle.0 + 1).saturating_sub(event.exposure.into());
            let truth = [first, event.cycle.0].map(|cycle| range_mm(&scene, event.pixel, cycle));
            let pixel = usize::from(event.pixel.0);
            for (_, _, pixels) in &mut ways {
                pixels[pixel].observe(&event, truth);
            }
        }
    }
    for (threshold_mm, reference, pixels) in &ways {
        let name = name(*threshold_mm, reference);
        for (&address, watched) in addresses.iter().zip(pixels) {
            let steps = steps(&scene, address, cycles, f64::from(*threshold_mm));
            watched.add_to(&mut tally, &name, &steps, cycles);
            if self::steps(&scene, address, cycles, 0.0).is_empty() {
                watched.add_still(&mut tally, &name);
            }
        }
    }
    Ok(tally)
}

/// What a tally calls a threshold and reference.
fn name(threshold_mm: u32, reference: &str) -> String {
    format!("{threshold_mm} {reference}")
}

/// The true steps of a pixel.
fn steps(scene: &Scene, address: PixelAddress, cycles: u64, threshold_mm: f64) -> Vec<(u64, i8)> {
    let truth = (0..cycles).step_by(50);
    let truth = truth.map(|cycle| (cycle, range_mm(scene, address, cycle)));
    true_steps(truth, threshold_mm)
}

/// What a pixel sees; 0 if it sees nothing.
fn range_mm(scene: &Scene, address: PixelAddress, cycle: u64) -> f64 {
    let view = scene.truth(address, cycle);
    view.map_or(0.0, |view| view.range_mm)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::point;

    #[test]
    fn the_car_makes_a_step_each_tenth_of_a_metre_and_the_wall_none() {
        for (number, sign) in [(0.0, 1), (1.0, -1), (3.0, 1)] {
            let scene = scene(&point([("scene", number)]), 0.3).unwrap();
            let car = steps(&scene, PixelAddress(3 * 8 + 3), 120_000, 100.0);
            assert_eq!(car.len(), 4, "{car:?}"); // strictly more than 0.4 of 0.5 m
            assert!(car.iter().all(|&(_, side)| side == sign));
            // 24,000 laser cycles each.
            assert!((23_900..=24_100).contains(&(car[2].0 - car[1].0)));
            assert!(steps(&scene, PixelAddress(0), 120_000, 100.0).is_empty());
        }
    }

    #[test]
    fn the_fan_makes_four() {
        let scene = scene(&point([("scene", 2.0)]), 0.7).unwrap();
        for pixel in [11, 25, 52] {
            let steps = steps(&scene, PixelAddress(pixel), 400_000, 100.0);
            assert_eq!(steps.len(), 4);
            let sides: Vec<i8> = steps.iter().map(|step| step.1).collect();
            assert!(sides.windows(2).all(|pair| pair[0] == -pair[1]));
        }
    }
}
