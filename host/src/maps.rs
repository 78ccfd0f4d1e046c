//! What the events of a run look like, pixel by pixel.

use std::collections::VecDeque;

use dtof_core::{DepthEvent, RangeScale};

use crate::events_csv::range_mm;
use crate::source::Geometry;

/// How many events the mean map averages, as in the paper's figure.
pub const MEAN_OF: usize = 10;

/// The ranges of one pixel.
#[derive(Clone, Debug, Default)]
pub struct PixelHistory {
    /// Laser cycle and range in millimetres of the last [`MEAN_OF`] events, or
    /// fewer, oldest first.
    recent: VecDeque<(u64, f64)>,
    /// All events.
    pub events: u64,
    /// The laser cycle of the first.
    pub first_cycle: Option<u64>,
}

impl PixelHistory {
    fn push(&mut self, cycle: u64, range_mm: f64) {
        if self.recent.len() == MEAN_OF {
            self.recent.pop_front();
        }
        self.recent.push_back((cycle, range_mm));
    }

    /// The range of the last event.
    #[must_use]
    pub fn last_mm(&self) -> Option<f64> {
        self.recent.back().map(|(_, range_mm)| *range_mm)
    }

    /// The laser cycle of the last event.
    #[must_use]
    pub fn last_cycle(&self) -> Option<u64> {
        self.recent.back().map(|(cycle, _)| *cycle)
    }

    /// Laser cycle and range in millimetres of the last [`MEAN_OF`] events, or
    /// of as many as there are, oldest first.
    pub fn recent(&self) -> impl Iterator<Item = (u64, f64)> {
        self.recent.iter().copied()
    }

    /// The mean range of the last [`MEAN_OF`] events, or of as many as there
    /// are.
    #[must_use]
    #[allow(clippy::cast_precision_loss, reason = "at most ten")]
    pub fn mean_mm(&self) -> Option<f64> {
        let count = self.recent.len();
        (count > 0).then(|| self.recent().map(|(_, range_mm)| range_mm).sum::<f64>() / count as f64)
    }
}

/// All pixels of an array, row by row.
#[derive(Clone, Debug)]
pub struct Maps {
    /// The array.
    pub geometry: Geometry,
    /// One for each address.
    pub pixels: Vec<PixelHistory>,
}

impl Maps {
    /// Nothing yet.
    #[must_use]
    pub fn new(geometry: Geometry) -> Self {
        Self {
            geometry,
            pixels: vec![PixelHistory::default(); geometry.addresses()],
        }
    }

    /// Takes one event into account.
    pub fn add(&mut self, event: &DepthEvent, scale: &RangeScale) {
        let pixel = &mut self.pixels[usize::from(event.pixel.0)];
        pixel.push(event.cycle.0, range_mm(event, scale));
        pixel.events += 1;
        pixel.first_cycle.get_or_insert(event.cycle.0);
    }

    /// Pixels with at least one event.
    #[must_use]
    pub fn reporting(&self) -> usize {
        self.pixels.iter().filter(|pixel| pixel.events > 0).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_range_is_the_newest_and_the_mean_that_of_the_last_ten() {
        let mut pixel = PixelHistory::default();
        assert_eq!((pixel.last_mm(), pixel.mean_mm()), (None, None));
        for range in 1..=12u32 {
            pixel.push(range.into(), range.into());
        }
        assert_eq!(pixel.last_mm(), Some(12.0));
        assert_eq!(pixel.mean_mm(), Some(7.5)); // of 3 to 12
    }
}
