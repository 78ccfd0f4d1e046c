//! The range gate: the bins that may hold the peak.
//!
//! Real sensors see the crosstalk of their cover glass, in recorded histograms as
//! a peak up to a hundred times the target's. A gate excludes it: photons outside
//! the gate never enter a pixel's histogram. The gated bins take the place of the
//! paper's whole histogram, for the peak, the background and the depth. The halves
//! and quadrants of the background rule are those of the gate; without a gate they
//! are exactly the paper's.
//!
//! ```
//! use dtof_core::{BinIndex, RangeGate};
//!
//! let gate = RangeGate::<128>::new(20, 119)?;
//! assert!(!gate.contains(19) && gate.contains(20) && gate.contains(119));
//! assert_eq!(gate.quadrant_starts(), [20, 45, 70, 95, 120]);
//! assert_eq!(RangeGate::<128>::full().quadrant_starts(), [0, 32, 64, 96, 128]);
//! # Ok::<(), dtof_core::GateError>(())
//! ```

use core::ops::Range;

use crate::check::impl_error;

/// First and last bin that may hold the peak, both inclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RangeGate<const BINS: usize> {
    first: u16,
    /// One past the last bin.
    end: u16,
}

/// Why a gate cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum GateError {
    /// The last bin lies past the histogram's last.
    PastLastBin,
    /// Fewer than [`RangeGate::MIN_BINS`] bins are left.
    TooNarrow,
}

impl GateError {
    /// The error in one line.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::PastLastBin => "the range gate ends past the last bin of the histogram",
            Self::TooNarrow => "the range gate leaves fewer than 8 bins",
        }
    }
}

impl_error!(GateError);

impl<const BINS: usize> RangeGate<BINS> {
    /// The fewest bins a gate may leave, as many as the smallest histogram has.
    pub const MIN_BINS: u16 = 8;

    /// All bins.
    #[must_use]
    pub const fn full() -> Self {
        const { assert!(BINS >= Self::MIN_BINS as usize && BINS <= 1024) };
        #[allow(clippy::cast_possible_truncation)] // at most 1024
        Self {
            first: 0,
            end: BINS as u16,
        }
    }

    /// From bin `first` to bin `last`, both inclusive.
    ///
    /// # Errors
    /// Fails if `last` is not a bin, or fewer than
    /// [`Self::MIN_BINS`] bins are left.
    pub const fn new(first: u16, last: u16) -> Result<Self, GateError> {
        if last >= Self::full().end {
            return Err(GateError::PastLastBin);
        }
        let end = last + 1;
        if first > last || end - first < Self::MIN_BINS {
            return Err(GateError::TooNarrow);
        }
        Ok(Self { first, end })
    }

    /// The first bin that may hold the peak.
    #[inline]
    #[must_use]
    pub const fn first(&self) -> u16 {
        self.first
    }

    /// The last bin that may hold the peak.
    #[must_use]
    pub const fn last(&self) -> u16 {
        self.end - 1
    }

    /// Whether `bin` may hold the peak.
    #[inline]
    #[must_use]
    pub const fn contains(&self, bin: u16) -> bool {
        // One comparison: bins before the first wrap to the far end.
        let first = self.first as u32;
        (bin as u32).wrapping_sub(first) < self.end as u32 - first
    }

    /// Whether it contains all bins.
    #[inline]
    pub(crate) const fn is_full(&self) -> bool {
        self.first == 0 && self.end as usize == BINS
    }

    /// The gated bins, as indices.
    #[inline]
    pub(crate) const fn bins(&self) -> Range<usize> {
        self.first as usize..self.end as usize
    }

    /// Where the four quadrants of the gated bins start, and where the last one
    /// ends: `first + k·n/4` for `n` gated bins, rounded down.
    #[inline]
    #[must_use]
    pub const fn quadrant_starts(&self) -> [u16; 5] {
        let bins = self.end - self.first;
        [
            self.first,
            self.first + bins / 4,
            self.first + bins / 2,
            self.first + bins * 3 / 4,
            self.end,
        ]
    }
}
