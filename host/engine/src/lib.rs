#![doc = include_str!("../README.md")]
#![deny(clippy::print_stderr, clippy::print_stdout)]

pub mod bins;
pub mod decisions;
pub mod frame;
pub mod group;
pub mod host;
pub mod look;
pub mod settings;
pub mod slices;

use anyhow::Result;
use dtof_core::{DepthEvent, PixelAddress, Statistics};

use self::decisions::Decision;
use dtof_photons::source::Slice;

/// Turns photons into events. Whatever runs behind it, the same photons give
/// the same events.
pub trait Engine: Send {
    /// Runs one slice and gives the events of its laser cycles, in order of
    /// laser cycle, of level and of pixel address.
    ///
    /// # Errors
    /// If the engine could not be reached.
    fn run(&mut self, slice: &Slice) -> Result<Vec<DepthEvent>>;

    /// The counts of all pixels so far, and of all blocks.
    fn statistics(&self) -> [Statistics; 2];

    /// From now on keeps what the last event was decided from, of pixels that `is_wanted` names
    /// and of blocks that begin with one. An engine that does not see it keeps nothing.
    fn keep_decisions(&mut self, _is_wanted: &dyn Fn(PixelAddress) -> bool) {}

    /// What was kept, in order of level and pixel.
    fn decisions(&self) -> Vec<Decision> {
        Vec::new()
    }
}
