//! The depth of events that neighbours confirmed, from all photons or the pixel's own, where the surface
//! is not flat.

use super::light::Light;
use super::setting::{BINS, SIGMA, X, window_rule};
use crate::sweep::charts::{joined, joined_key, panel};
use crate::sweep::mean::{Measured, add, add_error};
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid, numbers, whole};
use anyhow::{Context, Result};
use dtof_core::fixed::types::{U8F8, U24F8};
use dtof_core::neighbours::NeighbourConfig;
use dtof_core::rule::DecisionInput;
use dtof_core::{
    Array, ArrayConfig, BinIndex, BinPosition, Count, Count10, CounterWidth, DepthEstimator,
    DepthEvent, Flags, Histogram, Neighbours, Peak, PixelArray, PixelConfig, PixelData, PixelPlace,
    WindowRule,
};
use dtof_draw::chart::{Axis, Chart};
use dtof_draw::palette::{EVENTS, PAPER, Pen};
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;
use std::fmt::Write as _;

const L2: u16 = 2000;
/// Photons a bin and laser cycle, and those of the surface a laser cycle.
const BACKGROUND: f64 = 0.01;
const SIGNAL: f64 = 0.1;
/// Bins from a pixel to the next, or of a step.
const SIZES: [f64; 8] = [0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 6.0];
/// Events of a trial.
const EVENTS_OF_TRIAL: u64 = 100;
/// The pixel in the middle of 3 x 3.
const MIDDLE: usize = 4;
/// An event farther off is wrong, in 1/256 bin.
const WRONG: i64 = 3 * 256;
/// Where the others see the surface, in bins behind the middle: column and row of 0 to 2, and the size.
type Shape = fn(f64, f64, f64) -> f64;
const SHAPES: [(&str, Shape); 3] = [
    ("slope, bins a pixel", |column, _, size| {
        (column - 1.0) * size
    }),
    ("step beside it, bins", |column, _, size| {
        if column > 1.0 { size } else { 0.0 }
    }),
    ("one pixel before a wall, bins", |column, row, size| {
        if (column, row) == (1.0, 1.0) {
            0.0
        } else {
            size
        }
    }),
];
const WAYS: [(&str, Pen); 2] = [("all", EVENTS), ("own", PAPER)];

/// Errors of confirmed events over slopes and steps.
pub const STUDY: Study = Study {
    name: "confirmed-depth",
    about: "depth of confirmed events from all photons and from the pixel's own, over slopes and steps",
    revision: 1,
    few_seeds: 2,
    all_seeds: 40,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    grid([("shape", &numbers(SHAPES.len())), ("size", &SIZES)])
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let mut tally = Tally::new();
    let (_, shape) = SHAPES[usize::from(whole(point, "shape"))];
    let array = Array::new(3, 3).context("no array")?;
    let neighbours = NeighbourConfig::new(array, Neighbours::Eight, &window_rule(X, L2)?);
    let estimator = DepthEstimator::for_pulse(U8F8::from_num(SIGMA));
    let config = PixelConfig::with_rule(*neighbours.rule().own())
        .x(X)
        .l1(X)
        .l2(L2)
        .estimator(estimator)
        .build()?;
    let mut events = 0;
    while events < EVENTS_OF_TRIAL {
        let place = Uniform::new(60.0, 61.0)?.sample(rng);
        let lights = (0..9).map(|number| {
            let [column, row] = [number % 3, number / 3].map(f64::from);
            let place = place + shape(column, row, point["size"]);
            Light::new(BACKGROUND, &[(SIGNAL, place)])
        });
        let lights = lights.collect::<Result<Vec<_>>>()?;
        let Some((event, own)) = confirmed(&lights, &config, &neighbours, rng) else {
            // It reports by itself, or not in time.
            add(&mut tally, "other", "events", 1);
            continue;
        };
        events += 1;
        let positions = [event.position(), own];
        for ((way, _), position) in WAYS.into_iter().zip(positions) {
            #[allow(clippy::cast_possible_truncation, reason = "a bin of 128")]
            let error = i64::from(position.raw()) - (256.0 * place).round() as i64;
            if error.abs() > WRONG {
                add(&mut tally, way, "wrong", 1);
            } else {
                add_error(&mut tally, way, error);
            }
        }
    }
    Ok(tally)
}

/// The first event of the pixel in the middle, and where its own photons are, if neighbours confirmed it.
fn confirmed(
    lights: &[Light],
    config: &PixelConfig<BINS, WindowRule>,
    neighbours: &NeighbourConfig,
    rng: &mut Pcg64,
) -> Option<(DepthEvent, BinPosition)> {
    let config = ArrayConfig::new(*neighbours.array(), *config);
    let config = config.neighbours(*neighbours).ok()?;
    let mut places: [PixelPlace<BINS, Count10, Decided>; 9] = Default::default();
    let mut array = PixelArray::new(&mut places, &mut []);
    array.configure(&config).ok()?;
    for _ in 1..=L2 {
        for (number, light) in lights.iter().enumerate() {
            let codes = light.draw(rng);
            codes.iter().for_each(|&code| array.photon(number, code));
        }
        array.end_laser_cycle();
        while let Some(event) = array.next_event() {
            let counts = std::mem::take(&mut array.data_of(&event)?.0);
            if usize::from(event.pixel.raw()) == MIDDLE {
                let own = own_position(config.pixels(), &counts, event.peak_bin.raw());
                return event
                    .flags
                    .contains(Flags::CONFIRMED)
                    .then_some((event, own));
            }
        }
    }
    None
}

