//! Which changes of depth are wanted.

use dtof_core::fixed::types::U24F8;
use dtof_core::{DynamicDepthConfig, RangeScale, Reference, ZeroThresholdError};

/// Dynamic depth of the mean of [`Self::MEAN_OF`] events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DynamicDepth {
    /// Millimetres that a mean has to move by more than.
    pub threshold_mm: U24F8,
    /// From what.
    pub reference: Reference,
}

impl Default for DynamicDepth {
    /// The paper's: 0.1 m between the means of adjacent events.
    fn default() -> Self {
        Self {
            threshold_mm: const { U24F8::lit("100") },
            reference: Reference::Previous,
        }
    }
}

impl DynamicDepth {
    /// Events of a mean: the paper's.
    pub const MEAN_OF: usize = 3;

    /// The same for the core.
    ///
    /// # Errors
    /// If the threshold is less than half of 1/256 bin.
    pub const fn config(
        &self,
        scale: &RangeScale,
    ) -> Result<DynamicDepthConfig, ZeroThresholdError> {
        DynamicDepthConfig::new(self.threshold_mm, scale, self.reference)
    }
}
