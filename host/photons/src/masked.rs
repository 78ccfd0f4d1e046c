//! Masked pixels: hot ones, whose noise would drown the block, and dead ones.

use anyhow::{Result, bail};
use dtof_core::{Array, PixelAddress};

use super::source::{PhotonSource, Slice};

use dtof_options::Refused;

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
