//! The engine: photons in, depth events out.

pub mod frame;
pub mod group;
pub mod host;
pub mod run;
pub mod settings;

use anyhow::Result;
use dtof_core::{DepthEvent, Statistics};

use crate::input::source::Slice;

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
}
