//! How long ago each pixel last had an event at the depth of the map.

use dtof_core::{Array, BinPosition, DepthEvent};

use crate::depth_map::SURFACE_BINS;

/// The last events of pixels, bin by bin.
pub struct LastAtBin {
    array: Array,
    /// Of each pixel the bins with an event, ascending, and the laser cycle of the last.
    pixels: Vec<Vec<(u16, u64)>>,
}

impl LastAtBin {
    /// No events.
    pub fn new(array: Array) -> Self {
        Self {
            array,
            pixels: vec![Vec::new(); array.pixels() as usize],
        }
    }

    /// Takes an event. That of a block is one of all its pixels.
    pub fn add(&mut self, event: &DepthEvent) {
        let (bin, cycle) = (bin(event.position()), event.cycle.raw());
        for pixel in self.array.pixels_of(event.pixel, event.level) {
            let bins = &mut self.pixels[usize::from(pixel.raw())];
            match bins.binary_search_by_key(&bin, |&(bin, _)| bin) {
                Ok(place) => bins[place].1 = cycle,
                Err(place) => bins.insert(place, (bin, cycle)),
            }
        }
    }

    /// Laser cycles from the last event at most three bins from each of the `positions` to the end of a run of `cycles`;
    /// not a number if there is none.
    pub fn ages(&self, positions: &[Option<BinPosition>], cycles: u64) -> Vec<f64> {
        let pixels = self.pixels.iter().zip(positions);
        let ages = pixels.map(|(bins, position)| {
            let place = bin((*position)?);
            let near = bins
                .iter()
                .filter(|(bin, _)| bin.abs_diff(place) <= SURFACE_BINS);
            let last = near.map(|&(_, cycle)| cycle).max()?;
            Some(cycles.saturating_sub(last + 1) as f64)
        });
        ages.map(|age| age.unwrap_or(f64::NAN)).collect()
    }
}

/// The bin of a position.
fn bin(position: BinPosition) -> u16 {
    u16::try_from(position.raw().max(0) / 256).unwrap_or(u16::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_data::events::fixtures::event;

    #[test]
    fn the_age_is_that_of_the_surface() {
        let mut last = LastAtBin::new(Array::new(4, 1).unwrap());
        let events = [
            event(0, 40, 60),
            event(0, 90, 63),
            event(0, 99, 64),
            event(1, 50, 20),
        ];
        for event in &events {
            last.add(event);
        }
        let at = |bin| Some(event(0, 0, bin).position());
        let ages = last.ages(&[at(60), at(60), None, at(5)], 100);
        assert_eq!(ages[0], 9.0);
        assert!(ages[1..].iter().all(|age| age.is_nan()));
        assert_eq!(
            last.ages(&[at(67), at(17), None, None], 100)[..2],
            [0.0, 49.0]
        );
    }
}
