//! Sub-bin depth: where in its bins the pulse lies, and how far that is.
//!
//! Three-bin centre of mass (the paper's CMM, section III-A) with the
//! background taken off first: with `l`, `c`, `r` the counts of the peak bin's
//! left neighbour, itself and its right neighbour, less the background and not
//! below 0, the pulse lies
//!
//! ```text
//! peak bin + 0.5 + (r - l) / (l + c + r)      in bins from the start of bin 0
//! ```
//!
//! so that photons spread evenly over bin i give i + 0.5. The result is a
//! fixed-point number with 8 fractional bits, rounded to the nearest 1/256 bin.
//!
//! ```
//! use dtof_core::fixed::types::{I24F8, U16F16, U24F8};
//! use dtof_core::{BinPosition, Histogram, RangeGate, RangeScale, centre_of_mass};
//!
//! let mut histogram = Histogram::<128>::new();
//! histogram.add_batch(&[40, 40, 40, 41]);
//! let depth = centre_of_mass(&histogram, &RangeGate::full(), histogram.peak(), U24F8::ZERO);
//! assert_eq!(depth.offset.raw(), 128 + 64); // 40.75 bins
//!
//! // 250 ps bins are 37.474 mm each.
//! let scale = RangeScale::new(const { U16F16::lit("250") }, I24F8::ZERO)?;
//! let range = scale.range(BinPosition::of(histogram.peak().bin, depth.offset));
//! assert_eq!(range, I24F8::lit("1527.066")); // 40.75 × 37.474, to 1/256 mm
//! # Ok::<(), dtof_core::RangeScaleError>(())
//! ```

use core::fmt;

use fixed::types::{I24F8, I56F8, U16F16, U24F8};

use crate::flags::Flags;
use crate::gate::RangeGate;
use crate::histogram::{CounterWidth, Histogram};
use crate::peak::Peak;
use crate::units::{BinPosition, SubBinOffset};

/// A sub-bin estimate and what is to be said against it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Depth {
    /// From the start of the peak bin: 0 to 1 bin inclusive if that is the
    /// highest, −0.5 to 1.5 if it is not.
    pub offset: SubBinOffset,
    /// [`Flags::SATURATED`] if the counter of the peak bin is full,
    /// [`Flags::CLIPPED`] if the window reaches past the gate.
    pub flags: Flags,
}

/// Three-bin centre of mass around `peak`, less the `background` a bin.
///
/// Within 1/512 bin of the real-valued formula for 10- and 16-bit counters,
/// within 1/256 bin for 24-bit ones. With nothing above the background the
/// middle of the peak bin. A neighbour outside the gate counts as empty.
#[inline(always)]
#[must_use]
pub fn centre_of_mass<const BINS: usize, W: CounterWidth>(
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    peak: Peak,
    background: U24F8,
) -> Depth {
    let neighbour = |bin: u16| {
        if gate.contains(bin) {
            histogram.count(bin.into())
        } else {
            None
        }
    };
    let left = neighbour(peak.bin.raw().wrapping_sub(1));
    let right = neighbour(peak.bin.raw() + 1);

    let mut flags = Flags::NONE;
    if peak.count.raw() >= W::MAX {
        flags |= Flags::SATURATED;
    }
    if left.is_none() || right.is_none() {
        flags |= Flags::CLIPPED;
    }

    let above = |count: u32| (count << 8).saturating_sub(background.to_bits());
    let left = above(left.unwrap_or(0));
    let centre = above(peak.count.raw());
    let right = above(right.unwrap_or(0));
    // Only their ratio counts, so that what is past 22 bits, 14 of them whole counts,
    // may lose its last to keep the 256-fold numerator within 32.
    let excess = if W::BITS > 14 {
        10u32.saturating_sub((left | centre | right).leading_zeros())
    } else {
        0
    };
    let (left, centre, right) = (left >> excess, centre >> excess, right >> excess);
    let sum = left + centre + right;
    let numerator = (right.abs_diff(left) << 8) + sum / 2;
    // At most 128 when `peak` is the highest bin; limited to what the offset
    // holds when it is not.
    let shift = numerator.checked_div(sum).unwrap_or(0).min(256) as i16;
    let shift = if right < left { -shift } else { shift };
    Depth {
        offset: SubBinOffset::new(SubBinOffset::CENTRE.raw() + shift)
            .unwrap_or(SubBinOffset::CENTRE),
        flags,
    }
}

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
pub enum RangeScaleError {
    /// The bin width is zero, or so small that a bin rounds to 0 mm.
    ZeroBinWidth,
    /// The farthest or nearest position would lie beyond ±8,388 m, what the
    /// range format holds.
    OutOfRange,
}

impl fmt::Display for RangeScaleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ZeroBinWidth => "the bin width is zero",
            Self::OutOfRange => "1024 bins of this width and the offset reach beyond 8388 m",
        })
    }
}

impl core::error::Error for RangeScaleError {}

impl RangeScale {
    /// Half the speed of light in m/s: 0.149896229 mm a picosecond, exactly.
    const HALF_C: u64 = 149_896_229;

    /// `bin_width` in picoseconds, `offset` in millimetres, which is added to
    /// every range. The millimetres a bin are rounded to the nearest 1/65,536 mm.
    ///
    /// # Errors
    /// [`RangeScaleError`] if the bin width is zero or a position could lie
    /// beyond what the range format holds.
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
    /// nearest 1/256 mm. The range offset has no part in it.
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
        // 19 bits times 32 bits, 24 fractional bits; half of the last place
        // that stays is added before the rest is shifted out.
        let range = position.raw() as i64 * self.bin as i64;
        ((range + (1 << 15)) >> 16) + self.offset.to_bits() as i64
    }
}
