#![doc = include_str!("../README.md")]
#![deny(clippy::print_stderr, clippy::print_stdout)]

mod alone;
mod array;
pub mod bins;
pub mod decisions;
pub mod explain;
pub mod frame;
pub mod host;
pub mod once;
pub mod once_per_bin;
mod parallel;
pub mod settings;
pub mod slices;

use anyhow::Result;
use dtof_core::{DepthEvent, PixelAddress, Statistics};

use self::decisions::Decision;
use dtof_data::photons::source::Slice;

/// Turns photons into events. The same photons give the same events with any engine.
pub trait Engine: Send {
    /// Runs a slice. Returns its events by laser cycle, level and pixel address.
    ///
    /// # Errors
    /// Fails if the engine cannot be reached.
    fn run(&mut self, slice: &Slice) -> Result<Vec<DepthEvent>>;

    /// The recording has ended. Returns the events of engines that decide then.
    fn finish(&mut self) -> Vec<DepthEvent> {
        Vec::new()
    }

    /// The counts of all pixels so far, and of all blocks.
    fn statistics(&self) -> [Statistics; 2];

    /// From now on keeps the last decision of pixels for which `is_kept` is true, and of blocks
    /// that begin with one. Engines that do not see histograms keep nothing.
    fn keep_decisions(&mut self, _is_kept: &dyn Fn(PixelAddress) -> bool) {}

    /// The decisions that were kept, by level and pixel.
    fn decisions(&self) -> Vec<Decision> {
        Vec::new()
    }
}
