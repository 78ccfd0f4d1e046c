//! Dim pixels of an array: by themselves, confirmed by neighbours, or together in blocks.

use super::scene_file::{DEMO, DIM_TILTED_WALL, FAN, RADIAL, STATIC, SceneFile, TILTED_WALL};
use super::setting::{BINS, ONE_IN, Setting, X};
use super::simulated_array::is_right;
use crate::sweep::charts::{joined, joined_key, panel};
use crate::sweep::mean::{Measured, add, add_error};
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid, numbers, whole};
use anyhow::{Context, Result, ensure};
use dtof_core::binning::Block;
use dtof_core::rule::z_for_levels;
use dtof_core::{Neighbours, PixelPlace, RangeGate};
use dtof_data::options::rows::significant;
use dtof_data::photons::source::PhotonSource;
use dtof_draw::chart::{Axis, Chart, Point as Dot};
use dtof_draw::palette::{Pen, STEPS};
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use rand_core::Rng;
use rand_pcg::Pcg64;
use std::fmt::Write as _;
use std::mem::size_of;

/// By number: all files with an array, and dim ones.
const SCENES: [SceneFile; 7] = [
    FAN,
    RADIAL,
    STATIC,
    TILTED_WALL,
    DEMO,
    STATIC.dimmed("dim static", 0.2),
    DIM_TILTED_WALL,
];
const DIM_WALL: usize = 6;

/// A way in which the pixels of an array work together.
struct Way {
    name: &'static str,
    neighbours: Option<Neighbours>,
    /// Levels of blocks, and their patience.
    blocks: Option<(u8, u16)>,
    pen: Pen,
    /// Its operations in the table of instructions.
    look: &'static str,
    photon: &'static str,
}

const PHOTON: &str = "array";
const PHOTON_OF_BLOCKS: &str = "array with blocks; 2 levels";
const LOOK: &str = "look; array; no event";

const NEITHER: Way = Way {
    name: "neither",
    neighbours: None,
    blocks: None,
    pen: STEPS[6],
    look: LOOK,
    photon: PHOTON,
};
const WITH_BLOCKS: Way = Way {
    name: "blocks",
    blocks: Some((2, 64)),
    pen: STEPS[5],
    photon: PHOTON_OF_BLOCKS,
    ..NEITHER
};
const WAYS: [Way; 5] = [
    NEITHER,
    Way {
        name: "4 neighbours",
        neighbours: Some(Neighbours::Four),
        pen: STEPS[1],
        look: "",
        ..NEITHER
    },
    Way {
        name: "8 neighbours",
        neighbours: Some(Neighbours::Eight),
        pen: STEPS[2],
        look: "look; array, 8 neighbours; no event",
        ..NEITHER
    },
    WITH_BLOCKS,
    Way {
        name: "blocks, patience 8",
        blocks: Some((2, 8)),
        pen: STEPS[0],
        ..WITH_BLOCKS
    },
];
const ALONE: usize = 0;
const EIGHT: usize = 2;
const BLOCKS: usize = 3;

/// A pixel may decide from its second look on.
const L1: u16 = X;
/// The longest exposure, and the laser cycles of a trial.
const L2: u16 = 2000;
const SLICE: u16 = 200;
/// Times are counted to this part of a factor of two.
const OCTAVE: f64 = 32.0;
/// The shares of the pixels that are waited for.
const SHARES: [f64; 4] = [0.5, 0.8, 0.9, 0.95];

/// The counted instructions of a Cortex-M4F.
const INSTRUCTIONS: &str = include_str!("../../../../docs/results/bench/instructions.csv");

/// Neighbours and blocks.
pub const STUDY: Study = Study {
    name: "neighbours",
    about: "time until most pixels are right: by themselves, with neighbours that confirm, and in blocks",
    revision: 1,
    few_seeds: 1,
    all_seeds: 8,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    // All ways decide on the same photons, so they are one trial.
    grid([("scene", &numbers(SCENES.len()))])
}

