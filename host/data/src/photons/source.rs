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

    /// Laser cycles from now on that surely hold at most `photons` photons of all pixels; 0 if unknown.
    fn sparse_cycles(&self, photons: u64) -> u64 {
        self.inner().map_or(0, |inner| inner.sparse_cycles(photons))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photons::histograms::Histograms;
    use crate::photons::recorded::{RecordedHistograms, RecordingLength};
    use std::iter::repeat_n;

    fn array(columns: u32, rows: u32) -> Array {
        Array::new(columns, rows).unwrap()
    }

    /// A source without photons that has only what each must have.
    struct Plain;

    impl PhotonSource for Plain {
        fn array(&self) -> Array {
            array(2, 3)
        }

        fn cycles(&self) -> u64 {
            70
        }

        fn next_slice(&mut self, _: u16) -> Result<Slice> {
            unreachable!()
        }
    }

    /// The same with all else.
    struct Full;

    impl PhotonSource for Full {
        fn array(&self) -> Array {
            Plain.array()
        }

        fn axis_names(&self) -> [&'static str; 2] {
            ["zone", "capture"]
        }

        fn capture_rows(&self) -> u32 {
            7
        }

        fn addresses(&self) -> Vec<PixelAddress> {
            [3, 5].map(PixelAddress::new).into()
        }

        fn cycles(&self) -> u64 {
            Plain.cycles()
        }

        fn photons_per_cycle(&self) -> f64 {
            2.5
        }

        fn sparse_cycles(&self, photons: u64) -> u64 {
            photons + 1
        }

        fn not_replayed(&self) -> u64 {
            8
        }

        fn masked(&self) -> u64 {
            9
        }

        fn recorded_cycles(&self) -> Option<(u64, u64)> {
            Some((10, 11))
        }

        fn laser_hz(&self) -> Option<u64> {
            Some(12)
        }

        fn next_slice(&mut self, cycles: u16) -> Result<Slice> {
            Plain.next_slice(cycles)
        }
    }

    /// Changes the photons of another.
    struct Outer;

    impl PhotonSource for Outer {
        fn inner(&self) -> Option<&dyn PhotonSource> {
            Some(&Full)
        }

        fn array(&self) -> Array {
            Plain.array()
        }

        fn cycles(&self) -> u64 {
            Plain.cycles()
        }

        fn next_slice(&mut self, cycles: u16) -> Result<Slice> {
            Plain.next_slice(cycles)
        }
    }

    #[test]
    fn what_a_source_does_not_say_is_that_of_the_source_it_changes() {
        let values = |source: &dyn PhotonSource| {
            (
                (source.axis_names(), source.capture_rows()),
                source
                    .addresses()
                    .iter()
                    .map(|address| address.raw())
                    .collect::<Vec<_>>(),
                (source.photons_per_cycle(), source.sparse_cycles(6)),
                [source.not_replayed(), source.masked()],
                source.recorded_cycles(),
                source.laser_hz(),
            )
        };
        let full = (
            (["zone", "capture"], 7),
            vec![3, 5],
            (2.5, 7),
            [8, 9],
            Some((10, 11)),
            Some(12),
        );
        assert_eq!(values(&Full), full);
        assert_eq!(values(&Outer), full);
        let plain = (
            (["column", "row"], 3),
            vec![0, 1, 2, 3, 4, 5],
            (0.0, 0),
            [0, 0],
            None,
            None,
        );
        assert_eq!(values(&Plain), plain);
    }

    #[test]
    fn blocks_have_only_neighbours_within_captures_of_columns_and_rows() {
        for (captures, rows, names, levels, is_one) in [
            (1, 5, ["column", "row"], [true; 4], true),
            (2, 4, ["column", "row"], [true, true, true, false], false),
            (2, 3, ["column", "row"], [true, false, false, false], false),
            (1, 4, ["zone", "capture"], [false; 4], false),
            (2, 4, ["zone", "capture"], [false; 4], false),
        ] {
            let each = array(3, rows);
            let pixels = captures * each.pixels() as usize;
            let captures = Histograms::of(repeat_n(vec![1; 8], pixels)).unwrap();
            let length = RecordingLength::Cycles(9);
            let source = RecordedHistograms::new(each, &captures, length, 9, 1).unwrap();
            let source = source.with_axis_names(names);
            let by_level = [0, 1, 2, 3]
                .map(|level| has_only_neighbours(&source, BlockLevel::saturating(level)));
            assert_eq!(by_level, levels, "{rows} {names:?}");
            assert_eq!(is_one_capture(&source), is_one);
        }
    }
}
