//! The options of dynamic depth.

use dtof_core::RangeScale;
use dtof_core::events::{DynamicDepthConfig, Reference, ZeroThresholdError};
use dtof_core::fixed::types::U24F8;

/// Dynamic depth of the mean of [`Self::MEAN_OF`] events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DynamicDepth {
    /// A mean that moves by more than this many millimetres is reported.
    pub threshold_mm: U24F8,
    /// The mean to compare with.
    pub reference: Reference,
}

impl Default for DynamicDepth {
    /// As in the paper: 0.1 m between the means of adjacent events.
    fn default() -> Self {
        Self {
            threshold_mm: const { U24F8::lit("100") },
            reference: Reference::Previous,
        }
    }
}

impl DynamicDepth {
    /// Events in a mean, as in the paper.
    pub const MEAN_OF: usize = 3;

    /// The core's configuration.
    ///
    /// # Errors
    /// Fails if the threshold is less than half of 1/256 bin.
    pub const fn config(
        &self,
        scale: &RangeScale,
    ) -> Result<DynamicDepthConfig, ZeroThresholdError> {
        DynamicDepthConfig::new(self.threshold_mm, scale, self.reference)
    }
}
