//! The static scene (section III-B): when, how often and how precisely pixels report, and the
//! reflectivity estimated from events. Compared with frames of the same photons.
//!
//! On the PC with the average of all bins, and for comparison with quadrants. The scene has boards
//! in front of a wall, bright enough for reports from most pixels, as in the paper. One scene is
//! for the FPGA (section IV-C), with its L1. Signals, distances and backgrounds are our choices.

mod claims;
mod results;
mod surfaces;

use anyhow::Result;
use dtof_core::events::Reflectivity;
use dtof_core::{DepthEvent, PixelAddress, RangeGate};
use rand_core::Rng;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;

use super::one_pixel::{self, PER_BIN, in_parts};
use super::ranks::rank_correlation;
use super::systems::{self, Background, FPGA_SIGMAS, PC, PC_SIGMA, System};
use crate::sweep::mean::{add, add_error, add_value};
use crate::sweep::{Point, Study, Tally, Trial, point};
use dtof_data::photons::source::PhotonSource;
use dtof_engine::host::host_engine;
use dtof_light::scene::{Brightness, Scene};

const CYCLES: u64 = 10_000;
/// Laser cycles of a frame (L2).
const FRAME: u64 = 2000;
/// Laser cycles processed at a time.
const SLICE: u16 = 250;
/// Events that are averaged.
const MEAN_OF: usize = 10;
/// The largest error of a depth; others are false and counted separately.
const FALSE: i64 = 3 * PER_BIN / 2;
/// Integer units of a correlation, a relative error, a reflectivity.
const MILLION: f64 = 1e6;
/// Surfaces are tilted by one bin of range per this many columns, the width of a board. So the
/// pixels of a board are spread evenly over a bin.
const PIXELS_A_BIN: f64 = 8.0;
/// L1 of section III-B.
const PC_L1: u16 = 100;
/// Bins at which the surfaces of the PC's scene begin, in the order of the file: the wall, then the
/// boards. All stay within the 8 bins.
const PC_BINS: [f64; 4] = [2.0, 1.0, 1.3, 1.6];
/// B of the PC (that of the paper's analysis, and that of its rule of thumb, L1·B = 30), and a
/// factor for the light of the file with which most pixels report.
const PC_LIGHTS: [(f64, f64); 2] = [(PC.background, 2.0), (0.3, 4.0)];
const DEPTHS: [&str; 3] = ["frame of 2000", "last event", "mean of ten"];
/// Differences between successive depths of a pixel.
const NOISES: [&str; 3] = [
    "noise of frame of 2000",
    "noise of last event",
    "noise of mean of ten",
];

/// Compared with the paper's static scene.
pub const STUDY: Study = Study {
    name: "static-scene",
    about: "first events, event rates, depth errors and reflectivity of static scenes",
    revision: 4,
    few_seeds: 2,
    all_seeds: 20,
    points,
    trial,
    results: results::results,
};

fn points() -> Vec<Point> {
    let [low, high] = PC_LIGHTS;
    let fpga = (systems::FPGA.background, 1.0);
    let [narrow, wide] = FPGA_SIGMAS;
    let points = [
        (0.0, 1.0, low, PC_SIGMA),
        (0.0, 1.0, high, PC_SIGMA),
        (0.0, 0.0, low, PC_SIGMA),
        (1.0, 0.0, fpga, wide),
        (1.0, 0.0, fpga, narrow),
    ];
    let points = points.map(|(fpga, average, (background, light), sigma)| {
        point([
            ("fpga", fpga),
            ("average", average),
            ("background", background),
            ("light", light),
            ("sigma", sigma),
        ])
    });
    points.into()
}