/// The photons from which a pixel decided its last event.
#[derive(Default)]
struct Decided(Vec<u32>);

impl PixelData for Decided {
    fn decided_from<const B: usize, W: CounterWidth>(&mut self, input: &DecisionInput<'_, B, W>) {
        let counts = input.histogram.counts().iter();
        self.0 = counts.map(|&count| count.into()).collect();
    }
}

/// Where the photons of one pixel are, of those within two bins of `about`.
fn own_position(config: &PixelConfig<BINS, WindowRule>, counts: &[u32], about: u16) -> BinPosition {
    let mut histogram = Histogram::<BINS>::new();
    for (bin, &count) in (0..).zip(counts) {
        (0..count).for_each(|_| histogram.add(bin));
    }
    let bins = about.saturating_sub(2)..=(about + 2).min(config.gate().last());
    let mut peak = Peak::default();
    for bin in bins {
        let count = Count::saturating(histogram.count(bin.into()).unwrap_or(0));
        if count > peak.count {
            peak = Peak {
                bin: BinIndex::saturating(bin),
                count,
            };
        }
    }
    let depth = config
        .estimator()
        .estimate(&histogram, config.gate(), peak, U24F8::ZERO);
    BinPosition::of(peak.bin, depth.offset)
}

fn results(part: &Part) -> Result<Results> {
    let mut csv =
        "shape,size,depth of,rms bins,rms_low,rms_high,mean bins,mean_low,mean_high,wrong,confirmed,by itself\n"
            .to_owned();
    let mut panels = Vec::new();
    let rms =
        |point: &PointTally, way: &str| Measured::root_mean_square(point, way).times(1.0 / 256.0);
    for ((name, _), shape) in SHAPES.iter().zip(0u8..) {
        let mut series = Vec::new();
        for (way, pen) in WAYS {
            let shape = [("shape", shape.into())];
            for point in part.at(shape) {
                let mean = Measured::mean(point, way).times(1.0 / 256.0);
                let [wrong, values] =
                    ["wrong", "values"].map(|what| point.count(&format!("{way} {what}")));
                writeln!(
                    csv,
                    "\"{name}\",{},{way},{},{},{wrong},{},{}",
                    point.parameter("size"),
                    rms(point, way).cells(3),
                    mean.cells(3),
                    wrong + values,
                    point.count("other events")
                )?;
            }
            let dots = part.dots(shape, "size", |point| rms(point, way));
            series.push(joined(pen, dots));
        }
        panels.push(panel(*name, series));
    }
    let at = |shape, size| part.one([("shape", shape), ("size", size)]);
    let both = |shape, size| ["all", "own"].map(|way| rms(at(shape, size), way).interval);
    let better = |shape, size| {
        let [all, own] = both(shape, size);
        all.1 < own.0
    };
    let worse = |shape, size| {
        let [all, own] = both(shape, size);
        own.1 < all.0
    };
    let holds = better(0.0, 0.0) && better(0.0, 1.0) && better(1.0, 1.0) && worse(2.0, 2.0);
    let kept = 1.0 - Measured::mean(at(2.0, 1.5), "all").value / 256.0 / 1.5;
    let far = at(2.0, 6.0);
    let [wrong, right, alone] =
        ["all wrong", "all values", "other events"].map(|name| far.count(name));
    let at_wall = Measured::share(wrong, wrong + right + alone);
    let chart = Chart {
        finding: "Pooled photons blur small things only".to_owned(),
        holds,
        note: format!(
            "Root mean square errors of confirmed events up to 3 bins off, of the middle of 3 x 3 pixels; 8 neighbours. {SIGNAL} \
             signal photons a laser cycle and {BACKGROUND} of background a bin. The pulse has a standard deviation of {SIGMA} bins. Bars hold 99 %."
        ),
        x: Axis::linear("size, bins"),
        y: Axis::linear("rms error, bins"),
        key: vec![
            joined_key(EVENTS, "all photons of the pixels"),
            joined_key(PAPER, "the pixel's own photons"),
        ],
        columns: 2,
        panels,
    };
    Ok(Results {
        figures: vec![Figure::new("confirmed-depth", &chart)?],
        values: [
            ("events", (EVENTS_OF_TRIAL * STUDY.all_seeds).to_string()),
            ("kept", format!("{:.0}", 100.0 * kept)),
            ("at wall", format!("{:.1}", 100.0 * at_wall.value)),
        ]
        .into(),
        tables: vec![("results/data/confirmed_depth.csv", csv)],
        ..Results::default()
    })
}
