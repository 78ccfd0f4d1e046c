//! The paper's search for the peak (section IV-B; the README names the paper): eight groups, then one
//! 8-to-1 comparator.
//!
//! [`Histogram`](crate::Histogram) tracks its peak while counting. The tree models the
//! hardware and is what that peak is tested against. Both give the same bin and count for
//! every histogram.
//!
//! ```
//! use dtof_core::paper::ComparatorTree;
//!
//! let tree = ComparatorTree::of(&[3u16, 9, 1, 0, 9, 2, 2, 2]);
//! assert_eq!((tree.peak().bin.raw(), tree.peak().count.raw()), (1, 9));
//! // Its group winners hold the four quadrants' maxima as a by-product.
//! assert_eq!(tree.quadrant_maxima().map(|count| count.raw()), [9, 1, 9, 2]);
//! ```
//!
//! Cost: one pass over all bins.
//!
//! Source: the paper's section IV-B, "eight groups ... 8-to-1 comparator tree".

use crate::histogram::Peak;
use crate::units::{BinIndex, Count};

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
                let next = Peak {
                    bin: BinIndex::saturating(bin),
                    count: Count::saturating(count.into()),
                };
                *winner = higher(*winner, next);
            }
        }
        Self { groups }
    }

    /// The winner of the eight group winners: the peak.
    #[must_use]
    pub fn peak(&self) -> Peak {
        comparator(self.groups)
    }

    /// The highest count of each quarter of the bins, for the paper's background.
    #[must_use]
    pub fn quadrant_maxima(&self) -> [Count; 4] {
        let [a, b, c, d, e, f, g, h] = self.groups.map(|group| group.count);
        [a.max(b), c.max(d), e.max(f), g.max(h)]
    }
}

/// The higher of two; `one`, which comes from lower bins, wins a tie.
fn higher(one: Peak, other: Peak) -> Peak {
    if other.count > one.count { other } else { one }
}

/// An 8-to-1 comparator in three levels; the first of equals wins.
fn comparator([a, b, c, d, e, f, g, h]: [Peak; WAYS]) -> Peak {
    let left = higher(higher(a, b), higher(c, d));
    let right = higher(higher(e, f), higher(g, h));
    higher(left, right)
}