impl Way {
    fn settings(&self) -> Result<Settings> {
        let (levels, patience) = self.blocks.unwrap_or_default();
        let setting = Setting {
            patience,
            l2: L2,
            ..Setting::ALONE.with_levels(levels.into())?
        };
        let gate = RangeGate::<BINS>::full();
        let z = z_for_levels(ONE_IN, &gate, X, L1, L2, setting.levels);
        Ok(setting.settings(z)?.configured(|array| {
            (array.neighbours, array.l1) = (self.neighbours, L1);
        }))
    }

    /// The bytes of a pixel and its part of the blocks.
    fn bytes(&self) -> f64 {
        let pixel = size_of::<PixelPlace<BINS>>() as f64;
        let (levels, _) = self.blocks.unwrap_or_default();
        if levels == 0 {
            return pixel;
        }
        let blocks = (1..=i32::from(levels)).map(|level| 0.25f64.powi(level));
        pixel + blocks.sum::<f64>() * size_of::<Block<BINS>>() as f64
    }
}

/// What has happened to the pixels in one way.
struct Run {
    /// The laser cycles of the first right event of each pixel.
    first: Vec<Option<u64>>,
    right: u64,
    wrong: u64,
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let scene = SCENES[usize::from(whole(point, "scene"))].moved(rng)?;
    let mut photons = scene.photons(rng.next_u64(), L2.into())?;
    let (array, addresses) = (photons.array(), photons.addresses());
    let runs = WAYS.iter().map(|way| {
        let run = Run {
            first: vec![None; addresses.len()],
            right: 0,
            wrong: 0,
        };
        Ok((host_engine(&way.settings()?, array, &addresses)?, run))
    });
    let mut runs: Vec<_> = runs.collect::<Result<_>>()?;
    let mut tally = Tally::new();
    for _ in 0..L2 / SLICE {
        let slice = photons.next_slice(SLICE)?;
        for (way, (engine, run)) in WAYS.iter().zip(&mut runs) {
            for event in engine.run(&slice)? {
                for pixel in array.pixels_of(event.pixel, event.level) {
                    // A surface behind another one counts as right. A pixel without a surface cannot be right.
                    let views = scene.hits(pixel, event.cycle.raw()).into_iter().flatten();
                    let positions = views.map(|view| view.range_mm / scene.mm_per_bin());
                    let right = positions
                        .clone()
                        .find(|position| is_right(&event, *position));
                    let Some(position) = right else {
                        run.wrong += 1;
                        continue;
                    };
                    run.right += 1;
                    let first = &mut run.first[usize::from(pixel.raw())];
                    first.get_or_insert(event.cycle.raw() + 1);
                    // In 1/256 bins.
                    let error = f64::from(event.position().raw()) - 256.0 * position;
                    #[allow(clippy::cast_possible_truncation, reason = "within 3 bins")]
                    add_error(&mut tally, way.name, error.round() as i64);
                }
            }
        }
    }
    for (way, (_, run)) in WAYS.iter().zip(runs) {
        for first in run.first.into_iter().flatten() {
            let place = (OCTAVE * (first as f64).log2()).round();
            add(&mut tally, way.name, &format!("first {place}"), 1);
        }
        add(&mut tally, way.name, "right", run.right);
        add(&mut tally, way.name, "wrong", run.wrong);
    }
    tally.insert("pixels".to_owned(), addresses.len() as u64);
    Ok(tally)
}

/// The laser cycles until this share of the pixels has been right, if it is reached.
fn time(point: &PointTally, way: &Way, share: f64) -> Option<f64> {
    let wanted = share * point.count("pixels") as f64;
    let mut right = 0;
    let last = (OCTAVE * f64::from(L2).log2()).ceil();
    for place in (0u16..).map(f64::from).take_while(|&place| place <= last) {
        right += point.count(&format!("{} first {place}", way.name));
        if right as f64 >= wanted {
            return Some((place / OCTAVE).exp2());
        }
    }
    None
}

