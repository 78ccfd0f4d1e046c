//! Scenes in which the pixel processor has to do what `dtof-core` does.

use std::env;
use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context, Result};
use dtof_core::fixed::types::U8F8;
use dtof_data::photons::tmf8820;

use crate::root;

use super::scene::{Bins, Events, Pixels, Recorded, Scene, config};

const PAPER: [u16; 3] = [4, 40, 2000];
const WHOLE: [u16; 2] = [0, 127];
const ALPHA: U8F8 = U8F8::lit("4");

/// The name of scenes with recorded photons.
pub const RECORDED: &str = "recorded photons";

/// Photons a clock, in 1/256.
const RATES: [(u32, &str); 4] = [
    (256, "the paper's setting, a photon a clock"),
    (128, "the paper's setting, one in two clocks"),
    (32, "the paper's setting, one in eight clocks"),
    (4, "the paper's setting, one in 64 clocks"),
];

/// The scenes, with about so many photons in all.
pub fn all(photons: u64) -> Result<Vec<Scene>> {
    let paper = config(PAPER, ALPHA, 5, WHOLE, false)?;
    let short = config([1, 1, 30], U8F8::lit("0.5"), 1, [3, 77], true)?;
    let bright = config([50, 400, 4000], U8F8::lit("2.25"), 20, WHOLE, true)?;
    let brighter = config([50, 2000, 6000], U8F8::lit("2.25"), 20, WHOLE, true)?;
    let every_other = config([2, 3, 50], U8F8::lit("1.5"), 2, [1, 126], false)?;
    let dim = config([7, 60, 64], U8F8::lit("255.99"), 0, [100, 127], false)?;
    let never = config([300, 60_000, 65_535], U8F8::MAX, 0, WHOLE, false)?;
    let rare = config([300, 60_000, 65_535], U8F8::lit("0"), 1000, WHOLE, false)?;
    let steep = config(PAPER, U8F8::lit("140"), 5, WHOLE, false)?;
    let many = config([4, 40, 4000], U8F8::lit("2"), 700, WHOLE, false)?;
    let each = photons / 17;
    let scene = |name, pixels_log2, config| Scene {
        length: each,
        ..Scene::new(name, pixels_log2, config)
    };
    let mut scenes = Vec::new();
    for (rate, name) in RATES {
        scenes.push(Scene {
            rate,
            length: each / 2,
            ..scene(name, 2, paper)
        });
    }
    scenes.extend([
        Scene {
            clocks: [1, 30],
            rate: 200,
            pixels: Pixels::Strays,
            link: 3,
            length: each,
            ..scene("a slow link, laser cycles of any length, strays", 2, paper)
        },
        Scene {
            bins: Bins::Target(256, 0),
            pixels: Pixels::InTurn,
            ..scene("all fire at once", 2, paper)
        },
        Scene {
            clocks: [1, 3],
            bins: Bins::Target(200, 1),
            ..scene("looks as often as there can be any", 2, short)
        },
        Scene {
            pixels: Pixels::OneForLong(100),
            bins: Bins::Target(250, 2),
            ..scene("one macropixel for long, in a few bins", 2, short)
        },
        Scene {
            clocks: [7, 9],
            bins: Bins::Target(240, 1),
            pixels: Pixels::OneForLong(40_000),
            ..scene("full counters", 2, bright)
        },
        Scene {
            bins: Bins::Target(255, 0),
            pixels: Pixels::InTurn,
            clocks: [3, 5],
            ..scene("full counters in all macropixels", 2, brighter)
        },
        Scene {
            bins: Bins::Target(250, 1),
            ..scene("exposures that end", 2, dim)
        },
        Scene {
            clocks: [1, 1],
            bins: Bins::Target(250, 1),
            // Exposures of more than 65,535 laser cycles.
            length: each.max(140_000),
            ..scene("long exposures", 2, rare)
        },
        Scene {
            clocks: [1, 1],
            length: each.max(140_000),
            ..scene("exposures that end late, with full counters", 2, never)
        },
        Scene {
            events: Events::Registers(3),
            bins: Bins::Target(60, 1),
            ..scene("the program takes the events", 2, paper)
        },
        Scene {
            events: Events::Registers(3),
            clocks: [1, 1],
            length: each.max(140_000),
            ..scene("the same, more than 2^16 laser cycles", 2, paper)
        },
        Scene {
            bins: Bins::Target(230, 0),
            length: each / 2,
            ..scene("an α of 140", 2, steep)
        },
        Scene {
            bins: Bins::Target(250, 0),
            length: each / 2,
            ..scene("peaks of 700 photons at least", 2, many)
        },
        Scene {
            events: Events::Registers(60),
            clocks: [5, 12],
            ..scene("a slow program", 2, short)
        },
        scene("the paper's setting", 1, paper),
        Scene {
            pixels: Pixels::Strays,
            ..scene("the paper's setting, strays", 4, paper)
        },
        scene("the paper's setting, a photon a clock", 4, paper),
        scene("the paper's setting, a photon a clock", 6, paper),
        Scene {
            bins: Bins::Target(256, 1),
            pixels: Pixels::InTurn,
            ..scene("all fire at once", 6, paper)
        },
        Scene {
            clocks: [12, 24],
            bins: Bins::Target(220, 1),
            ..scene("looks at every other laser cycle", 2, every_other)
        },
        Scene {
            reads: Some(9),
            clocks: [40, 90],
            rate: 180,
            bins: Bins::Target(220, 1),
            ..scene("the program reads histograms", 2, every_other)
        },
        Scene {
            reads: Some(8),
            clocks: [3, 5],
            bins: Bins::Target(240, 1),
            pixels: Pixels::OneForLong(40_000),
            ..scene("the program reads full counters", 2, brighter)
        },
    ]);
    if let Some(histograms) = recorded()? {
        let histograms = Arc::new(histograms);
        for (pixels_log2, rate) in [(2, 256), (4, 100)] {
            scenes.push(Scene {
                rate,
                bins: Bins::Recorded(Arc::clone(&histograms)),
                ..scene(RECORDED, pixels_log2, paper)
            });
        }
    }
    for (seed, scene) in (1..).zip(&mut scenes) {
        scene.seed = seed;
    }
    // Some twice, where they stay as they are.
    let restarts = vec![short, short, bright, paper, paper, every_other, dim];
    let restarted = |name, pixels_log2, seed| Scene {
        clocks: [1, 12],
        bins: Bins::Target(220, 1),
        pixels: Pixels::Strays,
        restarts: restarts.clone(),
        seed,
        ..scene(name, pixels_log2, paper)
    };
    scenes.extend([
        Scene {
            link: 20,
            length: 2 * each,
            ..restarted("stopped and started at any time", 2, 101)
        },
        Scene {
            events: Events::Registers(7),
            ..restarted("the same, the program takes the events", 1, 102)
        },
        restarted("stopped and started at any time", 4, 103),
        // A stop with events on their way, and a start before they could have arrived.
        Scene {
            clocks: [1, 3],
            restarts: vec![short],
            longest_run: 128,
            bins: Bins::Target(256, 0),
            pixels: Pixels::InTurn,
            seed: 104,
            ..scene("stopped and started at once", 1, short)
        },
    ]);
    Ok(scenes)
}

/// A public capture log of a TMF8820, beside the workspace or where `TMF8820_LOG` says: the
/// histograms of its first captures.
fn recorded() -> Result<Option<Vec<Recorded>>> {
    let beside = root().join("../shared/data/tmf8820_plane_gt/distance_data.json");
    let named = env::var_os("TMF8820_LOG").map(PathBuf::from);
    let Some(path) = named.or_else(|| Some(beside).filter(|path| path.exists())) else {
        println!(
            "SKIPPED: recorded photons: no TMF8820 capture log beside the workspace, nor in TMF8820_LOG"
        );
        return Ok(None);
    };
    let name = path.display().to_string();
    let log = tmf8820::read(
        &name,
        BufReader::new(File::open(&path).context(name.clone())?),
    )?;
    let pixels = log.array.pixels() as usize;
    let histograms = log.histograms.iter().take(CAPTURES * pixels);
    let sums = histograms.map(|histogram| {
        let photons = histogram.iter().scan(0, |sum, photons| {
            *sum += photons;
            Some(*sum)
        });
        photons.collect()
    });
    Ok(Some(
        sums.filter(|sums: &Recorded| sums.last() > Some(&0))
            .collect(),
    ))
}

/// Captures of nine zones.
const CAPTURES: usize = 4;
