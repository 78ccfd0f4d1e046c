//! What a part of a recording has to know of the whole, to be replayed as it is there.

use anyhow::{Context, Result, ensure};
use dtof_core::Array;

use super::{Capture, totals};

/// The recording that a part is of.
///
/// The random numbers of a pixel depend on the seed and its address. How many laser cycles a
/// capture lasted depends on its brightest pixel, and how many are drawn at a time on all pixels:
/// the photons of each say both.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Whole {
    /// Its array.
    pub array: Array,
    /// Of each capture the photons of each pixel, in the order of addresses.
    pub captures: Vec<Vec<u64>>,
    /// The address of the first pixel of the part.
    pub first: usize,
    /// Photons in bins that were cut off before.
    pub cut_off: u64,
    /// Addresses of pixels that say nothing of how long it lasted, such as hot ones.
    pub masked: Vec<u16>,
}

impl Whole {
    /// The whole of `totals`, the photons of each of its pixels, in so many captures.
    ///
    /// # Errors
    /// If there is no such array.
    pub fn new(array: Array, captures: usize, totals: &[u64], first: usize) -> Result<Self> {
        ensure!(
            captures > 0
                && totals.len() == array.pixels() as usize
                && (array.rows() as usize).is_multiple_of(captures),
            "{} pixels in {captures} captures are no {} rows of {} columns",
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

    /// The same, its length said by the pixels that are not `masked`.
    #[must_use]
    pub fn with_masked(self, masked: Vec<u16>) -> Self {
        Self { masked, ..self }
    }

    /// All of `captures`, each of `array`.
    ///
    /// # Errors
    /// If there are no captures, more pixels than addresses, or more photons in a histogram than
    /// can be counted.
    pub fn of(array: Array, captures: &[Capture]) -> Result<Self> {
        ensure!(!captures.is_empty(), "no captures");
        let pixels = array.pixels() as usize;
        let are_whole = captures.iter().all(|capture| capture.len() == pixels);
        ensure!(are_whole, "a capture has other than {pixels} histograms");
        let rows = u32::try_from(captures.len())?.saturating_mul(array.rows());
        let whole = Array::new(array.columns(), rows);
        Ok(Self {
            array: whole.context("more than 65,536 pixels")?,
            captures: captures.iter().map(totals).collect::<Result<_>>()?,
            first: 0,
            cut_off: 0,
            masked: Vec::new(),
        })
    }

    /// The same, less so many photons in bins that were cut off.
    #[must_use]
    pub fn with_cut_off(self, cut_off: u64) -> Self {
        Self { cut_off, ..self }
    }

    /// Rows of a capture.
    pub(super) fn capture_rows(&self) -> Result<u32> {
        Ok(self.array.rows() / u32::try_from(self.captures.len().max(1))?)
    }

    /// Pixels with so many photons each are this part of it.
    pub(super) fn check(&self, totals: &[u64]) -> Result<()> {
        let mut there = self.captures.iter().flatten().skip(self.first);
        for (number, total) in totals.iter().enumerate() {
            let pixel = self.first + number;
            let of_whole = there.next();
            let of_whole = of_whole.with_context(|| format!("there is no pixel {pixel}"))?;
            ensure!(
                total == of_whole,
                "pixel {pixel} has {total} photons, but {of_whole} when all were counted: did the \
                 recording change?"
            );
        }
        Ok(())
    }

    /// Blocks of `side` pixels a side are in the part of `pixels` pixels whole, or not at all.
    ///
    /// # Errors
    /// If one is in it by half.
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
