//! Which changes of depth are reported, in the units the command line uses.

use anyhow::{Context, Result};
use dtof_core::fixed::types::U24F8;
use dtof_core::{DynamicDepthConfig, RangeScale, Reference};

/// Dynamic depth of the mean of three events.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DynamicDepth {
    /// Millimetres a mean has to move by more than.
    pub threshold_mm: U24F8,
    /// From what.
    pub reference: Reference,
}

impl Default for DynamicDepth {
    /// The paper's: 0.1 m between the means of adjacent events.
    fn default() -> Self {
        Self {
            threshold_mm: U24F8::lit("100"),
            reference: Reference::Previous,
        }
    }
}

impl DynamicDepth {
    /// Events of which the mean is: the paper's.
    pub const MEAN_OF: usize = 3;

    /// As the core takes it.
    ///
    /// # Errors
    /// If the threshold is less than half of 1/256 bin.
    pub fn config(&self, scale: &RangeScale) -> Result<DynamicDepthConfig> {
        DynamicDepthConfig::new(self.threshold_mm, scale, self.reference)
            .with_context(|| format!("--threshold-mm {}", self.threshold_mm))
    }
}
