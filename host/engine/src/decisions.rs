//! The histogram from which the last event of each pixel was decided.
//!
//! A pixel starts over the moment it reports, so its histogram is copied just before. The copies
//! take as much memory as the pixels.

use dtof_core::rule::{DecisionInput, ExcludedBins};
use dtof_core::{Array, BinIndex, CounterWidth, DepthEvent, PixelAddress};

/// An event and its histogram.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// The event.
    pub event: DepthEvent,
    /// The histogram of its exposure. The bins around earlier echoes are empty, except with a dead
    /// time, which has the photons before the gate, too.
    pub counts: Vec<u32>,
    /// Laser cycles of the exposure. The event has no more than 16 bits for them.
    pub cycles: u32,
    /// The bin where a pixel that tracks expected its event.
    pub expected: Option<BinIndex>,
    /// The bins around earlier echoes of the exposure.
    pub excluded: ExcludedBins,
}

/// The last decision of a pixel or a block.
#[derive(Clone, Debug)]
pub struct LastDecision {
    event: Option<DepthEvent>,
    counts: Vec<u32>,
    cycles: u32,
    expected: Option<BinIndex>,
    excluded: ExcludedBins,
}

impl LastDecision {
    /// Allocates an empty decision, if it `is_kept`.
    #[must_use]
    pub fn allocate(is_kept: bool) -> Option<Box<Self>> {
        is_kept.then(|| {
            Box::new(Self {
                event: None,
                counts: Vec::new(),
                cycles: 0,
                expected: None,
                excluded: ExcludedBins::NONE,
            })
        })
    }

    /// Records the input of a decision.
    #[inline]
    pub fn record_input<const BINS: usize, W: CounterWidth>(
        &mut self,
        input: &DecisionInput<'_, BINS, W>,
    ) {
        let counts = input.histogram.counts().iter();
        self.counts.clear();
        self.counts.extend(counts.map(|&count| count.into()));
        self.cycles = input.cycles;
        self.expected = input.expected;
        self.excluded = input.excluded;
    }

    /// Records the event.
    #[inline]
    pub const fn record_event(&mut self, event: DepthEvent) {
        self.event = Some(event);
    }

    /// The decision, if there was an event.
    #[must_use]
    pub fn decision(&self) -> Option<Decision> {
        Some(Decision {
            event: self.event?,
            counts: self.counts.clone(),
            cycles: self.cycles,
            expected: self.expected,
            excluded: self.excluded,
        })
    }
}

/// Sorts by level and pixel. Not generic, so that it is compiled once.
pub(super) fn sort(decisions: &mut [Decision]) {
    decisions.sort_unstable_by_key(|decision| (decision.event.level, decision.event.pixel));
}

/// The pixels whose decisions are kept: all of a small array, step second column and row of a
/// larger one, step fourth, and so on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeptPixels {
    columns: u32,
    /// The step between columns and rows, from the first.
    pub step: u32,
}

impl KeptPixels {
    /// The most bins kept of pixels: 64 × 64 histograms of 128 bins. Blocks add at most a third.
    pub const MOST_BINS: usize = 1 << 19;

    /// The pixels of an array with `bins` bins a pixel.
    #[must_use]
    pub fn new(array: Array, bins: usize) -> Self {
        let pixels_kept = |step: u32| {
            let pixels =
                array.columns().div_ceil(step) as usize * array.rows().div_ceil(step) as usize;
            pixels * bins
        };
        // A power of two, as blocks begin at multiples of these.
        let mut step = 1;
        while step < Array::MOST_PIXELS && pixels_kept(step) > Self::MOST_BINS {
            step *= 2;
        }
        Self {
            columns: array.columns(),
            step,
        }
    }

    /// Whether the decisions of `pixel` are kept, and those of blocks that begin with it.
    #[must_use]
    pub fn contains(&self, pixel: PixelAddress) -> bool {
        let [column, row] = [
            u32::from(pixel.raw()) % self.columns,
            u32::from(pixel.raw()) / self.columns,
        ];
        column.is_multiple_of(self.step) && row.is_multiple_of(self.step)
    }
}

#[cfg(test)]
mod tests;
