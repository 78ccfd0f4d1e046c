//! Events in metres and nanoseconds.

use anyhow::{Context, Result};

use dtof_data::events::aer_file::Event;
use dtof_data::events::clock::LaserClock;
use dtof_data::photons::geometry::Rays;
use dtof_data::photons::ranges::Ranges;

/// Turns an event into a point in space and time.
pub struct Projection {
    /// The rays of the pixels.
    pub rays: Rays,
    /// Bins to millimetres.
    pub ranges: Ranges,
    /// Laser cycles to nanoseconds.
    pub clock: LaserClock,
    /// The depth of each pixel in millimetres, in place of the ranges of events; empty for these.
    pub depths_mm: Vec<f64>,
}

impl Projection {
    /// x, y and z in metres, rounded to f32.
    ///
    /// # Errors
    /// Fails if the pixel of the event has no ray.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "rounded to the nearest f32"
    )]
    pub fn point(&self, event: &Event) -> Result<[f32; 3]> {
        let (pixel, level) = (event.pixel(), event.level());
        let range_mm = self.range_mm(event);
        let point = self.rays.point(pixel, level, range_mm);
        let point = point.with_context(|| format!("pixel {} has no ray", event.pixel().raw()))?;
        // No negative zeros.
        Ok(point.map(|side| side as f32 + 0.0))
    }

    /// The range in millimetres.
    #[must_use]
    pub fn range_mm(&self, event: &Event) -> f64 {
        let pixel = event.pixel();
        let depth = self.depths_mm.get(usize::from(pixel.raw())).copied();
        let range = || self.ranges.of(pixel, event.level(), event.position());
        depth.unwrap_or_else(|| range().to_num())
    }

    /// The time in nanoseconds.
    #[must_use]
    pub fn nanoseconds(&self, event: &Event) -> u128 {
        self.clock.nanoseconds(event.cycle().raw())
    }
}
