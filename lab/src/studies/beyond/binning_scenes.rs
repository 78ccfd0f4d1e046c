//! Reports of blocks in scenes from files: the share of wrong ones, and the events that pixels
//! lose.

use super::scene_file::{DEMO, DIM_TILTED_WALL, FAN, RADIAL, SceneFile, TILTED_WALL};
use super::setting::{LEVELS, Setting, VERDICT_HEAD, levels_name};
use super::simulated_array::{Reports, is_right};
use crate::sweep::charts::{joined, joined_key, panel};
use crate::sweep::mean::Measured;
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid, numbers, whole};
use anyhow::{Context, Result};
use dtof_core::DepthEvent;
use dtof_data::options::rows::grouped;
use dtof_data::photons::source::PhotonSource;
use dtof_draw::chart::{Axis, Chart};
use dtof_draw::palette::{EVENTS, PAPER};
use dtof_engine::host::host_engine;
use dtof_light::scene::{Scene, Shape};
use rand_core::Rng;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;
use std::fmt::Write as _;

/// By number, with the laser cycles of a trial. The tilted wall is too bright for many reports of
/// blocks, so there is a dim one as well.
const SCENES: [(SceneFile, u64); 5] = [
    (FAN, 20_000),
    (RADIAL, 40_000),
    (TILTED_WALL, 5000),
    (DIM_TILTED_WALL, 5000),
    (DEMO, 4000),
];
/// The tilted wall of the file, and the scenes of the title.
const BRIGHT: usize = 2;
const SLANT: usize = 3;
const OF_DEMO: usize = 4;
/// Blocks with fewer reports are not drawn: their share is uncertain.
const MIN_REPORTS: u64 = 1000;
/// The longest exposure, and the default patience.
const L2: u16 = 2000;
const PATIENCE: u16 = 64;
/// Laser cycles to settle.
const BEFORE: u64 = 1000;
const SLICE: u16 = 200;

/// Wrong reports of pixels and of blocks.
pub const STUDY: Study = Study {
    name: "binning-scenes",
    about: "wrong reports of pixels and blocks in scenes of files, and the events that pixels keep",
    revision: 2,
    few_seeds: 1,
    all_seeds: 12,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    // All levels of a scene have the same photons, and so the same trial.
    grid([("scene", &numbers(SCENES.len()))])
}

/// The scene of the file at a random distance. The centre of a fan is random, too.
fn scene(file: &SceneFile, rng: &mut Pcg64) -> Result<Scene> {
    let unit = Uniform::new(0.0, 1.0)?;
    let mut scene = file.moved(rng)?;
    for surface in &mut scene.surfaces {
        if let Shape::Fan(fan) = &mut surface.shape {
            fan.centre = fan.centre.map(|place| place + unit.sample(rng) - 0.5);
        }
    }
    Ok(scene)
}

/// Pixels covered by right and wrong reports, by level.
type Counts = [[u64; 4]; 2];

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let (file, cycles) = &SCENES[usize::from(whole(point, "scene"))];
    let scene = scene(file, rng)?;
    let mut photons = scene.photons(rng.next_u64(), *cycles)?;
    let (array, addresses) = (photons.array(), photons.addresses());
    let mut runs = Vec::new();
    for levels in LEVELS {
        let setting = Setting {
            patience: PATIENCE,
            l2: L2,
            ..Setting::ALONE.with_levels(levels)?
        };
        let engine = host_engine(&setting.settings(setting.z())?, array, &addresses)?;
        runs.push((engine, Reports::new(array), Counts::default()));
    }
    // A surface behind another one counts as right. A pixel without a surface cannot be right.
    let is_wrong = |event: &DepthEvent, pixel: usize| {
        let views = scene.hits(addresses[pixel], event.cycle.raw());
        let mut views = views.into_iter().flatten();
        !views.any(|view| is_right(event, view.range_mm / scene.mm_per_bin()))
    };
    for _ in 0..cycles / u64::from(SLICE) {
        let slice = photons.next_slice(SLICE)?;
        for (engine, reports, counts) in &mut runs {
            for event in engine.run(&slice)? {
                for pixel in reports.take(&event) {
                    if event.cycle.raw() >= BEFORE {
                        let verdict = usize::from(is_wrong(&event, pixel));
                        counts[verdict][usize::from(event.level.raw())] += 1;
                    }
                }
            }
        }
    }
    let mut tally = Tally::new();
    for (levels, (_, _, counts)) in LEVELS.into_iter().zip(runs) {
        for (verdict, counts) in ["right", "wrong"].into_iter().zip(counts) {
            for (level, count) in counts.into_iter().enumerate() {
                tally.insert(format!("{levels} {verdict} {level}"), count);
            }
        }
    }
    let cycles = (cycles - BEFORE) * addresses.len() as u64;
    tally.insert("cycles".to_owned(), cycles);
    Ok(tally)
}

