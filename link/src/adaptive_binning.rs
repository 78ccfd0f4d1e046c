//! How pixels are counted together.

use dtof_core::BlockLevel;

/// The options of adaptive binning: see `dtof_core::Binning`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AdaptiveBinning {
    /// The largest blocks, of level 1 to 3.
    pub levels: BlockLevel,
    /// Laser cycles between ticks; not 0. Counted from look to look, so that it is rounded up
    /// to a multiple of X.
    pub patience: u16,
}

impl AdaptiveBinning {
    /// The patience unless said otherwise. Measured in `docs/results/figures.md`.
    pub const PATIENCE: u16 = 64;
}
