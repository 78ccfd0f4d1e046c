//! Histograms of pixels, one after another.

use std::ops::Range;

use anyhow::{Result, ensure};

/// Histograms of the same number of bins. A count takes as few bytes as the highest of them needs: 1, 2, 4 or 8.
///
/// ```
/// use dtof_data::photons::histograms::Histograms;
///
/// let histograms = Histograms::of([vec![0, 7, 1], vec![2, 300, 0]])?;
/// assert_eq!((histograms.len(), histograms.bins()), (2, 3));
/// assert_eq!(histograms.histogram(1), [2, 300, 0]);
/// assert_eq!(histograms.count(0, 1), 7);
/// # Ok::<(), anyhow::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Histograms {
    bins: usize,
    counts: Counts,
}

/// Counts of one size.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Counts {
    U8(Vec<u8>),
    U16(Vec<u16>),
    U32(Vec<u32>),
    U64(Vec<u64>),
}

impl Histograms {
    /// None yet, of `bins` bins each, at least 1.
    #[must_use]
    pub(crate) fn new(bins: usize) -> Self {
        Self {
            bins: bins.max(1),
            counts: Counts::U8(Vec::new()),
        }
    }

    /// Histograms of as many bins as the first has.
    ///
    /// # Errors
    /// Names the first without bins, or with another number of bins.
    pub fn of(histograms: impl IntoIterator<Item = Vec<u64>>) -> Result<Self> {
        let mut histograms = histograms.into_iter().peekable();
        let bins = histograms.peek().map_or(0, Vec::len);
        let mut all = Self::new(bins);
        for (place, histogram) in histograms.enumerate() {
            let found = histogram.len();
            ensure!(found > 0, "histogram {place} has no bins");
            ensure!(
                found == bins,
                "histogram {place} has {found} bins, not {bins}"
            );
            all.extend(&histogram);
        }
        Ok(all)
    }

    /// Appends the counts of one histogram after another. The last may be continued by the next counts.
    #[allow(clippy::cast_possible_truncation, reason = "none is above the highest")]
    pub(crate) fn extend(&mut self, counts: &[u64]) {
        let highest = counts.iter().copied().max().unwrap_or(0);
        if highest > self.counts.highest() {
            self.counts = self.counts.widened_for(highest);
        }
        match &mut self.counts {
            Counts::U8(all) => all.extend(counts.iter().map(|&count| count as u8)),
            Counts::U16(all) => all.extend(counts.iter().map(|&count| count as u16)),
            Counts::U32(all) => all.extend(counts.iter().map(|&count| count as u32)),
            Counts::U64(all) => all.extend(counts),
        }
    }

    /// Bins of a histogram.
    #[must_use]
    pub const fn bins(&self) -> usize {
        self.bins
    }

    /// Whole histograms.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.counts.len() / self.bins
    }

    /// Whether there is none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The histogram of pixel number `place`; empty if there is none.
    #[must_use]
    pub fn histogram(&self, place: usize) -> Vec<u64> {
        let first = place.saturating_mul(self.bins);
        self.counts.read(first..first.saturating_add(self.bins))
    }

    /// The photons in a bin of pixel number `place`; 0 if there is none.
    #[must_use]
    pub fn count(&self, place: usize, bin: usize) -> u64 {
        match place < self.len() && bin < self.bins {
            true => self.counts.get(place * self.bins + bin),
            false => 0,
        }
    }

    /// Adds the histogram of pixel number `place` to `sum`. Sums saturate.
    pub fn add_to(&self, place: usize, sum: &mut [u64]) {
        let first = place.saturating_mul(self.bins);
        let bins = first..first.saturating_add(self.bins);
        match &self.counts {
            Counts::U8(all) => add(sum, all.get(bins)),
            Counts::U16(all) => add(sum, all.get(bins)),
            Counts::U32(all) => add(sum, all.get(bins)),
            Counts::U64(all) => add(sum, all.get(bins)),
        }
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = Vec<u64>> {
        (0..self.len()).map(|place| self.histogram(place))
    }

    /// The same counts in another order: the first bin of each pixel has the count at the place that `first_of` gives, and
    /// the next one that `stride` further on.
    #[must_use]
    pub(crate) fn rearranged(&self, first_of: impl Fn(usize) -> usize, stride: usize) -> Self {
        let mut all = Self::new(self.bins);
        let mut histogram = vec![0; self.bins];
        for pixel in 0..self.len() {
            let first = first_of(pixel);
            for (bin, count) in histogram.iter_mut().enumerate() {
                *count = self.counts.get(first + bin * stride);
            }
            all.extend(&histogram);
        }
        all
    }
}

/// Adds counts to sums, which saturate.
pub(crate) fn add<T: Copy + Into<u64>>(sum: &mut [u64], counts: Option<&[T]>) {
    for (sum, &count) in sum.iter_mut().zip(counts.unwrap_or_default()) {
        *sum = sum.saturating_add(count.into());
    }
}

impl Counts {
    const fn len(&self) -> usize {
        match self {
            Self::U8(all) => all.len(),
            Self::U16(all) => all.len(),
            Self::U32(all) => all.len(),
            Self::U64(all) => all.len(),
        }
    }

