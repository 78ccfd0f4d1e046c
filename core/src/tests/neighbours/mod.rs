//! Pixels that confirm each other.

mod false_alarms;
pub mod formulas;
mod model;
mod narrow;
mod steps;
mod tables;

use crate::neighbours::{ArrayLook, ArrayPixel, NeighbourConfig, end_laser_cycles};
use crate::{CounterWidth, LaserCycle, PixelConfig, Statistics, WindowRule};

/// Ends laser cycles of pixels with neighbours. Returns whether one of them has a new event.
pub fn end_laser_cycles_of_array<const BINS: usize, W: CounterWidth>(
    pixels: &mut [impl ArrayPixel<BINS, W>],
    config: &PixelConfig<BINS, WindowRule>,
    neighbours: &NeighbourConfig,
    statistics: &mut Statistics,
    last: LaserCycle,
    cycles: u16,
) -> bool {
    let before = statistics.events;
    let look = ArrayLook {
        config,
        neighbours,
        last,
    };
    end_laser_cycles(&look, pixels, statistics, cycles);
    statistics.events > before
}
