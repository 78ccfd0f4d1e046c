//! What pixels and blocks send in place of depth events: changes of their depth.

use std::collections::HashMap;

use dtof_core::{
    BlockLevel, DepthEvent, DynamicDepthConfig, DynamicDepthEvent, DynamicDepthPixel, EchoNumber,
    PixelAddress,
};
use dtof_link::DynamicDepth;

use super::echoes::Echo;

/// The last depths of each pixel and block, three as in the paper.
#[derive(Clone, Debug)]
pub struct DepthChanges {
    config: DynamicDepthConfig,
    /// The one echo of each exposure that comes, if not all.
    echo: Echo,
    pixels: HashMap<(PixelAddress, BlockLevel), DynamicDepthPixel<{ DynamicDepth::MEAN_OF }>>,
}

impl DepthChanges {
    /// No depth yet. Of the echoes of an exposure only `echo` will come.
    #[must_use]
    pub fn new(config: DynamicDepthConfig, echo: Echo) -> Self {
        Self {
            config,
            echo,
            pixels: HashMap::new(),
        }
    }

    /// The change that a depth event is, if it is one. Each pixel and block sends its events in
    /// order, so that they are looked at as they come. Of all echoes the first is followed.
    pub fn observe(&mut self, event: &DepthEvent) -> Option<DynamicDepthEvent> {
        if self.echo == Echo::All && event.echo > EchoNumber::FIRST {
            return None;
        }
        let pixel = self.pixels.entry((event.pixel, event.level));
        pixel.or_default().observe(&self.config, event)
    }
}