/// Boards in front of a wall: 64×32 macropixels on the PC, 32×16 on the FPGA. Every surface is
/// tilted by a bin per [`PIXELS_A_BIN`] of 32 columns, and moved away by `shift` bins.
fn scene(point: &Point, shift: f64) -> Result<Scene> {
    let system = System::of(point);
    let text = include_str!("../../../../scenes/static.toml");
    let mut scene = system.scene(text, point["sigma"])?;
    scene.background = point["background"];
    let mm_per_bin = scene.mm_per_bin();
    // From the first column of the layout to the last, in bins.
    let turn = f64::from(scene.layout[0] - 1) / PIXELS_A_BIN;
    let bright = point["light"] * scene.signal_at_one_metre;
    for (surface, bins) in scene.surfaces.iter_mut().zip(PC_BINS) {
        if system == PC {
            if let Brightness::Reflectivity(share) = surface.light {
                let metres = surface.range_mm / 1000.0;
                surface.light = Brightness::Signal(bright * share / metres.powi(2));
            }
            surface.range_mm = bins * mm_per_bin;
        }
        surface.range_mm += shift * mm_per_bin;
        surface.range_right_mm = surface.range_mm + turn * mm_per_bin;
    }
    if system == PC {
        scene.size = [64, 32];
    }
    Ok(scene)
}

/// The positions reported by a pixel.
#[derive(Default)]
struct Pixel {
    /// Positions of its events.
    positions: Vec<i64>,
    reflectivity: Reflectivity,
    /// Positions of its frames.
    frames: Vec<i64>,
}

impl Pixel {
    fn add(&mut self, event: &DepthEvent) {
        self.positions.push(event.position().raw().into());
        self.reflectivity.add(event);
    }
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    System::of(point).choose::<Trial>(trial_with_bins::<8>, trial_with_bins::<128>)(point, rng)
}

fn trial_with_bins<const BINS: usize>(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let scene = scene(point, Uniform::new(0.0, 1.0)?.sample(rng))?;
    let system = System::of(point);
    let background = Background::ALL[usize::from(point["average"] == 0.0)];
    let l1 = system.choose(PC_L1, systems::L1);
    let settings = system.settings(background, l1, rng.next_u64());
    let mut photons = scene.photons(settings.seed, CYCLES)?;
    let addresses = photons.addresses();
    let mut engine = host_engine(&settings, photons.array(), &addresses)?;
    let mut pixels: Vec<Pixel> = addresses.iter().map(|_| Pixel::default()).collect();
    let mut frames: Vec<_> = addresses
        .iter()
        .map(|_| one_pixel::frames::<BINS>(0, FRAME))
        .collect();
    let mut tally = Tally::new();
    for _ in 0..CYCLES / u64::from(SLICE) {
        let slice = photons.next_slice(SLICE)?;
        for event in engine.run(&slice)? {
            add(&mut tally, "events", "of all pixels", 1);
            for by in [100, 109, 110] {
                let early = event.cycle.raw() < by;
                add(&mut tally, "events", &format!("by {by}"), early.into());
            }
            pixels[usize::from(event.pixel.raw())].add(&event);
        }
        for ((pixel, frame), received) in pixels.iter_mut().zip(&mut frames).zip(&slice.pixels) {
            let mut codes = received.photons.iter().peekable();
            for cycle in 0..SLICE {
                let now = slice.first_cycle + u64::from(cycle);
                while let Some(photon) = codes.next_if(|photon| photon.cycle == cycle) {
                    frame.count(&RangeGate::full(), now, photon.code);
                }
                let reading = one_pixel::end_laser_cycle(frame, now);
                pixel.frames.extend(reading.map(|reading| reading.position));
            }
        }
    }
    for (&address, pixel) in addresses.iter().zip(&pixels) {
        add_pixel(&mut tally, &scene, address, pixel);
    }
    add_scene(&mut tally, &scene, &addresses, &pixels);
    Ok(tally)
}

fn mean_of_last(positions: &[i64], most: usize) -> f64 {
    let last = &positions[positions.len().saturating_sub(most)..];
    last.iter().sum::<i64>() as f64 / last.len() as f64
}

