//! Dynamic depth: changes of the mean depth of pixels and blocks.

use std::collections::HashMap;

use dtof_core::events::{DynamicDepthConfig, DynamicDepthEvent, DynamicDepthPixel};
use dtof_core::{BlockLevel, DepthEvent, EchoNumber, PixelAddress};
use dtof_link::DynamicDepth;

use super::echoes::Echo;

/// The state of each pixel and block: the mean of its last depths, three as in the paper.
#[derive(Clone, Debug)]
pub struct DepthChanges {
    config: DynamicDepthConfig,
    /// The echo of each exposure that is observed, if not all.
    echo: Echo,
    pixels: HashMap<(PixelAddress, BlockLevel), DynamicDepthPixel<{ DynamicDepth::MEAN_OF }>>,
}

impl DepthChanges {
    /// Starts without depths. Only `echo` of each exposure will be observed.
    #[must_use]
    pub fn new(config: DynamicDepthConfig, echo: Echo) -> Self {
        Self {
            config,
            echo,
            pixels: HashMap::new(),
        }
    }

    /// Observes an event and returns the change of depth it brings, if any. Each pixel and block
    /// must report in order. If all echoes are observed, only the first counts.
    pub fn observe(&mut self, event: &DepthEvent) -> Option<DynamicDepthEvent> {
        if self.echo == Echo::All && event.echo > EchoNumber::FIRST {
            return None;
        }
        let pixel = self.pixels.entry((event.pixel, event.level));
        pixel.or_default().observe(&self.config, event)
    }
}