/// A scene with this many levels.
struct SceneOutcome {
    /// The share of wrong reports of single pixels.
    own_wrong: Measured,
    /// Pixels covered by reports of blocks, and the wrong share.
    blocks: u64,
    blocks_wrong: Measured,
    /// Right reports of single pixels relative to a run without blocks.
    kept: f64,
    /// Laser cycles of a pixel per right report.
    between: f64,
    counts: Counts,
}

impl SceneOutcome {
    fn new(point: &PointTally, levels: f64) -> Self {
        let count = |levels: f64, verdict: &str, level: usize| {
            point.count(&format!("{levels} {verdict} {level}"))
        };
        let of = |verdict| [0, 1, 2, 3].map(|level| count(levels, verdict, level));
        let [right, wrong] = ["right", "wrong"].map(of);
        let of_blocks = |counts: [u64; 4]| -> u64 { counts[1..].iter().sum() };
        let blocks = of_blocks(right) + of_blocks(wrong);
        Self {
            own_wrong: Measured::share(wrong[0], right[0] + wrong[0]),
            blocks,
            blocks_wrong: Measured::share(of_blocks(wrong), blocks),
            kept: right[0] as f64 / count(0.0, "right", 0) as f64,
            between: point.count("cycles") as f64 / right.iter().sum::<u64>() as f64,
            counts: [right, wrong],
        }
    }
}

fn percent(share: f64) -> String {
    format!("{:.1}", 100.0 * share)
}

fn results(part: &Part) -> Result<Results> {
    let mut csv = format!("scene,levels,cycles,{VERDICT_HEAD}\n");
    let mut table = String::new();
    let mut panels = Vec::new();
    let mut least_kept = f64::INFINITY;
    for ((file, _), point) in SCENES.iter().zip(part.points()) {
        let (mut own, mut of_blocks) = (Vec::new(), Vec::new());
        for levels in LEVELS {
            let outcome = SceneOutcome::new(point, levels);
            own.push(outcome.own_wrong.at(levels));
            let wrong = outcome.blocks_wrong;
            if outcome.blocks >= MIN_REPORTS {
                of_blocks.push(wrong.at(levels));
            }
            least_kept = least_kept.min(outcome.kept);
            let counts = outcome.counts.iter().flatten();
            let cells: Vec<String> = counts.map(u64::to_string).collect();
            let cycles = point.count("cycles");
            writeln!(csv, "{},{levels},{cycles},{}", file.name, cells.join(","))?;
            writeln!(
                table,
                "| {} | {} | {} % | {} | {} | {} % | {:.1} |",
                file.name,
                levels_name(levels),
                percent(outcome.own_wrong.value),
                grouped(outcome.blocks),
                if outcome.blocks > 0 {
                    format!("{} %", percent(wrong.value))
                } else {
                    "-".to_owned()
                },
                percent(outcome.kept),
                outcome.between,
            )?;
        }
        if !of_blocks.is_empty() {
            let series = [joined(EVENTS, own), joined(PAPER, of_blocks)];
            panels.push(panel(file.name, series));
        }
    }
    let of = |scene: usize, levels| SceneOutcome::new(&part.points()[scene], levels);
    let wrong = |scene, levels| percent(of(scene, levels).blocks_wrong.value);
    let [slant, demo] = [SLANT, OF_DEMO].map(|scene| wrong(scene, 2.0));
    let chart = Chart {
        finding: format!(
            "Of what two levels of blocks report {slant} % is wrong on a dim tilted wall, {demo} % in the demo's \
             scene; of three levels {} and {} %",
            wrong(SLANT, 3.0),
            wrong(OF_DEMO, 3.0)
        ),
        holds: least_kept >= 0.95,
        note: format!(
            "Farther than 3 bins from what the pixel sees, of all pixels that a report stands for. Patience \
             {PATIENCE}; bars hold 99 % as if reports were independent. Scenes whose blocks have fewer than {MIN_REPORTS} reports are left out."
        ),
        x: Axis::linear("levels of blocks").within(0.0, 3.0),
        y: Axis::linear("wrong, %").percent(),
        key: vec![
            joined_key(EVENTS, "of a pixel's own events"),
            joined_key(PAPER, "of reports by blocks"),
        ],
        columns: 3,
        panels,
    };
    let bright = of(BRIGHT, 2.0);
    let [all, wrong] = [&bright.counts[..], &bright.counts[1..]]
        .map(|counts| counts.iter().flatten().sum::<u64>());
    let cycles = SCENES.iter().map(|(_, cycles)| cycles - BEFORE).min();
    Ok(Results {
        figures: vec![Figure::new("binning-scenes", &chart)?],
        values: [
            ("table", table),
            ("kept", percent(least_kept)),
            ("bright", grouped(all)),
            ("bright blocks", grouped(bright.blocks)),
            ("bright wrong", grouped(wrong - bright.counts[1][0])),
            ("least", grouped(cycles.context("no scene")?)),
        ]
        .into(),
        tables: vec![("results/data/binning_scenes.csv", csv)],
        ..Results::default()
    })
}
