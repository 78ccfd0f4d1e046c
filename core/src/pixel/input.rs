//! What an event was decided from.

use crate::histogram::Histogram;
use crate::histogram::counter::CounterWidth;
use crate::histogram::excluded::ExcludedBins;
use crate::units::BinIndex;

/// What the decision for an event was made from: enough to make it again. The observer of
/// [`AsyncPixel::end_laser_cycles_with`](crate::AsyncPixel::end_laser_cycles_with) gets it.
///
/// Exhaustive, because a program that decides on whole histograms builds it from its fields.
#[derive(Clone, Debug)]
pub struct DecisionInput<'a, const BINS: usize, W: CounterWidth> {
    /// The histogram of the exposure. The bins around its earlier echoes are empty. With a dead
    /// time they are not, and the bins before the gate have their photons, too.
    pub histogram: &'a Histogram<BINS, W>,
    /// Where a pixel that tracks expected the event.
    pub expected: Option<BinIndex>,
    /// The bins around the earlier echoes.
    pub excluded: ExcludedBins,
    /// Laser cycles of the exposure.
    pub cycles: u32,
}

impl<'a, const BINS: usize, W: CounterWidth> DecisionInput<'a, BINS, W> {
    /// From the histogram alone.
    pub(super) const fn plain(histogram: &'a Histogram<BINS, W>, cycles: u32) -> Self {
        Self {
            histogram,
            expected: None,
            excluded: ExcludedBins::NONE,
            cycles,
        }
    }
}

/// What a program keeps beside a pixel or a block.
pub trait PixelData: Default {
    /// The pixel or the block reports an event: what that was decided from. By default nothing. Not called for
    /// [whole histograms](crate::PixelArray::histogram).
    #[inline(always)]
    fn decided_from<const BINS: usize, W: CounterWidth>(
        &mut self,
        _input: &DecisionInput<'_, BINS, W>,
    ) {
    }
}

impl PixelData for () {}

/// Tells these data what a decision was made from. One type, so that looks are compiled once.
#[inline(always)]
pub(crate) fn observer<const BINS: usize, W: CounterWidth, T: PixelData>(
    data: &mut T,
) -> impl FnOnce(&DecisionInput<'_, BINS, W>) {
    |input| data.decided_from(input)
}