/// Counted instructions.
fn counted(operation: &str) -> Result<f64> {
    let mut rows = INSTRUCTIONS.lines();
    let row = rows.find(|row| row.contains(&format!(",{operation},3,")));
    let row = row.with_context(|| format!("no {operation} among the instructions"))?;
    Ok(row.rsplit(',').next().unwrap_or_default().parse()?)
}

fn costs() -> Result<String> {
    let mut table = String::new();
    for way in &WAYS {
        let look = match way.look {
            "" => "not counted".to_owned(),
            look => {
                let levels = way.blocks.map_or(0.0, |_| 0.25 + 0.0625);
                let blocks = levels * counted("look; block; no event")?;
                format!("{:.0}", counted(look)? + blocks)
            }
        };
        writeln!(
            table,
            "| {} | {:.0} | {look} | {:.0} |",
            way.name,
            counted(way.photon)?,
            way.bytes()
        )?;
    }
    Ok(table)
}

fn results(part: &Part) -> Result<Results> {
    let mut csv = "scene,way,pixels,cycles 50 %,80 %,90 %,95 %,right,wrong,rms mm\n".to_owned();
    let mut table = String::new();
    let mut panels = Vec::new();
    for (file, point) in SCENES.iter().zip(part.points()) {
        let mm = file.parse()?.mm_per_bin() / 256.0;
        let mut series = Vec::new();
        for way in &WAYS {
            let times = SHARES.map(|share| time(point, way, share));
            let [right, wrong] =
                ["right", "wrong"].map(|what| point.count(&format!("{} {what}", way.name)));
            let rms = Measured::root_mean_square(point, way.name).value * mm;
            let cells = times.map(|time| time.map_or("-".to_owned(), |time| format!("{time:.0}")));
            writeln!(
                table,
                "| {} | {} | {} | {:.2} % | {} |",
                file.name,
                way.name,
                cells.join(" | "),
                100.0 * Measured::share(wrong, right + wrong).value,
                significant(rms, 3)
            )?;
            writeln!(
                csv,
                "{},\"{}\",{},{},{right},{wrong},{rms:.3}",
                file.name,
                way.name,
                point.count("pixels"),
                cells.join(",").replace('-', "")
            )?;
            let dots = SHARES.iter().zip(times);
            let dots = dots.filter_map(|(share, time)| Some(Dot::exact(time?, 100.0 * share)));
            let curve = joined(way.pen, dots);
            if !curve.points.is_empty() {
                series.push(curve);
            }
        }
        panels.push(panel(file.name, series));
    }
    let dim = &part.points()[DIM_WALL];
    let of = |way: usize, share| time(dim, &WAYS[way], share);
    let alone = of(ALONE, 0.9);
    let times = |way| {
        let both = alone.zip(of(way, 0.9));
        both.map_or(0.0, |(alone, other)| alone / other)
    };
    let [eight, blocks] = [EIGHT, BLOCKS].map(times);
    let chart = Chart {
        finding: "On a dim wall 8 neighbours nearly halve the time".to_owned(),
        holds: (1.7..2.1).contains(&eight),
        note: format!(
            "A dot is the time until 50, 80, 90 or 95 % of the pixels have had a right event, their own or that of \
             their block. A curve ends where fewer have had one in 2,000 laser cycles. On the dim tilted wall blocks are \
             {blocks:.1} times as fast as pixels alone."
        ),
        x: Axis::logarithmic("laser cycles"),
        y: Axis::linear("pixels that are right, %").within(50.0, 100.0),
        key: WAYS
            .iter()
            .map(|way| joined_key(way.pen, way.name))
            .collect(),
        columns: 2,
        panels,
    };
    let pixel = size_of::<PixelPlace<BINS>>();
    ensure!(pixel == 332, "a pixel takes {pixel} bytes here");
    Ok(Results {
        figures: vec![Figure::new("neighbours", &chart)?],
        values: [("table", table), ("costs", costs()?)].into(),
        tables: vec![("results/data/neighbours.csv", csv)],
        ..Results::default()
    })
}
