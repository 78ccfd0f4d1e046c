//! Scenes in which the pixel processor has to do what `dtof-core` does.

use anyhow::Result;
use dtof_core::fixed::types::U8F8;

use super::scene::{Events, Pixels, Scene, config};

const PAPER: [u16; 3] = [4, 40, 2000];
const WHOLE: [u16; 2] = [0, 127];
const ALPHA: U8F8 = U8F8::lit("4");

/// The scenes, with about so many photons in all.
pub fn scenes(photons: u64) -> Result<Vec<Scene>> {
    let paper = config(PAPER, ALPHA, 5, WHOLE, false)?;
    let short = config([1, 1, 30], U8F8::lit("0.5"), 1, [3, 77], true)?;
    let bright = config([50, 400, 4000], U8F8::lit("2.25"), 20, WHOLE, true)?;
    let dim = config([7, 60, 64], U8F8::lit("255.99"), 0, [100, 127], false)?;
    let rare = config([300, 60_000, 65_535], U8F8::lit("0"), 1000, WHOLE, false)?;
    let each = photons / 16;
    let scene = |name: &str, pixels_log2, config| Scene {
        name: name.to_owned(),
        pixels_log2,
        config,
        clocks: [7, 8],
        rate: 256,
        signal: 100,
        spread: 1,
        pixels: Pixels::All,
        link: 256,
        events: Events::Link,
        length: each,
        seed: 1,
    };
    let mut scenes = vec![
        scene("the paper's setting, a photon a clock", 2, paper),
        Scene {
            rate: 40,
            length: 2 * each,
            ..scene("the paper's setting, fewer photons", 2, paper)
        },
        Scene {
            clocks: [1, 30],
            rate: 200,
            pixels: Pixels::Strays,
            link: 3,
            length: each,
            ..scene("a slow link, laser cycles of any length, strays", 2, paper)
        },
        Scene {
            signal: 256,
            spread: 0,
            pixels: Pixels::InTurn,
            ..scene("all fire at once", 2, paper)
        },
        Scene {
            clocks: [1, 3],
            signal: 200,
            ..scene("looks as often as there can be any", 2, short)
        },
        Scene {
            pixels: Pixels::OneForLong(100),
            signal: 250,
            spread: 2,
            ..scene("one macropixel for long, in a few bins", 2, short)
        },
        Scene {
            clocks: [7, 9],
            signal: 240,
            spread: 1,
            pixels: Pixels::OneForLong(40_000),
            ..scene("full counters", 2, bright)
        },
        Scene {
            signal: 255,
            pixels: Pixels::InTurn,
            spread: 0,
            clocks: [3, 5],
            ..scene("full counters in all macropixels", 2, bright)
        },
        Scene {
            signal: 250,
            ..scene("exposures that end", 2, dim)
        },
        Scene {
            clocks: [1, 1],
            signal: 250,
            ..scene("long exposures", 2, rare)
        },
        Scene {
            events: Events::Registers(3),
            signal: 60,
            ..scene("the program takes the events", 2, paper)
        },
        Scene {
            events: Events::Registers(60),
            clocks: [5, 12],
            ..scene("a slow program", 2, short)
        },
        scene("two macropixels", 1, paper),
        Scene {
            pixels: Pixels::Strays,
            ..scene("sixteen macropixels", 4, paper)
        },
        Scene {
            signal: 256,
            pixels: Pixels::InTurn,
            ..scene("64 macropixels", 6, paper)
        },
    ];
    for (seed, scene) in (1..).zip(&mut scenes) {
        scene.seed = seed;
    }
    Ok(scenes)
}
