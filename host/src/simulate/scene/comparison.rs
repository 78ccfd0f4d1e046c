//! How events compare with the scene.

use dtof_core::PixelAddress;

use super::Scene;
use crate::events::maps::{Maps, PixelHistory};
use crate::events::summary::{Row, grouped};

/// An event is false if its range lies farther from the truth than this many
/// bins.
const FALSE_BEYOND_BINS: f64 = 3.0;

impl Scene {
    /// How the events of `cycles` laser cycles compare with the scene, surface by
    /// surface. A pixel counts for the surface it saw at its last event. False events
    /// are counted, and left out of the errors.
    #[must_use]
    pub fn against_truth(&self, maps: &Maps, cycles: u64) -> Vec<Row> {
        let mut rows = Vec::new();
        let pixels: Vec<(PixelAddress, &PixelHistory)> =
            (0..=u16::MAX).map(PixelAddress).zip(&maps.pixels).collect();
        for (index, surface) in self.surfaces.iter().enumerate() {
            let on_surface = |(address, pixel): &&(PixelAddress, &PixelHistory)| {
                let view = self.truth(*address, pixel.last_cycle().unwrap_or(0));
                view.is_some_and(|view| view.surface == index)
            };
            let seen: Vec<_> = pixels.iter().filter(on_surface).collect();
            let events: u64 = seen.iter().map(|(_, pixel)| pixel.events).sum();
            let first = seen.iter().filter_map(|(_, pixel)| pixel.first_cycle);
            rows.push((
                surface.name.clone(),
                format!(
                    "{} events of {} pixels, the first in laser cycle {}",
                    grouped(events),
                    seen.len(),
                    first.min().map_or("-".to_owned(), grouped),
                ),
            ));
            let lost = self.pixels_beyond(index, cycles);
            if lost > 0 {
                rows.push((
                    format!("{}, beyond the last bin", surface.name),
                    format!(
                        "at the start or the end in {lost} of {} pixels: no photons from {:.0} mm on",
                        pixels.len(),
                        self.end_mm()
                    ),
                ));
            }
            let limit_mm = FALSE_BEYOND_BINS * self.mm_per_bin();
            let errors: Vec<Vec<f64>> = seen
                .iter()
                .map(|(address, pixel)| self.errors(*address, pixel))
                .filter(|errors| !errors.is_empty())
                .collect();
            if errors.is_empty() {
                continue; // no event, no error
            }
            let right = |error: &f64| error.abs() <= limit_mm;
            let last: Vec<f64> = errors
                .iter()
                .filter_map(|errors| errors.last().copied())
                .filter(right)
                .collect();
            let mean: Vec<f64> = errors
                .iter()
                .map(|errors| errors.iter().copied().filter(right).collect::<Vec<f64>>())
                .filter(|errors| !errors.is_empty())
                .map(|errors| mean(&errors))
                .collect();
            rows.push((
                format!("{}, false events", surface.name),
                format!(
                    "{} of {} last events of a pixel, beyond {FALSE_BEYOND_BINS} bins",
                    grouped((errors.len() - last.len()) as u64),
                    grouped(errors.len() as u64),
                ),
            ));
            if !last.is_empty() {
                rows.push((
                    format!("{}, rms error", surface.name),
                    format!(
                        "{:.1} mm last event of each pixel, {:.1} mm mean of ten, without the false ones",
                        root_mean_square(&last),
                        root_mean_square(&mean),
                    ),
                ));
            }
        }
        rows
    }

    /// Where the last bin ends.
    fn end_mm(&self) -> f64 {
        f64::from(self.bins) * self.mm_per_bin()
    }

    /// Pixels that see a surface at the start or the end of `cycles` laser cycles too
    /// far away for the histogram.
    fn pixels_beyond(&self, surface: usize, cycles: u64) -> usize {
        let is_beyond = |address, cycle| {
            let view = self.truth(address, cycle);
            view.is_some_and(|view| view.surface == surface && view.range_mm >= self.end_mm())
        };
        let pixels = (0..=u16::MAX).map(PixelAddress);
        pixels
            .take(self.geometry.addresses())
            .filter(|&address| is_beyond(address, 0) || is_beyond(address, cycles))
            .count()
    }

    /// Range less truth of the last events of a pixel, oldest first.
    fn errors(&self, address: PixelAddress, pixel: &PixelHistory) -> Vec<f64> {
        let error =
            |(cycle, range_mm): (u64, f64)| Some(range_mm - self.truth(address, cycle)?.range_mm);
        pixel.recent().filter_map(error).collect()
    }
}

#[allow(clippy::cast_precision_loss, reason = "some thousand pixels")]
fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn root_mean_square(errors: &[f64]) -> f64 {
    let squares: Vec<f64> = errors.iter().map(|error| error * error).collect();
    mean(&squares).sqrt()
}
