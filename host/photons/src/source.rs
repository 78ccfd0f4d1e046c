//! Where photons come from: a simulation, recorded histograms, a photon list.

use anyhow::Result;
use dtof_core::{Array, BlockLevel, PixelAddress};

/// One photon of one pixel in one slice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Photon {
    /// Laser cycles after the slice's first.
    pub cycle: u16,
    /// The bin, as from a TDC.
    pub code: u16,
}

/// The photons of one pixel in one slice.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PixelPhotons {
    /// Laser cycles of the slice that were recorded. Fewer than its length where the pixel's
    /// recording ends.
    pub cycles: u16,
    /// In non-decreasing laser cycle.
    pub photons: Vec<Photon>,
}

/// Consecutive laser cycles of all pixels.
#[derive(Clone, Debug)]
pub struct Slice {
    /// The first laser cycle.
    pub first_cycle: u64,
    /// One for each of [`PhotonSource::addresses`], in that order.
    pub pixels: Vec<PixelPhotons>,
}

/// A source of photons. It makes them as they are needed, so memory does not grow with their
/// number.
///
/// A source that changes the photons of another returns it as [`inner`](Self::inner). By default,
/// all other methods forward to it.
pub trait PhotonSource {
    /// The source whose photons this one changes.
    fn inner(&self) -> Option<&dyn PhotonSource> {
        None
    }

    /// The array.
    fn array(&self) -> Array;

    /// The names of its columns and rows.
    fn axis_names(&self) -> [&'static str; 2] {
        self.inner()
            .map_or(["column", "row"], |inner| inner.axis_names())
    }

    /// Rows that were recorded together. Blocks do not span captures.
    fn capture_rows(&self) -> u32 {
        match self.inner() {
            Some(inner) => inner.capture_rows(),
            None => self.array().rows(),
        }
    }

    /// The addresses of the pixels, ascending: by default all of the array.
    fn addresses(&self) -> Vec<PixelAddress> {
        if let Some(inner) = self.inner() {
            return inner.addresses();
        }
        let all = (0..=u16::MAX).take(self.array().pixels() as usize);
        all.map(PixelAddress::new).collect()
    }

    /// The number of laser cycles.
    fn cycles(&self) -> u64;

    /// About the photons of all pixels in the next laser cycle; 0 if unknown.
    fn photons_per_cycle(&self) -> f64 {
        self.inner().map_or(0.0, |inner| inner.photons_per_cycle())
    }

    /// Recorded photons that no slice has contained yet.
    fn not_replayed(&self) -> u64 {
        self.inner().map_or(0, |inner| inner.not_replayed())
    }

    /// Photons of masked pixels so far.
    fn masked(&self) -> u64 {
        self.inner().map_or(0, |inner| inner.masked())
    }

    /// The assumed laser cycles of the shortest and the longest capture of recorded histograms.
    fn recorded_cycles(&self) -> Option<(u64, u64)> {
        self.inner()?.recorded_cycles()
    }

    /// Laser cycles a second, if known.
    fn laser_hz(&self) -> Option<u64> {
        self.inner()?.laser_hz()
    }

    /// From now on, photons of pixels for which `is_needed` is false may be left out, if that saves
    /// time.
    fn limit_to(&mut self, _is_needed: &dyn Fn(PixelAddress) -> bool) {}

    /// The photons of the next `cycles` laser cycles.
    ///
    /// # Errors
    /// Returns what is wrong with the recording, after the file and the place.
    fn next_slice(&mut self, cycles: u16) -> Result<Slice>;
}

/// Whether the pixels of every block of `level` are neighbours: columns and rows are adjacent, and
/// no block spans two captures.
#[must_use]
pub fn has_only_neighbours(source: &dyn PhotonSource, level: BlockLevel) -> bool {
    let side = 1 << level.raw();
    is_one_capture(source)
        || (source.axis_names()[0] == "column" && source.capture_rows().is_multiple_of(side))
}

/// Whether all pixels next to each other are neighbours: columns and rows are adjacent, and there are
/// no further captures below the first.
#[must_use]
pub fn is_one_capture(source: &dyn PhotonSource) -> bool {
    source.axis_names()[0] == "column" && source.capture_rows() == source.array().rows()
}
