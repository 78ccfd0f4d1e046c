//! Bins that are excluded because their echo was reported.
//!
//! A pixel that reports several echoes empties the bins around each, and excludes them for
//! the rest of the exposure. It decides on the other bins as before. A good reach is four
//! times the standard deviation of the pulse. A smaller one leaves parts of a bright pulse,
//! a larger one hides a second surface close by (`docs/results/figures.md`).
//!
//! ```
//! use dtof_core::{BinIndex, Histogram, RangeGate};
//! use dtof_core::rule::ExcludedBins;
//!
//! let mut histogram = Histogram::<128>::new();
//! histogram.add_batch(&[40, 40, 40, 41, 44, 90, 90]);
//! let mut excluded = ExcludedBins::new(4);
//! excluded.push(histogram.peak().bin);
//! assert_eq!(excluded.empty(&mut histogram), 5); // bins 36 to 44
//! assert_eq!((histogram.peak().bin.raw(), histogram.total()), (90, 2));
//! assert_eq!(excluded.bins_left(&RangeGate::<128>::new(40, 119)?), Some(75));
//! assert!(excluded.is_tail(BinIndex::saturating(46)));
//! # Ok::<(), dtof_core::GateError>(())
//! ```
//!
//! Cost: 5 bytes a pixel. On a Cortex-M4, 128 bins and with a window of 3 bins a look at a
//! pixel after an echo takes 617 instructions, any other 197.

use core::ops::RangeInclusive;

use super::Histogram;
use super::counter::CounterWidth;
use super::gate::RangeGate;
use crate::units::{BinIndex, EchoNumber};

/// The bins around the echoes that were reported in an exposure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ExcludedBins {
    /// Three bins of 10 bits from bit 0 on, and from bit 30 on how many of them are peaks: the last
    /// echo ends the exposure.
    peaks: [u8; 4],
    reach: u8,
}

const _: () = assert!(EchoNumber::LAST.raw() == 4 && BinIndex::MAX.raw() < 1 << 10);

impl ExcludedBins {
    /// No bins.
    pub const NONE: Self = Self::new(0);

    /// No bins yet. Each echo will exclude `reach` bins to either side of its peak.
    #[must_use]
    pub const fn new(reach: u8) -> Self {
        Self {
            peaks: [0; 4],
            reach,
        }
    }

    /// Excludes the bins around one more echo. Does nothing after the third.
    pub fn push(&mut self, peak: BinIndex) {
        let number = self.echoes();
        if number < 3 {
            let peaks = self.packed() | u32::from(peak.raw()) << (10 * number);
            self.peaks = peaks.wrapping_add(1 << 30).to_le_bytes();
        }
    }

    /// The number of echoes.
    #[inline]
    #[must_use]
    pub const fn echoes(&self) -> u8 {
        (self.packed() >> 30) as u8
    }

    /// Whether `bin` is excluded.
    #[must_use]
    pub fn contains(&self, bin: u16) -> bool {
        self.touches(bin, 0)
    }

    /// Whether one of the bins up to `beside` from `bin` is excluded.
    #[inline(never)]
    #[must_use]
    pub fn touches(&self, bin: u16, beside: u16) -> bool {
        let reach = u16::from(self.reach).saturating_add(beside);
        self.peaks().any(|peak| peak.abs_diff(bin) <= reach)
    }

    /// Whether `bin` is one of the `reach` bins right behind one of these ranges: a peak there
    /// may be the tail of the echo.
    #[inline(never)]
    #[must_use]
    pub fn is_tail(&self, bin: BinIndex) -> bool {
        let reach = u16::from(self.reach);
        let behind = |peak: u16| bin.raw().checked_sub(peak.saturating_add(reach));
        let mut behind = self.peaks().filter_map(behind);
        behind.any(|behind| (1..=reach).contains(&behind))
    }

    /// The number of gated bins that are not excluded. `None` if fewer than
    /// [`RangeGate::MIN_BINS`], too few for a decision.
    #[inline(always)]
    #[must_use]
    pub fn bins_left<const BINS: usize>(&self, gate: &RangeGate<BINS>) -> Option<u32> {
        let bins = u32::from(gate.last() + 1 - gate.first());
        if self.echoes() == 0 {
            return Some(bins);
        }
        let left = bins.saturating_sub(self.bins_among(gate.first()..=gate.last()));
        (left >= u32::from(RangeGate::<BINS>::MIN_BINS)).then_some(left)
    }

    /// How many of `bins` are excluded.
    #[inline(never)]
    #[must_use]
    pub(crate) fn bins_among(&self, bins: RangeInclusive<u16>) -> u32 {
        let mut count = 0;
        let mut before = Self::new(self.reach);
        for peak in self.peaks() {
            for bin in self.around(peak) {
                count += u32::from(bins.contains(&bin) && !before.contains(bin));
            }
            before.push(BinIndex::saturating(peak));
        }
        count
    }

    /// Empties these bins of `histogram`. Returns the photons they held.
    pub fn empty<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &mut Histogram<BINS, W>,
    ) -> u32 {
        let ranges = self.peaks().map(|peak| self.around(peak));
        histogram.empty(ranges)
    }

    /// The photons of these bins, as far as they are gated.
    pub(crate) fn photons<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
    ) -> u32 {
        let mut photons = 0u32;
        for bin in (gate.first()..=gate.last()).filter(|&bin| self.contains(bin)) {
            photons = photons.wrapping_add(histogram.count(bin.into()).unwrap_or(0));
        }
        photons
    }

    const fn packed(&self) -> u32 {
        u32::from_le_bytes(self.peaks)
    }

    #[allow(clippy::cast_possible_truncation)] // 10 bits
    fn peaks(&self) -> impl Iterator<Item = u16> + use<> {
        let packed = self.packed();
        (0..self.echoes()).map(move |echo| (packed >> (10 * echo)) as u16 & BinIndex::MAX.raw())
    }

    fn around(&self, peak: u16) -> RangeInclusive<u16> {
        let reach = u16::from(self.reach);
        peak.saturating_sub(reach)..=peak.saturating_add(reach)
    }
}