/// Adds the events and the depths of a pixel to those of its surface.
fn add_pixel(tally: &mut Tally, scene: &Scene, address: PixelAddress, pixel: &Pixel) {
    let Some(view) = scene.truth(address, 0) else {
        return;
    };
    let surface = &scene.surfaces[view.surface].name;
    let events = i64::try_from(pixel.positions.len()).unwrap_or(i64::MAX);
    add_value(tally, &format!("{surface}, events"), events);
    add(tally, surface, "without an event", (events == 0).into());
    add(tally, surface, "frames", pixel.frames.len() as u64);
    if pixel.positions.len() < MEAN_OF {
        return;
    }
    let truth = in_parts(view.range_mm / scene.mm_per_bin());
    #[allow(clippy::cast_possible_truncation, reason = "a position")]
    let mean = |most| mean_of_last(&pixel.positions, most).round() as i64;
    let frames = pixel.frames.iter().map(|&position| (DEPTHS[0], position));
    let of_events = [(DEPTHS[1], mean(1)), (DEPTHS[2], mean(MEAN_OF))];
    for (depth, position) in frames.chain(of_events) {
        add_depth(tally, &format!("{surface}, {depth}"), position - truth);
    }
    add_noises(tally, surface, pixel);
}

/// Adds the differences between successive depths of a pixel, in which the bias of the centre of
/// mass cancels. All three depths use the same pixels: those with twice [`MEAN_OF`] events, two
/// frames, and no false difference.
fn add_noises(tally: &mut Tally, surface: &str, pixel: &Pixel) {
    let Some(at) = pixel.positions.len().checked_sub(2 * MEAN_OF) else {
        return;
    };
    let (before, last) = pixel.positions[at..].split_at(MEAN_OF);
    #[allow(clippy::cast_possible_truncation, reason = "a position")]
    let mean = |positions| mean_of_last(positions, MEAN_OF).round() as i64;
    let [first, second, ..] = pixel.frames[..] else {
        return;
    };
    let differences = [
        second - first,
        last[MEAN_OF - 1] - last[MEAN_OF - 2],
        mean(last) - mean(before),
    ];
    let any_false = differences.iter().any(|off| off.abs() > FALSE);
    for (name, difference) in NOISES.into_iter().zip(differences) {
        let name = format!("{surface}, {name}");
        if !any_false || difference.abs() > FALSE {
            add_depth(tally, &name, difference);
        }
    }
}

/// Adds an error, or a difference of two depths, unless it is false.
fn add_depth(tally: &mut Tally, name: &str, error: i64) {
    if error.abs() > FALSE {
        add(tally, name, "false", 1);
    } else {
        add_error(tally, name, error);
    }
}

/// Adds the comparisons between pixels: ranks, and the reflectivity estimated from events and
/// reported depth.
#[allow(clippy::cast_possible_truncation, reason = "some millions")]
fn add_scene(tally: &mut Tally, scene: &Scene, addresses: &[PixelAddress], pixels: &[Pixel]) {
    let signals = addresses
        .iter()
        .map(|&address| scene.rates(address, 0).signal);
    let events = pixels.iter().map(|pixel| pixel.positions.len() as f64);
    let (signals, events): (Vec<f64>, Vec<f64>) = (signals.collect(), events.collect());
    let correlation = rank_correlation(&signals, &events).unwrap_or_default();
    let millionths = |value: f64| (value * MILLION).round() as i64;
    add_value(tally, "rank correlation", millionths(correlation));
    let estimates: [fn(&Pixel) -> f64; 2] = [
        |pixel| pixel.reflectivity.events().into(),
        |pixel| pixel.reflectivity.signal().to_num(),
    ];
    for (name, estimate) in ESTIMATES.into_iter().zip(estimates) {
        // Estimate and truth of pixels with an event, up to a common scale.
        let pairs: Vec<(usize, f64, f64)> = addresses
            .iter()
            .zip(pixels)
            .filter(|(_, pixel)| !pixel.positions.is_empty())
            .filter_map(|(&address, pixel)| {
                let view = scene.truth(address, 0)?;
                let signal = scene.rates(address, 0).signal;
                let z = mean_of_last(&pixel.positions, MEAN_OF) / PER_BIN as f64;
                let true_z = view.range_mm / scene.mm_per_bin();
                Some((
                    view.surface,
                    estimate(pixel) * z * z,
                    signal * true_z * true_z,
                ))
            })
            .collect();
        let (of_events, of_truth): (Vec<_>, Vec<_>) = pairs.iter().map(|p| (p.1, p.2)).unzip();
        let correlation = rank_correlation(&of_truth, &of_events).unwrap_or_default();
        add_value(tally, &format!("{name}, ranks"), millionths(correlation));
        let ratios: Vec<_> = pairs.into_iter().map(|(of, a, b)| (of, a / b)).collect();
        let (scale, error) = common_scale(ratios.iter().map(|(_, ratio)| *ratio));
        add_value(tally, name, millionths(error));
        for (surface, ratio) in ratios {
            let name = format!("{}, {name}", scene.surfaces[surface].name);
            add_value(tally, &name, (ratio * scale * 1000.0).round() as i64);
        }
    }
}

