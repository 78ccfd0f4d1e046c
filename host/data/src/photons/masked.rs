//! Masked pixels: hot ones, whose noise would drown the block, and dead ones.

use anyhow::{Result, bail};
use dtof_core::{Array, PixelAddress};

use super::source::{PhotonSource, Slice};

use crate::options::Refused;

/// A source whose masked pixels have no photons. It counts the photons it removes.
pub struct Masked {
    source: Box<dyn PhotonSource>,
    /// The indices of the masked pixels in a slice.
    places: Vec<usize>,
    photons: u64,
    laser_hz: Option<u64>,
}

/// Checks that all addresses of `masked` are below `pixels`.
///
/// # Errors
/// Names the first that is not.
pub fn check(masked: &[u16], pixels: usize) -> Result<()> {
    let past = masked.iter().find(|&&masked| usize::from(masked) >= pixels);
    past.map_or(Ok(()), |past| {
        bail!(Refused::value(
            "masked",
            past,
            format!("there are {pixels} pixels")
        ))
    })
}

impl Masked {
    /// `source` without the photons of `pixels`.
    ///
    /// # Errors
    /// Fails if one of `pixels` is not in the array.
    pub fn new(source: Box<dyn PhotonSource>, pixels: &[u16]) -> Result<Self> {
        check(pixels, source.array().pixels() as usize)?;
        let addresses = source.addresses();
        let place = |&pixel| addresses.binary_search(&PixelAddress::new(pixel)).ok();
        Ok(Self {
            laser_hz: source.laser_hz(),
            places: pixels.iter().filter_map(place).collect(),
            source,
            photons: 0,
        })
    }

    /// Sets the laser rate, if one is given.
    #[must_use]
    pub fn with_laser_hz(self, hz: Option<u64>) -> Self {
        Self {
            laser_hz: hz.or(self.laser_hz),
            ..self
        }
    }
}

impl PhotonSource for Masked {
    fn inner(&self) -> Option<&dyn PhotonSource> {
        Some(&*self.source)
    }

    fn array(&self) -> Array {
        self.source.array()
    }

    fn cycles(&self) -> u64 {
        self.source.cycles()
    }

    fn masked(&self) -> u64 {
        self.photons
    }

    fn laser_hz(&self) -> Option<u64> {
        self.laser_hz
    }

    fn limit_to(&mut self, is_needed: &dyn Fn(PixelAddress) -> bool) {
        self.source.limit_to(is_needed);
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
    use crate::photons::histograms::Histograms;
    use crate::photons::input::Input;
    use crate::photons::photon_csv::CsvReader;
    use crate::photons::photon_list::{ListOptions, PhotonList};
    use crate::photons::recorded::{RecordedHistograms, RecordingLength};

    #[test]
    fn photons_of_masked_pixels_are_removed_and_counted() {
        let rows = "pixel,cycle,bin\n0,0,1\n2,0,2\n2,1,2\n5,1,3\n5,300,3\n2,300,4\n";
        let shape = ListOptions {
            bins: 8,
            rebin: 1,
            columns: None,
            once_per_bin: false,
        };
        let list = PhotonList::<CsvReader>::open(&Input::in_memory("a.csv", rows), shape, u64::MAX);
        // Pixel 3 has no photons.
        let mut masked = Masked::new(Box::new(list.unwrap()), &[2, 3]).unwrap();
        assert_eq!(
            (masked.array(), masked.cycles()),
            (Array::new(6, 1).unwrap(), 301)
        );
        assert_eq!(masked.addresses(), [0, 2, 5].map(PixelAddress::new));
        for (expected, removed) in [([1, 0, 1], 2), ([0, 0, 1], 3), ([0, 0, 0], 3)] {
            let slice = masked.next_slice(256).unwrap();
            let photons = slice.pixels.iter().map(|pixel| pixel.photons.len());
            assert_eq!(photons.collect::<Vec<_>>(), expected);
            assert!(slice.pixels.iter().all(|pixel| pixel.cycles == 256));
            assert_eq!(masked.masked(), removed);
        }
    }

    fn histograms() -> Box<dyn PhotonSource> {
        let array = Array::new(3, 1).unwrap();
        let length = RecordingLength::Cycles(100);
        let histograms = Histograms::of(vec![vec![2; 8]; 3]).unwrap();
        let photons = RecordedHistograms::new(array, &histograms, length, 100, 1);
        Box::new(photons.unwrap())
    }

    #[test]
    fn all_else_is_that_of_the_source() {
        let masked = Masked::new(histograms(), &[1]).unwrap();
        assert_eq!(masked.recorded_cycles(), Some((100, 100)));
        assert_eq!(masked.laser_hz(), None);
        // A laser rate that is given stays.
        let masked = masked.with_laser_hz(Some(5)).with_laser_hz(None);
        let mut again = Masked::new(Box::new(masked), &[]).unwrap();
        assert_eq!(again.laser_hz(), Some(5));
        again.limit_to(&|address| address.raw() == 2);
        let slice = again.next_slice(100).unwrap();
        let photons = slice.pixels.iter().map(|pixel| pixel.photons.len());
        assert_eq!(photons.collect::<Vec<_>>(), [0, 0, 16]);
    }

    #[test]
    fn pixels_that_are_not_in_the_array_are_refused() {
        assert!(Masked::new(histograms(), &[0, 1, 2]).is_ok());
        let error = Masked::new(histograms(), &[2, 3, 9]).err().unwrap();
        assert_eq!(error.to_string(), "masked 3: there are 3 pixels");
    }
}
