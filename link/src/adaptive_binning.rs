//! The options of adaptive binning.

use dtof_core::BlockLevel;

/// The options of adaptive binning: see `dtof_core::binning::Binning`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AdaptiveBinning {
    /// The largest blocks, of level 1 to 3.
    pub levels: BlockLevel,
    /// Laser cycles between ticks; not 0. Rounded up to a multiple of X, the laser cycles
    /// between looks.
    pub patience: u16,
}

impl AdaptiveBinning {
    /// The default patience. Measured in `docs/results/figures.md`.
    pub const PATIENCE: u16 = 64;
}