/// How the reflectivity is estimated, before it is multiplied by z².
const ESTIMATES: [&str; 2] = ["events × z²", "count rate × z²"];

/// The scale that brings `ratios` closest to 1, and their root mean square distance from 1 after
/// scaling.
fn common_scale(ratios: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let sum: f64 = ratios.clone().sum();
    let squares: f64 = ratios.clone().map(|ratio| ratio * ratio).sum();
    let scale = sum / squares;
    let (mut off, mut count) = (0.0, 0.0);
    for ratio in ratios {
        off += (ratio * scale - 1.0) * (ratio * scale - 1.0);
        count += 1.0;
    }
    (scale, (off / count).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_scale_for_all() {
        let (scale, error) = common_scale([2.0, 2.0].into_iter());
        assert_eq!((scale, error), (0.5, 0.0));
        // s = 4 / 10: 0.4 and 1.2.
        let (scale, error) = common_scale([1.0, 3.0].into_iter());
        assert!((scale - 0.4).abs() < 1e-15);
        assert!((error - 0.2_f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn the_mean_is_that_of_the_last() {
        let positions: Vec<i64> = (1..=12).collect();
        assert_eq!(mean_of_last(&positions, 10), 7.5);
        assert_eq!(mean_of_last(&positions, 1), 12.0);
        assert_eq!(mean_of_last(&positions[..3], 10), 2.0);
    }

    /// Pixels of a board are spread evenly over a bin, and all lie in the window.
    #[test]
    fn boards_lie_evenly_in_a_bin() {
        for point in points() {
            let scene = scene(&point, 0.3).unwrap();
            let across = scene.size[0] / 32;
            for board in [2, 12, 22] {
                let columns = board * across..(board + 8) * across;
                let mut phases: Vec<f64> = columns
                    .map(|column| {
                        let address = 8 * across * scene.size[0] + column;
                        let address = PixelAddress::new(u16::try_from(address).unwrap());
                        let view = scene.truth(address, 0).unwrap();
                        assert_ne!(scene.surfaces[view.surface].name, "wall");
                        let position = view.range_mm / scene.mm_per_bin();
                        assert!((1.0..f64::from(scene.bins) - 1.0).contains(&position));
                        position % 1.0
                    })
                    .collect();
                phases.sort_by(f64::total_cmp);
                for pair in phases.windows(2) {
                    let step = 1.0 / PIXELS_A_BIN / f64::from(across);
                    assert!((pair[1] - pair[0] - step).abs() < 1e-9, "{phases:?}");
                }
            }
        }
    }

    #[test]
    fn all_noises_are_of_the_same_pixels() {
        let noises = |positions: Vec<i64>, frames: Vec<i64>| {
            let mut tally = Tally::new();
            let pixel = Pixel {
                positions,
                frames,
                ..Pixel::default()
            };
            add_noises(&mut tally, "a", &pixel);
            let of = |what: &str| {
                NOISES.map(|name| {
                    let name = format!("a, {name} {what}");
                    tally.get(&name).copied().unwrap_or_default()
                })
            };
            (of("values"), of("false"))
        };
        let none = [0; 3];
        assert_eq!(noises(vec![0; 19], vec![0, 1]), (none, none));
        assert_eq!(noises(vec![0; 20], vec![0]), (none, none));
        assert_eq!(noises(vec![0; 20], vec![0, 1]), ([1; 3], none));
        let (frames, far) = (vec![0, 1], FALSE + 1);
        let mut positions = vec![0; 20];
        positions[19] = far;
        assert_eq!(noises(positions, frames), (none, [0, 1, 0]));
        assert_eq!(noises(vec![0; 20], vec![0, far]), (none, [1, 0, 0]));
    }
}
