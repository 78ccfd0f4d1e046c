//! The cost of a method on a Cortex-M4F: counted instructions, at opt-level 3.
//!
//! Source: `docs/results/bench/instructions.csv`. A test compares these numbers with it.

use dtof_core::{DepthEstimator, Statistics};

use super::method::{Method, Rule};
use dtof_engine::settings::Settings;

/// Counting a photon (`AsyncPixel::count_batch`).
pub const PHOTON: f64 = 10.21;
/// Counting it if it is the first of its bin in a laser cycle (`AsyncPixel::count_once_per_bin`).
pub const ONCE_PER_BIN: f64 = 28.57;
/// Asking whether it also counts in blocks (`array with blocks; feeds none`, less `array`).
pub const FEED: f64 = 58.57 - 55.57;
/// Counting it in a block (`array with blocks; 1 level`, less `feeds none`).
pub const BLOCK_PHOTON: f64 = 88.00 - 58.57;
/// A look without an event with the paper's rule (`kept peak; no event`).
pub const PAPER: f64 = 90.68;
/// The same with the average of all bins (`average; no event`).
pub const AVERAGE: f64 = 32.0;
/// The same with tracking (`look; tracking; no event`).
pub const TRACKING: f64 = 414.50;
/// The same in an array with 8 neighbours, whether it asks them or not (`look; array, 8 neighbours; no event`).
pub const NEIGHBOURS: f64 = 1011.45;
/// The same in an array without neighbours (`look; array; no event`).
pub const LOOK: f64 = 150.10;
/// The same with a dead time (`look; dead time of 20 bins; no event`).
pub const DEAD_TIME: f64 = 6968.64;
/// The same with a dead time of all bins (`look; dead time; first photon only; no event`).
pub const FIRST_PHOTON: f64 = 4163.06;
/// The same for a block (`look; block; no event`).
pub const BLOCK_LOOK: f64 = 167.65;
/// An exposure that L2 ends (`look at L2`).
pub const EXPIRY: f64 = 108.0;
/// An event with its peak and the depth from three bins (`kept peak; event and depth`), and its word
/// (`encode and to_le_bytes`).
pub const EVENT: f64 = 517.0 + 46.0;
/// The same event if 8 neighbours confirm it (`look; array, 8 neighbours; more for each confirmed`), and its word.
pub const CONFIRMED: f64 = 3660.00 + 46.0;
/// The depth from a centred window instead (`centred window, σ 1`, less `centroid`).
pub const CENTRED: f64 = 135.84 - 68.0;

/// A look without an event with a window of so many bins (`window of N; no event`).
#[must_use]
pub const fn window(bins: u8) -> f64 {
    match bins {
        0 | 1 => 109.88,
        2 => 133.78,
        3 => 140.81,
        4 | 5 => 196.88,
        _ => 218.97,
    }
}

/// A look without an event.
fn look(method: &Method, settings: &Settings) -> f64 {
    let Some(events) = method.decides() else {
        return 0.0;
    };
    match events.rule {
        _ if events.weighs && usize::from(settings.dead_time()) >= settings.bins => FIRST_PHOTON,
        _ if events.weighs => DEAD_TIME,
        _ if events.tracking => TRACKING,
        Rule::Paper => PAPER,
        Rule::Average => AVERAGE,
        // Neighbours take as much each.
        Rule::Window(width) => events.neighbours.map_or(window(width), |neighbours| {
            LOOK + f64::from(neighbours.raw()) / 8.0 * (NEIGHBOURS - LOOK)
        }),
    }
}

/// Instructions a laser cycle and pixel of a run, from the statistics of pixels and blocks.
/// `pixel_cycles` are the laser cycles of all pixels together. Blocks have at most a third of the looks of
/// the pixels.
#[must_use]
pub fn instructions(
    method: &Method,
    settings: &Settings,
    [pixels, blocks]: &[Statistics; 2],
    pixel_cycles: u64,
) -> f64 {
    let all = pixel_cycles as f64;
    let looks = if method.is_frames() {
        0.0
    } else {
        all / f64::from(settings.configuration.x.max(1))
    };
    let has_blocks = settings.configuration.binning.is_some();
    let of_blocks: f64 = if has_blocks {
        let levels = i32::from(method.levels().raw());
        let each_pixel = (1.0 - 0.25f64.powi(levels)) / 3.0;
        FEED * pixels.photons() as f64
            + BLOCK_PHOTON * blocks.photons() as f64
            + BLOCK_LOOK * looks * each_pixel
    } else {
        0.0
    };
    let depth = match settings.configuration.estimator {
        DepthEstimator::Centroid3 => 0.0,
        DepthEstimator::CentredWindow(_) => CENTRED,
    };
    let events = pixels.events + blocks.events;
    // At most: not all events need neighbours.
    let event = method.neighbours().map_or(EVENT, |neighbours| {
        EVENT + f64::from(neighbours.raw()) / 8.0 * (CONFIRMED - EVENT)
    });
    let photon = if settings.configuration.once_per_bin {
        ONCE_PER_BIN
    } else {
        PHOTON
    };
    let sum = photon * pixels.photons() as f64
        + look(method, settings) * looks
        + (event + depth) * events as f64
        + EXPIRY * pixels.expired as f64
        + of_blocks;
    sum / all
}
