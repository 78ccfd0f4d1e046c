//! The peak: the highest bin, the lowest index winning a tie.
//!
//! [`Histogram::peak`](crate::Histogram::peak) keeps it while counting. The
//! comparator tree here is the paper's hardware (section IV-B, "eight groups
//! ... 8-to-1 comparator tree"), for histograms that arrive whole and as the
//! model the running peak is checked against: both give the same bin and count
//! for every histogram.
//!
//! ```
//! use dtof_core::peak::ComparatorTree;
//!
//! let tree = ComparatorTree::of(&[3u16, 9, 1, 0, 9, 2, 2, 2]);
//! assert_eq!((tree.peak().bin.raw(), tree.peak().count.raw()), (1, 9));
//! // Its group winners hold the four quadrants' maxima as a by-product.
//! assert_eq!(tree.quadrant_maxima().map(|count| count.raw()), [9, 1, 9, 2]);
//! ```

use crate::units::{BinIndex, Count};

/// A bin and its count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Peak {
    /// Which bin.
    pub bin: BinIndex,
    /// How many photons it holds.
    pub count: Count,
}

impl Peak {
    /// The higher of two; `self`, which comes from lower bins, wins a tie.
    #[inline]
    #[must_use]
    fn or_higher(self, other: Self) -> Self {
        if other.count > self.count {
            other
        } else {
            self
        }
    }
}

/// Inputs of one comparator, and groups the bins are divided into.
const WAYS: usize = 8;

/// The paper's two-step peak search over one whole histogram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ComparatorTree {
    groups: [Peak; WAYS],
}

impl ComparatorTree {
    /// Finds the winner of each of the eight groups of `BINS / 8` neighbouring
    /// bins.
    ///
    /// `BINS` is a power of two from 8 to 1024 (checked when compiled). Counts
    /// beyond [`Count::MAX`] are compared as [`Count::MAX`].
    #[must_use]
    pub fn of<C: Copy + Into<u32>, const BINS: usize>(counts: &[C; BINS]) -> Self {
        const {
            assert!(BINS.is_power_of_two() && BINS >= WAYS && BINS <= 1024);
        }
        let mut groups = [Peak::default(); WAYS];
        let mut bins = 0..;
        for (winner, group) in groups.iter_mut().zip(counts.chunks(BINS / WAYS)) {
            for (&count, bin) in group.iter().zip(&mut bins) {
                *winner = winner.or_higher(Peak {
                    bin: BinIndex::saturating(bin),
                    count: Count::saturating(count.into()),
                });
            }
        }
        Self { groups }
    }

    /// The winner of the eight group winners: the peak.
    #[must_use]
    pub fn peak(&self) -> Peak {
        comparator(self.groups)
    }

    /// The highest count of each quarter of the bins, what the paper's
    /// background rule needs.
    #[must_use]
    pub fn quadrant_maxima(&self) -> [Count; 4] {
        let [a, b, c, d, e, f, g, h] = self.groups.map(|group| group.count);
        [a.max(b), c.max(d), e.max(f), g.max(h)]
    }
}

/// An 8-to-1 comparator in three levels; the first of equals wins.
fn comparator([a, b, c, d, e, f, g, h]: [Peak; WAYS]) -> Peak {
    let left = (a.or_higher(b)).or_higher(c.or_higher(d));
    let right = (e.or_higher(f)).or_higher(g.or_higher(h));
    left.or_higher(right)
}
