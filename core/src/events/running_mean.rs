//! The mean of the last events of a pixel.
//!
//! A single event is as noisy as its photons are few. The paper averages the last ten
//! for depth maps (section III-B) and three for dynamic depth (section III-E).
//!
//! ```
//! use dtof_core::{BinIndex, BinPosition, SubBinOffset};
//! use dtof_core::events::RunningMean;
//!
//! let at = |bin| BinPosition::of(BinIndex::saturating(bin), SubBinOffset::CENTRE);
//! let mut mean = RunningMean::<3>::new();
//! assert_eq!(mean.mean(), None);
//! for bin in [90, 10, 20, 30] {
//!     mean.push(at(bin));
//! }
//! assert_eq!(mean.mean(), Some(at(20))); // of the last three
//! ```

use crate::units::BinPosition;

/// The positions of the last `N` events, or of all if there were fewer. `N` is 1 to 255.
///
/// Takes `4·N + 4` bytes (asserted in `core/tests/events/running_mean.rs`).
#[derive(Clone, Debug)]
pub struct RunningMean<const N: usize> {
    /// In 1/256 bins; the oldest is at `next` once all places are taken.
    recent: [i32; N],
    next: u8,
    length: u8,
}

impl<const N: usize> RunningMean<N> {
    /// Without events.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(0 < N && N < 256, "the mean is of 1 to 255 events") };
        Self {
            recent: [0; N],
            next: 0,
            length: 0,
        }
    }

    /// Adds an event; once there are `N`, the oldest leaves.
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "N is less than 256")]
    pub fn push(&mut self, position: BinPosition) {
        let Some(oldest) = self.recent.get_mut(usize::from(self.next)) else {
            return;
        };
        *oldest = position.raw();
        self.next = if usize::from(self.next) + 1 < N {
            self.next + 1
        } else {
            0
        };
        if !self.is_full() {
            self.length += 1;
        }
    }

    /// The number of events in the mean.
    #[inline]
    #[must_use]
    pub const fn len(&self) -> usize {
        self.length as usize
    }

    /// Whether there was no event.
    #[inline]
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// Whether it is the mean of `N` events.
    #[inline]
    #[must_use]
    pub const fn is_full(&self) -> bool {
        self.length as usize == N
    }

    /// The sum of the positions, in 1/256 bins.
    #[inline]
    #[must_use]
    pub fn sum(&self) -> i32 {
        // Places not taken yet hold 0. At most 255 times 19 bits.
        self.recent.iter().sum()
    }

    /// The mean to the nearest 1/256 bin, halves up; `None` without events.
    #[inline]
    #[must_use]
    pub fn mean(&self) -> Option<BinPosition> {
        if self.is_empty() {
            return None;
        }
        let length = self.length as i32;
        // Up to two bins before bin 0: halves up there as well.
        BinPosition::new((self.sum() + length / 2).div_euclid(length))
    }
}

impl<const N: usize> Default for RunningMean<N> {
    fn default() -> Self {
        Self::new()
    }
}
