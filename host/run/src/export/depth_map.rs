//! The depth map of a run as one event a pixel.

use dtof_core::{BlockLevel, DepthEvent, PixelAddress};
use dtof_data::events::aer_file::Event;
use dtof_data::events::histories::PixelHistories;

/// One event for each pixel that has a depth, and the depth of each pixel in millimetres; not a number without one.
pub struct DepthMap {
    pub events: Vec<Event>,
    pub depths_mm: Vec<f64>,
}

/// The depths are those of `depth.npy`, the events the newest on the surfaces with these depths. They stand for the
/// pixel alone, also if they are those of a block.
pub fn depth_map(histories: &PixelHistories) -> DepthMap {
    let surfaces = || histories.pixels.iter().map(|pixel| pixel.surface());
    let of_pixels = (0..=u16::MAX).map(PixelAddress::new).zip(surfaces());
    let events = of_pixels.filter_map(|(pixel, surface)| {
        let (_, event) = surface?;
        Some(Event::Depth(DepthEvent {
            pixel,
            level: BlockLevel::PIXEL,
            ..event
        }))
    });
    let depths = surfaces().map(|surface| surface.map_or(f64::NAN, |(depth, _)| depth));
    DepthMap {
        events: events.collect(),
        depths_mm: depths.collect(),
    }
}
