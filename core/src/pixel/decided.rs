//! What an event was decided from.

use crate::histogram::Histogram;
use crate::histogram::counter::CounterWidth;
use crate::histogram::peeled::PeeledBins;
use crate::units::BinIndex;

/// What a pixel knew when it decided for an event: enough to decide once more.
/// [`AsyncPixel::end_laser_cycles_seen`](crate::AsyncPixel::end_laser_cycles_seen) shows it.
#[derive(Clone, Debug)]
pub struct Decided<'a, const BINS: usize, W: CounterWidth> {
    /// The histogram of the exposure. The bins around its earlier echoes are empty.
    pub histogram: &'a Histogram<BINS, W>,
    /// Where a pixel that tracks expected the event.
    pub expected: Option<BinIndex>,
    /// The bins around the earlier echoes.
    pub peeled: PeeledBins,
}

impl<'a, const BINS: usize, W: CounterWidth> Decided<'a, BINS, W> {
    /// From the histogram alone.
    pub(super) const fn plainly(histogram: &'a Histogram<BINS, W>) -> Self {
        Self {
            histogram,
            expected: None,
            peeled: PeeledBins::NONE,
        }
    }
}