    /// The highest count of this size.
    const fn highest(&self) -> u64 {
        match self {
            Self::U8(_) => u8::MAX as u64,
            Self::U16(_) => u16::MAX as u64,
            Self::U32(_) => u32::MAX as u64,
            Self::U64(_) => u64::MAX,
        }
    }

    /// The same counts in the size that `highest` needs, which is a larger one.
    #[allow(clippy::cast_possible_truncation, reason = "none is above the highest")]
    fn widened_for(&self, highest: u64) -> Self {
        let all = (0..self.len()).map(|place| self.get(place));
        match highest {
            0..=0xffff => Self::U16(all.map(|count| count as u16).collect()),
            0x1_0000..=0xffff_ffff => Self::U32(all.map(|count| count as u32).collect()),
            _ => Self::U64(all.collect()),
        }
    }

    fn get(&self, place: usize) -> u64 {
        let count = match self {
            Self::U8(all) => all.get(place).map(|&count| count.into()),
            Self::U16(all) => all.get(place).map(|&count| count.into()),
            Self::U32(all) => all.get(place).map(|&count| count.into()),
            Self::U64(all) => all.get(place).copied(),
        };
        count.unwrap_or(0)
    }

    /// Those of a range; none if it reaches past the end.
    fn read(&self, range: Range<usize>) -> Vec<u64> {
        fn wide<T: Copy + Into<u64>>(counts: Option<&[T]>) -> Vec<u64> {
            let counts = counts.unwrap_or_default().iter();
            counts.map(|&count| count.into()).collect()
        }
        match self {
            Self::U8(all) => wide(all.get(range)),
            Self::U16(all) => wide(all.get(range)),
            Self::U32(all) => wide(all.get(range)),
            Self::U64(all) => wide(all.get(range)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A count of every number of bits.
    fn count() -> impl Strategy<Value = u64> {
        (0_u32..65).prop_flat_map(|bits| {
            let most = u64::MAX.checked_shr(64 - bits).unwrap_or(0);
            0..=most
        })
    }

    proptest! {
        /// Whatever the counts and in whatever parts they come, they are read as they were, from as few bytes as the highest
        /// needs.
        #[test]
        fn counts_are_kept(
            counts in prop::collection::vec(count(), 0..60),
            bins in 1_usize..9,
            parts in 1_usize..20,
        ) {
            let mut histograms = Histograms::new(bins);
            counts.chunks(parts).for_each(|part| histograms.extend(part));
            let whole = counts.chunks_exact(bins);
            prop_assert_eq!(histograms.len(), whole.len());
            for (place, expected) in whole.enumerate() {
                prop_assert_eq!(histograms.histogram(place), expected);
                for (bin, &expected) in expected.iter().enumerate() {
                    prop_assert_eq!(histograms.count(place, bin), expected);
                }
            }
            let mut sum = vec![u64::MAX - 5; bins];
            (0..=histograms.len()).for_each(|place| histograms.add_to(place, &mut sum));
            for (bin, sum) in sum.into_iter().enumerate() {
                let in_bin = counts.chunks_exact(bins).map(|histogram| histogram[bin]);
                prop_assert_eq!(sum, in_bin.fold(u64::MAX - 5, u64::saturating_add));
            }
            for past in [histograms.len(), usize::MAX] {
                prop_assert_eq!(histograms.histogram(past), [0; 0]);
                prop_assert_eq!((histograms.count(past, 0), histograms.count(0, bins)), (0, 0));
            }
            let highest = counts.iter().copied().max().unwrap_or(0);
            let bytes = match &histograms.counts {
                Counts::U8(_) => 1,
                Counts::U16(_) => 2,
                Counts::U32(_) => 4,
                Counts::U64(_) => 8,
            };
            let needed = [1, 2, 4, 8].into_iter().find(|bytes| highest.checked_shr(8 * bytes).unwrap_or(0) == 0);
            prop_assert_eq!(Some(bytes), needed);
            let each = Histograms::of(counts.chunks(bins).map(<[u64]>::to_vec));
            match counts.len() % bins {
                rest if rest == 0 || counts.len() < bins => {
                    let each = each.unwrap();
                    prop_assert!(each.iter().eq(counts.chunks(bins)));
                    prop_assert!(rest > 0 || counts.is_empty() || each == histograms);
                }
                rest => {
                    let expected = format!("histogram {} has {rest} bins, not {bins}", counts.len() / bins);
                    prop_assert_eq!(each.unwrap_err().to_string(), expected);
                }
            }
            let last = histograms.len() * bins;
            // Bin by bin in the file.
            let turned = histograms.rearranged(|place| place, histograms.len());
            let pixels = histograms.len();
            let expected = (0..last).map(|at| counts[at % bins * pixels + at / bins]);
            prop_assert!(turned.iter().flatten().eq(expected));
        }
    }

    #[test]
    fn a_histogram_has_bins() {
        let error = Histograms::of([vec![1], vec![]]).unwrap_err();
        assert_eq!(error.to_string(), "histogram 1 has no bins");
        let none = Histograms::of([]).unwrap();
        assert!(none.is_empty() && none.iter().next().is_none());
    }
}
