//! From bins to millimetres.
//!
//! ```
//! use dtof_core::fixed::types::{I24F8, U16F16};
//! use dtof_core::{BinIndex, BinPosition, RangeScale, SubBinOffset, checked};
//!
//! // 250 ps bins are 37.474 mm each.
//! const SCALE: RangeScale = checked!(RangeScale::new(U16F16::lit("250"), I24F8::ZERO));
//! let offset = SubBinOffset::new(128 + 64).unwrap(); // 0.75 bins
//! let range = SCALE.range(BinPosition::of(BinIndex::saturating(40), offset));
//! assert_eq!(range, I24F8::lit("1527.066")); // 40.75 × 37.474, to 1/256 mm
//! ```
//!
//! Cost: one multiplication of 32 bits by 32 a range.

use fixed::types::{I24F8, I56F8, U16F16, U24F8};

use crate::check::impl_error;
use crate::units::BinPosition;

/// From bins to millimetres: bin width and range offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RangeScale {
    /// Millimetres a bin, 16 fractional bits.
    bin: u32,
    offset: I24F8,
}

/// A bin width or offset that cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum RangeScaleError {
    /// The bin width is zero, or so small that a bin rounds to 0 mm.
    ZeroBinWidth,
    /// The farthest or nearest position would lie beyond ±8,388 m, what the
    /// range format holds.
    OutOfRange,
}

impl RangeScaleError {
    /// The error in one line.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::ZeroBinWidth => "the bin width is zero",
            Self::OutOfRange => "1024 bins of this width and the offset reach beyond 8388 m",
        }
    }
}

impl_error!(RangeScaleError);

impl RangeScale {
    /// Half the speed of light in m/s: 0.149896229 mm a picosecond, exactly.
    const HALF_C: u64 = 149_896_229;

    /// `bin_width` in picoseconds, `offset` in millimetres, which is added to
    /// every range. The millimetres a bin are rounded to the nearest 1/65,536 mm.
    ///
    /// # Errors
    /// Fails if the bin width is zero or a position could lie beyond what the
    /// range format holds.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "millimetres a bin are less than a sixth of the picoseconds"
    )]
    pub const fn new(bin_width: U16F16, offset: I24F8) -> Result<Self, RangeScaleError> {
        // 32 + 28 bits.
        let bin = (bin_width.to_bits() as u64 * Self::HALF_C + 500_000_000) / 1_000_000_000;
        if bin == 0 {
            return Err(RangeScaleError::ZeroBinWidth);
        }
        let scale = Self {
            bin: bin as u32,
            offset,
        };
        let farthest = scale.raw_range(BinPosition::MAX);
        let nearest = scale.raw_range(BinPosition::MIN);
        if farthest > i32::MAX as i64 || nearest < i32::MIN as i64 {
            return Err(RangeScaleError::OutOfRange);
        }
        Ok(scale)
    }

    /// The range of a position, in millimetres with 8 fractional bits, within
    /// 0.01 mm of the real-valued formula.
    #[inline]
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "checked by `new`")]
    pub const fn range(&self, position: BinPosition) -> I24F8 {
        I24F8::from_bits(self.raw_range(position) as i32)
    }

    /// How far apart two positions are, from 1/256 bins to millimetres, rounded to the
    /// nearest 1/256 mm. The range offset cancels out.
    #[inline]
    #[must_use]
    pub const fn distance(&self, bins: i32) -> I56F8 {
        // 32 bits times 32 bits, 24 fractional bits.
        I56F8::from_bits((bins as i64 * self.bin as i64 + (1 << 15)) >> 16)
    }

    /// A distance between two positions, from millimetres to 1/256 bins, rounded to
    /// the nearest.
    #[inline]
    #[must_use]
    pub const fn bins_of(&self, distance: U24F8) -> u64 {
        // 32 + 16 bits; the bin is not 0.
        let distance = (distance.to_bits() as u64) << 16;
        match (distance + self.bin as u64 / 2).checked_div(self.bin as u64) {
            Some(bins) => bins,
            None => u64::MAX,
        }
    }

    /// In 1/256 mm, before it is narrowed.
    const fn raw_range(&self, position: BinPosition) -> i64 {
        // 19 bits times 32 bits, 24 fractional bits, rounded to the nearest.
        let range = position.raw() as i64 * self.bin as i64;
        ((range + (1 << 15)) >> 16) + self.offset.to_bits() as i64
    }
}
