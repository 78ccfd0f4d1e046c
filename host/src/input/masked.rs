//! Pixels that are left out: hot ones, which would report noise and drown their block, and dead
//! ones.

use anyhow::{Result, ensure};
use dtof_core::PixelAddress;

use super::source::{Geometry, PhotonSource, Slice};

/// A source whose masked pixels have no photons. What they had is counted.
pub struct Masked {
    source: Box<dyn PhotonSource>,
    /// Where the masked pixels are in a slice.
    places: Vec<usize>,
    photons: u64,
    laser_hz: Option<u64>,
}

impl Masked {
    /// `source` without the photons of `pixels`.
    ///
    /// # Errors
    /// If one of `pixels` is not in the array.
    pub fn new(source: Box<dyn PhotonSource>, pixels: &[u16]) -> Result<Self> {
        let (array, addresses) = (source.geometry().addresses(), source.addresses());
        let mut places = Vec::new();
        for &pixel in pixels {
            ensure!(
                usize::from(pixel) < array,
                "--mask {pixel}: there are {array} pixels"
            );
            places.extend(addresses.binary_search(&PixelAddress(pixel)));
        }
        Ok(Self {
            laser_hz: source.laser_hz(),
            source,
            places,
            photons: 0,
        })
    }

    /// The same with a laser of `hz` cycles a second, if that is said.
    #[must_use]
    pub fn with_laser_hz(self, hz: Option<u64>) -> Self {
        Self {
            laser_hz: hz.or(self.laser_hz),
            ..self
        }
    }
}

impl PhotonSource for Masked {
    fn geometry(&self) -> Geometry {
        self.source.geometry()
    }

    fn sides(&self) -> [&'static str; 2] {
        self.source.sides()
    }

    fn capture_rows(&self) -> u32 {
        self.source.capture_rows()
    }

    fn addresses(&self) -> Vec<PixelAddress> {
        self.source.addresses()
    }

    fn cycles(&self) -> u64 {
        self.source.cycles()
    }

    fn photons_per_cycle(&self) -> f64 {
        self.source.photons_per_cycle()
    }

    fn not_replayed(&self) -> u64 {
        self.source.not_replayed()
    }

    fn masked(&self) -> u64 {
        self.photons
    }

    fn recorded_cycles(&self) -> Option<(u64, u64)> {
        self.source.recorded_cycles()
    }

    fn laser_hz(&self) -> Option<u64> {
        self.laser_hz
    }

    fn spare(&mut self, is_wanted: &dyn Fn(PixelAddress) -> bool) {
        self.source.spare(is_wanted);
    }

    fn next_slice(&mut self, cycles: u16) -> Result<Slice> {
        let mut slice = self.source.next_slice(cycles)?;
        for &place in &self.places {
            let photons = &mut slice.pixels[place].photons;
            self.photons += photons.len() as u64;
            photons.clear();
        }
        Ok(slice)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::demo;

    #[test]
    fn only_masked_pixels_lose_their_photons_and_they_are_counted() {
        let array = Geometry::new(4, 2);
        let photons = || Box::new(demo::photons(array, 1, 100).unwrap());
        let whole = photons().next_slice(100).unwrap();
        let mut masked = Masked::new(photons(), &[1, 6, 6]).unwrap();
        let part = masked.next_slice(100).unwrap();
        let mut lost = 0;
        for (pixel, (whole, part)) in whole.pixels.iter().zip(&part.pixels).enumerate() {
            if [1, 6].contains(&pixel) {
                assert!(part.photons.is_empty() && !whole.photons.is_empty());
                lost += whole.photons.len() as u64;
            } else {
                assert_eq!(whole, part);
            }
        }
        assert_eq!(masked.masked(), lost);
        let refused = Masked::new(photons(), &[8]).err().unwrap();
        assert_eq!(refused.to_string(), "--mask 8: there are 8 pixels");
    }
}
