//! Where photons come from: a simulation, recorded histograms, a photon list.

use anyhow::Result;
use dtof_core::{Array, BlockLevel, PixelAddress};

/// One photon of one pixel in one slice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Photon {
    /// Laser cycles after the slice's first.
    pub cycle: u16,
    /// The bin, as a TDC would give it.
    pub code: u16,
}

/// The photons of one pixel in one slice.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PixelPhotons {
    /// Laser cycles of the slice that were recorded: all of them, or fewer
    /// where the pixel's recording ends.
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

/// Produces photons as they are needed, so that memory does not grow with their
/// number.
///
/// A source that changes the photons of another names it as [`inner`](Self::inner). It then
/// says all that the other says, but for what it changes.
pub trait PhotonSource {
    /// The source whose photons these are, if this one changes those of another.
    fn inner(&self) -> Option<&dyn PhotonSource> {
        None
    }

    /// The array.
    fn array(&self) -> Array;

    /// The names of its columns and rows.
    fn sides(&self) -> [&'static str; 2] {
        self.inner()
            .map_or(["column", "row"], |inner| inner.sides())
    }

    /// Rows that were recorded together: a block of pixels has no others.
    fn capture_rows(&self) -> u32 {
        match self.inner() {
            Some(inner) => inner.capture_rows(),
            None => self.array().rows(),
        }
    }

    /// The pixels that are there, ascending: all of the array unless said
    /// otherwise.
    fn addresses(&self) -> Vec<PixelAddress> {
        if let Some(inner) = self.inner() {
            return inner.addresses();
        }
        let all = (0..=u16::MAX).take(self.array().pixels() as usize);
        all.map(PixelAddress).collect()
    }

    /// Laser cycles there are, from 0.
    fn cycles(&self) -> u64;

    /// Photons of all pixels in the next laser cycle, about; 0 if that is not
    /// known.
    fn photons_per_cycle(&self) -> f64 {
        self.inner().map_or(0.0, |inner| inner.photons_per_cycle())
    }

    /// Recorded photons that no slice has held so far.
    fn not_replayed(&self) -> u64 {
        self.inner().map_or(0, |inner| inner.not_replayed())
    }

    /// Photons of pixels that are left out so far.
    fn masked(&self) -> u64 {
        self.inner().map_or(0, |inner| inner.masked())
    }

    /// Laser cycles that recorded histograms are taken to have lasted: those of
    /// the shortest and of the longest capture.
    fn recorded_cycles(&self) -> Option<(u64, u64)> {
        self.inner()?.recorded_cycles()
    }

    /// Laser cycles a second, if that is known.
    fn laser_hz(&self) -> Option<u64> {
        self.inner()?.laser_hz()
    }

    /// Of pixels that `is_wanted` does not name no photons need be made from now on, if that
    /// saves time.
    fn spare(&mut self, _is_wanted: &dyn Fn(PixelAddress) -> bool) {}

    /// The photons of the next `cycles` laser cycles.
    ///
    /// # Errors
    /// What went wrong with the recording, naming file and place.
    fn next_slice(&mut self, cycles: u16) -> Result<Slice>;
}

/// Whether blocks of `level` have only neighbours: columns and rows lie side by side, and no
/// block reaches into another capture.
#[must_use]
pub fn has_only_neighbours(source: &dyn PhotonSource, level: BlockLevel) -> bool {
    let (rows, side) = (source.capture_rows(), 1 << level.raw());
    source.sides()[0] == "column" && (rows == source.array().rows() || rows.is_multiple_of(side))
}
