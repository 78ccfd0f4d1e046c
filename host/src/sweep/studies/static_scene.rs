//! The static scene (section III-B): when, how often and how well pixels report,
//! and what their events say of the reflectivity.

use anyhow::Result;
use dtof_core::{DepthEvent, PixelAddress};
use rand_core::Rng;
use rand_pcg::Pcg64;

use super::one_pixel::{FramePixel, PER_BIN, in_parts};
use super::ranks::rank_correlation;
use crate::chart::{self, Axis, Chart, Series, Style, line_chart};
use crate::engine::host_engine;
use crate::scene::{self, Light, Scene};
use crate::source::{Geometry, PhotonSource};
use crate::summary::grouped;
use crate::sweep::mean::{Measured, add, add_error, add_value};
use crate::sweep::results::{Claim, Figure, Results, Verdict};
use crate::sweep::{Part, Point, PointTally, Study, Tally, point};

const CYCLES: u64 = 10_000;
/// Laser cycles of a frame (L2).
const FRAME: u64 = 2000;
/// Laser cycles handled at a time.
const SLICE: u16 = 250;
/// Events that are averaged.
const MEAN_OF: usize = 10;
/// A depth farther off is false and counts apart.
const FALSE: i64 = 3 * PER_BIN;
/// Whole numbers of a correlation, a relative error, a reflectivity.
const MILLION: f64 = 1e6;
/// The scenes, as a point names them.
const SCENES: [&str; 2] = ["scenes/static.toml", "scenes/demo.toml"];
const DEPTHS: [&str; 3] = ["frame of 2000", "last event", "mean of ten"];

/// Held against the paper's static scene.
pub const STUDY: Study = Study {
    name: "static-scene",
    about: "first events, event rates, depth errors and reflectivity of two static scenes",
    revision: 1,
    few_seeds: 6,
    all_seeds: 60,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    vec![point([("scene", 0.0)]), point([("scene", 1.0)])]
}

/// At 32×16 pixels.
fn scene(point: &Point) -> Result<Scene> {
    let text = if point["scene"] > 0.0 {
        include_str!("../../../../scenes/demo.toml")
    } else {
        include_str!("../../../../scenes/static.toml")
    };
    Ok(Scene {
        geometry: Geometry {
            columns: 32,
            rows: 16,
        },
        ..Scene::parse(text)?
    })
}

/// What there is of a pixel.
#[derive(Default)]
struct Pixel {
    /// Of its events.
    positions: Vec<i64>,
    /// Their counts in the peak, less the background.
    counts: u64,
    /// Their exposures.
    exposed: u64,
    /// Of its frames.
    frames: Vec<i64>,
}

