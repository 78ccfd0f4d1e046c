//! How events compare with the scene.

use dtof_core::PixelAddress;

use super::Scene;
use crate::maps::{Maps, PixelHistory};
use crate::summary::{Row, grouped};

/// An event is false if its range lies farther from the truth than this many
/// bins.
const FALSE_BEYOND_BINS: f64 = 3.0;

impl Scene {
    /// How the events compare with the scene, surface by surface. A pixel counts
    /// for the surface it saw at its last event.
    #[must_use]
    pub fn against_truth(&self, maps: &Maps) -> Vec<Row> {
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
            let errors = |of: fn(&[f64]) -> f64| {
                seen.iter()
                    .map(|(address, pixel)| self.errors(*address, pixel))
                    .filter(|errors| !errors.is_empty())
                    .map(|errors| of(&errors))
                    .collect::<Vec<f64>>()
            };
            let last = errors(|errors| errors[errors.len() - 1]);
            let mean = errors(mean);
            if last.is_empty() {
                continue; // no event, no error
            }
            let limit_mm = FALSE_BEYOND_BINS * self.mm_per_bin();
            let false_events = last.iter().filter(|error| error.abs() > limit_mm).count();
            rows.push((
                format!("{}, rms error", surface.name),
                format!(
                    "{:.1} mm last event of each pixel ({false_events} beyond {FALSE_BEYOND_BINS} bins), \
                     {:.1} mm mean of ten",
                    root_mean_square(&last),
                    root_mean_square(&mean),
                ),
            ));
        }
        rows
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
