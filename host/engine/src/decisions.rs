//! What the last event of each pixel was decided from.
//!
//! A pixel starts over the moment it reports, so that its histogram is copied right before. That
//! takes as much memory as the pixels themselves.

use dtof_core::{Array, BinIndex, CounterWidth, Decided, DepthEvent, PeeledBins, PixelAddress};

/// An event, and what it was decided from.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// The event.
    pub event: DepthEvent,
    /// The histogram of its exposure. The bins around earlier echoes are empty.
    pub counts: Vec<u16>,
    /// Where a pixel that tracks expected it.
    pub expected: Option<BinIndex>,
    /// The bins around earlier echoes of the exposure.
    pub peeled: PeeledBins,
}

/// By level and pixel.
pub(super) fn sort(decisions: &mut [Decision]) {
    decisions.sort_unstable_by_key(|decision| (decision.event.level, decision.event.pixel));
}

/// Room for the last decision of a pixel or a block.
#[derive(Clone, Debug)]
pub struct LastDecision<const BINS: usize> {
    event: Option<DepthEvent>,
    counts: [u16; BINS],
    expected: Option<BinIndex>,
    peeled: PeeledBins,
}

impl<const BINS: usize> LastDecision<BINS> {
    /// None yet, if it `is_wanted`.
    #[must_use]
    pub fn room(is_wanted: bool) -> Option<Box<Self>> {
        is_wanted.then(|| {
            Box::new(Self {
                event: None,
                counts: [0; BINS],
                expected: None,
                peeled: PeeledBins::NONE,
            })
        })
    }

    /// Takes what an event is decided from.
    #[inline]
    pub fn see<W: CounterWidth<Counter = u16>>(&mut self, decided: &Decided<'_, BINS, W>) {
        self.counts = *decided.histogram.counts();
        self.expected = decided.expected;
        self.peeled = decided.peeled;
    }

    /// Takes the event itself.
    #[inline]
    pub const fn report(&mut self, event: DepthEvent) {
        self.event = Some(event);
    }

    /// The decision, if there was one.
    #[must_use]
    pub fn decision(&self) -> Option<Decision> {
        Some(Decision {
            event: self.event?,
            counts: self.counts.to_vec(),
            expected: self.expected,
            peeled: self.peeled,
        })
    }
}

/// The pixels whose decisions are kept: all of a small array, those of every second column and
/// row of a larger one, of every fourth, and so on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kept {
    columns: u32,
    /// Each so many columns and rows, from the first.
    pub every: u32,
}

impl Kept {
    /// Bins that are kept of pixels, at most: 64 × 64 histograms of 128 bins. Those of blocks
    /// come to it, a third at most.
    pub const MOST_BINS: usize = 1 << 19;

    /// Those of an array with so many bins a pixel.
    #[must_use]
    pub fn of(array: Array, bins: usize) -> Self {
        let taken = |every: u32| {
            let pixels =
                array.columns().div_ceil(every) as usize * array.rows().div_ceil(every) as usize;
            pixels * bins
        };
        // Blocks begin at these, too.
        let mut powers = (0..32).map(|power| 1 << power);
        let every = powers.find(|&every| taken(every) <= Self::MOST_BINS);
        Self {
            columns: array.columns(),
            every: every.unwrap_or(1 << 31),
        }
    }

    /// Whether the decisions of `pixel` are kept, and of blocks that begin with it.
    #[must_use]
    pub fn holds(&self, pixel: PixelAddress) -> bool {
        let [column, row] = [
            u32::from(pixel.0) % self.columns,
            u32::from(pixel.0) / self.columns,
        ];
        column.is_multiple_of(self.every) && row.is_multiple_of(self.every)
    }
}

#[cfg(test)]
mod tests;