impl Pixel {
    fn add(&mut self, event: &DepthEvent) {
        self.positions.push(event.position().raw().into());
        let above = event
            .peak_count
            .raw()
            .saturating_sub(event.background.raw());
        self.counts += u64::from(above);
        self.exposed += u64::from(event.exposure);
    }
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let scene = scene(point)?;
    let settings = scene::settings(rng.next_u64());
    let mut photons = scene.photons(settings.seed, CYCLES)?;
    let addresses = photons.addresses();
    let mut engine = host_engine(&settings, &addresses)?;
    let mut pixels: Vec<Pixel> = addresses.iter().map(|_| Pixel::default()).collect();
    let mut frames: Vec<FramePixel> = addresses
        .iter()
        .map(|_| FramePixel::new(0, FRAME))
        .collect();
    let mut tally = Tally::new();
    for _ in 0..CYCLES / u64::from(SLICE) {
        let slice = photons.next_slice(SLICE)?;
        for event in engine.run(&slice)? {
            add(&mut tally, "events", "of all pixels", 1);
            for by in [100, 109, 110] {
                let early = event.cycle.0 < by;
                add(&mut tally, "events", &format!("by {by}"), early.into());
            }
            pixels[usize::from(event.pixel.0)].add(&event);
        }
        for ((pixel, frame), received) in pixels.iter_mut().zip(&mut frames).zip(&slice.pixels) {
            let mut codes = received.photons.iter().peekable();
            for cycle in 0..SLICE {
                let now = slice.first_cycle + u64::from(cycle);
                while let Some(photon) = codes.next_if(|photon| photon.cycle == cycle) {
                    frame.count(now, photon.code);
                }
                let reading = frame.end_laser_cycle(now);
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

#[allow(clippy::cast_precision_loss, reason = "at most ten positions")]
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
    if pixel.positions.len() < MEAN_OF {
        return;
    }
    let truth = in_parts(view.range_mm / scene.mm_per_bin());
    #[allow(clippy::cast_possible_truncation, reason = "a position")]
    let mean = |most| mean_of_last(&pixel.positions, most).round() as i64;
    let frames = pixel.frames.iter().map(|&position| (DEPTHS[0], position));
    let of_events = [(DEPTHS[1], mean(1)), (DEPTHS[2], mean(MEAN_OF))];
    for (depth, position) in frames.chain(of_events) {
        let name = format!("{surface}, {depth}");
        let error = position - truth;
        if error.abs() > FALSE {
            add(tally, &name, "false", 1);
        } else {
            add_error(tally, &name, error);
        }
    }
}

/// Adds what is compared from pixel to pixel: ranks, and the reflectivity that
/// follows from the events and the depth reported.
#[allow(clippy::cast_precision_loss, reason = "some thousand events")]
#[allow(clippy::cast_possible_truncation, reason = "some millions")]
fn add_scene(tally: &mut Tally, scene: &Scene, addresses: &[PixelAddress], pixels: &[Pixel]) {
    let signals = addresses
        .iter()
        .map(|&address| scene.rates(address, 0).signal);
    let signals: Vec<f64> = signals.collect();
    let events: Vec<f64> = pixels
        .iter()
        .map(|pixel| pixel.positions.len() as f64)
        .collect();
    let correlation = rank_correlation(&signals, &events).unwrap_or_default();
    add_value(
        tally,
        "rank correlation",
        (correlation * MILLION).round() as i64,
    );
    let estimates: [fn(&Pixel) -> f64; 2] = [
        |pixel| pixel.positions.len() as f64,
        |pixel| pixel.counts as f64 / pixel.exposed as f64,
    ];
    for (name, estimate) in ESTIMATES.into_iter().zip(estimates) {
        // Estimate over truth, up to one scale for all.
        let ratios: Vec<(usize, f64)> = addresses
            .iter()
            .zip(pixels)
            .filter(|(_, pixel)| !pixel.positions.is_empty())
            .filter_map(|(&address, pixel)| {
                let surface = scene.truth(address, 0)?.surface;
                let Light::Reflectivity(truth) = scene.surfaces[surface].light else {
                    return None;
                };
                let z = mean_of_last(&pixel.positions, MEAN_OF) / PER_BIN as f64;
                Some((surface, estimate(pixel) * z * z / truth))
            })
            .collect();
        let (scale, error) = common_scale(ratios.iter().map(|(_, ratio)| *ratio));
        add_value(tally, name, (error * MILLION).round() as i64);
        for (surface, ratio) in ratios {
            let name = format!("{}, {name}", scene.surfaces[surface].name);
            add_value(tally, &name, (ratio * scale * 1000.0).round() as i64);
        }
    }
}

/// How the reflectivity is estimated, before it is multiplied by z².
const ESTIMATES: [&str; 2] = ["events × z²", "count rate × z²"];

/// The scale that brings `ratios` nearest to 1, and their root mean square
/// distance from 1 then.
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

/// Every surface of a point with its mean signal photons a laser cycle.
fn surfaces(point: &PointTally) -> Result<Vec<(String, f64)>> {
    let scene = scene(&point.parameters)?;
    let mut sums = vec![(0.0, 0.0); scene.surfaces.len()];
    for address in (0..32 * 16).map(PixelAddress) {
        if let Some(view) = scene.truth(address, 0) {
            let (sum, count) = &mut sums[view.surface];
            *sum += scene.rates(address, 0).signal;
            *count += 1.0;
        }
    }
    let names = scene.surfaces.into_iter().map(|surface| surface.name);
    Ok(names
        .zip(sums)
        .map(|(name, (sum, count))| (name, sum / count))
        .collect())
}

/// A chart over the signal of every surface: a series of dots of each of `names`,
/// measured by `y` for the tally `"surface, name"`.
fn by_signal(
    part: &Part,
    title: &str,
    y_axis: (&str, bool),
    names: &[&str],
    y: impl Fn(&PointTally, &str) -> Measured,
) -> Result<String> {
    let mut series = Vec::new();
    for (colour, &name) in names.iter().enumerate() {
        let mut points = Vec::new();
        for point in part.points() {
            for (surface, signal) in surfaces(point)? {
                let measured = y(point, &format!("{surface}, {name}"));
                points.push(chart::Point {
                    x: signal,
                    y: measured.value,
                    interval: Some(measured.interval),
                });
            }
        }
        // Without an event there is nothing to draw.
        points.retain(|point| point.y.is_finite());
        series.push(Series {
            name: Some(name.to_owned()),
            colour,
            style: Style::Dots,
            points,
        });
    }
    line_chart(&Chart {
        title,
        x: Axis {
            label: "signal photons a laser cycle, mean of a surface",
            logarithmic: true,
            range: None,
        },
        y: Axis {
            label: y_axis.0,
            logarithmic: y_axis.1,
            range: None,
        },
        series,
    })
}

fn results(part: &Part) -> Result<Results> {
    let events = by_signal(
        part,
        "Events of a pixel in 10,000 laser cycles",
        ("events", false),
        &["events"],
        Measured::mean,
    )?;
    let depth = by_signal(
        part,
        "Depth error",
        ("root mean square error, bins", true),
        &DEPTHS,
        |point, name| {
            Measured::root_mean_square(point, &[name.to_owned()]).times(1.0 / parts_a_bin())
        },
    )?;
    let reflectivity = by_signal(
        part,
        "Reflectivity from events",
        ("estimate over truth", false),
        &ESTIMATES,
        |point, name| Measured::mean(point, name).times(1e-3),
    )?;
    let about = format!(
        "every surface of `{}` and `{}` at 32×16 pixels, at α = 8, L1 = 100, L2 = 2000, X = 10 and 10,000 laser cycles; \
         {} pixels a scene",
        SCENES[0],
        SCENES[1],
        grouped(512 * part.seed_count())
    );
    let figure = |name, svg, text: &str| Figure {
        name,
        svg,
        caption: format!("{text}: {about}"),
    };
    Ok(Results {
        figures: vec![
            figure(
                "static-events",
                events,
                "Events of a pixel, mean, by the signal it receives",
            ),
            figure(
                "static-depth",
                depth,
                "Depth errors of pixels with ten events or more, those beyond three bins left out: a frame of \
                 2000 laser cycles, the last event, the mean of the last ten",
            ),
            figure(
                "static-reflectivity",
                reflectivity,
                "Reflectivity over the truth after one scale for the scene, of pixels with an event: the number of \
                 events times z² as in the paper, and peak counts less background over exposure, times z²",
            ),
        ],
        claims: claims(part)?,
    })
}

#[allow(clippy::cast_precision_loss, reason = "256")]
fn parts_a_bin() -> f64 {
    PER_BIN as f64
}

/// For each scene what `text` makes of it.
fn of_each(part: &Part, text: impl Fn(&PointTally) -> Result<String>) -> Result<String> {
    let texts: Result<Vec<String>> = part.points().iter().map(text).collect();
    Ok(texts?.join("; demo scene: "))
}

fn claims(part: &Part) -> Result<Vec<Claim>> {
    let sum = |name: &str| {
        part.points()
            .iter()
            .map(|point| point.count(name))
            .sum::<u64>()
    };
    let [by_100, by_109, at_110] = [100, 109, 110].map(|by| sum(&format!("events by {by}")));
    let correlations = part
        .points()
        .iter()
        .map(|point| Measured::mean(point, "rank correlation"));
    let lowest = correlations
        .map(|measured| measured.interval.0 / MILLION)
        .fold(1.0, f64::min);
    // Root mean square error of a depth of all surfaces.
    let error = |point: &PointTally, depth: &str| -> Result<Measured> {
        let names = surfaces(point)?
            .into_iter()
            .map(|(surface, _)| format!("{surface}, {depth}"));
        Ok(Measured::root_mean_square(
            point,
            &names.collect::<Vec<_>>(),
        ))
    };
    let ratio = |point: &PointTally, depth: &str| -> Result<Measured> {
        Ok(error(point, depth)?.over(error(point, DEPTHS[0])?))
    };
    let ratios = |depth: &str| -> Result<Vec<Measured>> {
        part.points()
            .iter()
            .map(|point| ratio(point, depth))
            .collect()
    };
    let depths = |depth: &'static str| {
        of_each(part, |point| {
            let bins = |depth| Ok::<_, anyhow::Error>(error(point, depth)?.value / parts_a_bin());
            let surfaces = surfaces(point)?;
            let beyond = surfaces
                .iter()
                .map(|(surface, _)| point.count(&format!("{surface}, {depth} false")));
            Ok(format!(
                "{:.3} bin, frame {:.3}: {} times; {} beyond three bins",
                bins(depth)?,
                bins(DEPTHS[0])?,
                ratio(point, depth)?.text(2),
                beyond.sum::<u64>()
            ))
        })
    };
    let errors = |name: &str| -> Vec<Measured> {
        let points = part.points().iter();
        points
            .map(|point| Measured::mean(point, name).times(100.0 / MILLION))
            .collect()
    };
    let worst = errors(ESTIMATES[0])
        .iter()
        .map(|error| error.value)
        .fold(0.0, f64::max);
    Ok(vec![
        Claim {
            claim: "no event before laser cycle 100 (section III-B)",
            paper: "an empty region, due to L1 = 100",
            here: format!(
                "{by_100} of {} events by 100, {by_109} by 109, {} at 110",
                grouped(sum("events of all pixels")),
                grouped(at_110)
            ),
            verdict: Verdict::of(by_100 == 0 && by_109 == 0 && at_110 > 0),
            why: "N must exceed L1; the first such look with X = 10 is at 110",
        },
        Claim {
            claim: "bright pixels report more often (section III-B)",
            paper: "\"a clear correlation\"",
            here: format!(
                "rank correlation of events with the signal {}",
                of_each(part, |point| {
                    Ok(Measured::mean(point, "rank correlation")
                        .times(1.0 / MILLION)
                        .text(3))
                })?
            ),
            verdict: if lowest > 0.8 {
                Verdict::Agrees
            } else if lowest > 0.5 {
                Verdict::Differs
            } else {
                Verdict::Refuted
            },
            why: "ties lower it: pixels of one board receive the same, and no pixel can report more often than every 110 laser cycles",
        },
        Claim {
            claim: "the last event is noisier than the frame of 2000 laser cycles (section III-B)",
            paper: "\"noisier\"",
            here: depths(DEPTHS[1])?,
            verdict: Verdict::of(
                ratios(DEPTHS[1])?
                    .iter()
                    .all(|ratio| ratio.interval.0 > 1.0),
            ),
            why: "an event has as many photons as it takes, a frame all; root mean square errors of pixels with ten events",
        },
        Claim {
            claim: "the mean of ten events is comparable to the frame (section III-B)",
            paper: "\"comparable\"",
            here: depths(DEPTHS[2])?,
            // Within half as much again.
            verdict: match ratios(DEPTHS[2])?
                .iter()
                .map(|ratio| ratio.value)
                .fold(0.0, f64::max)
            {
                worst if worst <= 1.5 => Verdict::Agrees,
                worst if worst <= 2.0 => Verdict::Differs,
                _ => Verdict::Refuted,
            },
            why: "agrees if the error is at most half as much again; ten events of a dim pixel are exposed longer than one frame, those of a bright one about half as long",
        },
        Claim {
            claim: "events × z² gives the relative reflectivity (section III-B)",
            paper: "a map, no number",
            here: format!(
                "rms error after one scale {}",
                of_each(part, |point| {
                    let percent = |name| Measured::mean(point, name).times(100.0 / MILLION).text(1);
                    let without = surfaces(point)?
                        .into_iter()
                        .map(|(surface, _)| point.count(&format!("{surface} without an event")));
                    Ok(format!(
                        "{} % (by counts and exposure {} %), {} pixels without an event",
                        percent(ESTIMATES[0]),
                        percent(ESTIMATES[1]),
                        grouped(without.sum())
                    ))
                })?
            ),
            verdict: match worst {
                worst if worst < 10.0 => Verdict::Agrees,
                worst if worst < 25.0 => Verdict::Differs,
                _ => Verdict::Refuted,
            },
            why: "events grow with the square of the signal while the background limits, and stop growing at one every 110 laser cycles; peak count less background over exposure, which every event carries, is linear",
        },
    ])
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
}
