//! The layout of a recording, which a part of it needs to replay the same photons.

use anyhow::{Context, Result, ensure};
use dtof_core::Array;

use super::{Capture, totals};

/// The layout of a whole recording.
///
/// The random numbers of a pixel depend on the seed and its address. The length of a capture
/// depends on its brightest pixel, and the length of a chunk on all pixels. Both follow from the
/// photons of each pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// The array of all captures.
    pub array: Array,
    /// The photons of each pixel of each capture, in the order of addresses.
    pub captures: Vec<Vec<u64>>,
    /// The address of the first pixel of the part.
    pub first: usize,
    /// Photons in bins that were cut off.
    pub cut_off: u64,
    /// Addresses of pixels that do not count for the length, such as hot ones.
    pub masked: Vec<u16>,
}

impl Layout {
    /// The layout of `captures` captures whose pixels have `totals` photons.
    ///
    /// # Errors
    /// Fails if the pixels do not fill the captures of the array.
    pub fn new(array: Array, captures: usize, totals: &[u64], first: usize) -> Result<Self> {
        ensure!(
            captures > 0
                && totals.len() == array.pixels() as usize
                && (array.rows() as usize).is_multiple_of(captures),
            "{} pixels in {captures} captures do not make {} rows of {} columns",
            totals.len(),
            array.rows(),
            array.columns()
        );
        Ok(Self {
            array,
            captures: totals
                .chunks(totals.len() / captures)
                .map(<[_]>::to_vec)
                .collect(),
            first,
            cut_off: 0,
            masked: Vec::new(),
        })
    }

    /// The layout of `captures`, each of `array`.
    ///
    /// # Errors
    /// Fails if there are no captures, more pixels than addresses, or too many photons in a
    /// histogram.
    pub fn from_captures(array: Array, captures: &[Capture]) -> Result<Self> {
        ensure!(!captures.is_empty(), "no captures");
        let pixels = array.pixels() as usize;
        let are_complete = captures.iter().all(|capture| capture.len() == pixels);
        ensure!(are_complete, "a capture does not have {pixels} histograms");
        let rows = u32::try_from(captures.len())?.saturating_mul(array.rows());
        let layout = Array::new(array.columns(), rows);
        Ok(Self {
            array: layout.context("more than 65,536 pixels")?,
            captures: captures.iter().map(totals).collect::<Result<_>>()?,
            first: 0,
            cut_off: 0,
            masked: Vec::new(),
        })
    }

    /// Rows of a capture.
    pub(super) fn capture_rows(&self) -> Result<u32> {
        Ok(self.array.rows() / u32::try_from(self.captures.len().max(1))?)
    }

    /// Checks that `totals` are the photons of the pixels from `first` on.
    pub(super) fn check(&self, totals: &[u64]) -> Result<()> {
        let mut totals_of_layout = self.captures.iter().flatten().skip(self.first);
        for (number, total) in totals.iter().enumerate() {
            let pixel = self.first + number;
            let expected = totals_of_layout.next();
            let expected = expected.with_context(|| format!("there is no pixel {pixel}"))?;
            ensure!(
                total == expected,
                "pixel {pixel} has {total} photons, but {expected} when all were counted: did the \
                 recording change?"
            );
        }
        Ok(())
    }

    /// Checks that no block of `side` pixels a side is only partly among the `pixels` of the part.
    ///
    /// # Errors
    /// Fails if a block is cut.
    pub fn has_whole_blocks(&self, pixels: usize, side: usize) -> Result<()> {
        let columns = self.array.columns() as usize;
        let (begin, end) = (self.first, self.first + pixels);
        let is_cut = |pixel: usize| {
            pixel < self.array.pixels() as usize && !pixel.is_multiple_of(side * columns)
        };
        ensure!(
            !is_cut(begin) && !is_cut(end),
            "rows {} to {} cut blocks of {side}x{side} pixels: split at multiples of {side} rows",
            begin / columns,
            end.div_ceil(columns)
        );
        Ok(())
    }
}
