//! Sub-bin depth from a window that lies evenly about the pulse.
//!
//! A centroid of whole bins around the peak bin is biased towards that bin, because those
//! bins hold more of one flank of the pulse than of the other. Here the window is as wide as
//! the pulse, and it moves until its photons balance: the sum of their distances from its
//! middle, the moment, is 0. A bin at the end of the window counts with the part inside, at
//! the middle of that part.
//!
//! The moment is computed about the middle of the peak bin, and from there in steps of half
//! a bin towards the photons, until it changes its sign. A straight line between the last
//! two moments gives the place:
//!
//! ```text
//! moment(x) = Σ n · ∫ u du     over the part of each bin from x - h to x + h, u from x on
//! place     = x + 1/2 bin · moment(x) / (moment(x) - moment(x + 1/2 bin))
//! ```
//!
//! with the half width `h` and `n` the photons of a bin. There is one division, and no
//! background is needed: a flat background has no moment. Moments about the middle of a bin
//! have a gain that corrects for the straight line, computed for a Gaussian pulse of the width
//! that suits the window (`window_weights`).
//!
//! With `h` = 2σ + 1/2 bins for a pulse of standard deviation σ the error is within 1.2 of
//! the Cramér–Rao bound, on average within 1.1: `core/tests/depth/error.rs` prints
//! and checks the table.
//!
//! A pulse that falls more slowly than it rises, as many do, has a wider window after the
//! place than before it ([`CentredWindow::with_sides`]). Photons of the wider side count
//! less, by the square of how much wider it is, so that a flat background still balances.
//! The place in the pulse depends on both half widths, and so does the range offset.
//!
//! ```
//! use dtof_core::fixed::types::{U8F8, U24F8};
//! use dtof_core::{CentredWindow, Histogram, RangeGate};
//!
//! let mut histogram = Histogram::<128>::new();
//! histogram.add_batch(&[40, 40, 40, 41, 41, 41]); // symmetric about 41.0
//! let window = CentredWindow::for_pulse(const { U8F8::lit("0.75") });
//! let gate = RangeGate::full();
//! let depth = window.estimate(&histogram, &gate, histogram.peak(), U24F8::ZERO);
//! assert_eq!(depth.offset.raw(), 256); // the peak is bin 40
//! ```
//!
//! Cost on a Cortex-M4: 133 to 139 instructions, once an event.

use fixed::types::{U8F8, U24F8};

use super::estimate::DepthEstimate;
use super::rates::{PEAK, REACH, Rates};
use super::window_weights::Weights;
use crate::flags::Flags;
use crate::histogram::counter::{Count10, CounterWidth};
use crate::histogram::excluded::ExcludedBins;
use crate::histogram::gate::RangeGate;
use crate::histogram::{Histogram, Peak, mean};
use crate::units::{BinIndex, Count, SubBinOffset};

/// A window that moves onto the pulse, and how far it reaches before and after its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CentredWindow {
    before: U8F8,
    after: U8F8,
    weights: Weights,
}

/// [`PEAK`] as a number of bins of the histogram.
const BEFORE: u16 = 6;
/// A window moves no farther than the start of the bin two before the peak bin, or two after.
const ENDS: [usize; 2] = [PEAK - 2, PEAK + 2];

/// The counters that a window can reach.
type Bins<W> = [<W as CounterWidth>::Counter; REACH];

impl CentredWindow {
    /// The narrowest half width: 1 bin.
    pub const MIN: U8F8 = U8F8::lit("1");
    /// The widest half width: 4 bins.
    pub const MAX: U8F8 = U8F8::lit("4");
    /// The widest pulse that a window suits, as a standard deviation in bins.
    pub const WIDEST_PULSE: U8F8 = U8F8::lit("1.75");
    /// The half width minus twice the pulse's standard deviation.
    const MARGIN: U8F8 = U8F8::lit("0.5");

    /// From half the width in bins; `None` outside [`Self::MIN`]..=[`Self::MAX`].
    #[must_use]
    pub const fn new(half_width: U8F8) -> Option<Self> {
        Self::with_sides(half_width, half_width)
    }

    /// From the half widths before and after the place, in bins; `None` if one is outside
    /// [`Self::MIN`]..=[`Self::MAX`].
    #[must_use]
    pub const fn with_sides(before: U8F8, after: U8F8) -> Option<Self> {
        const fn is_one(half_width: U8F8) -> bool {
            let bits = half_width.to_bits();
            bits >= CentredWindow::MIN.to_bits() && bits <= CentredWindow::MAX.to_bits()
        }
        if is_one(before) && is_one(after) {
            Some(Self::with_weights(before, after))
        } else {
            None
        }
    }

    /// For a pulse of the standard deviation `sigma` in bins: a half width of
    /// `2·sigma + 1/2`, limited to [`Self::MIN`] and [`Self::MAX`], which suits pulses of
    /// 0.4 to 1.75 bins.
    #[must_use]
    pub const fn for_pulse(sigma: U8F8) -> Self {
        let half_width = sigma.saturating_add(sigma).saturating_add(Self::MARGIN);
        match Self::new(half_width) {
            Some(window) => window,
            None if half_width.to_bits() < Self::MIN.to_bits() => {
                Self::with_weights(Self::MIN, Self::MIN)
            }
            None => Self::with_weights(Self::MAX, Self::MAX),
        }
    }

    // Out of line, for programs that get their settings at run time.
    #[inline(never)]
    const fn with_weights(before: U8F8, after: U8F8) -> Self {
        Self {
            before,
            after,
            weights: Weights::of(before.to_bits(), after.to_bits()),
        }
    }

    /// How far the window reaches before its place, in bins.
    #[must_use]
    pub const fn before(&self) -> U8F8 {
        self.before
    }

    /// How far the window reaches after its place, in bins.
    #[must_use]
    pub const fn after(&self) -> U8F8 {
        self.after
    }

    /// The first and the last gated bin that is no farther from `bin` than a half width.
    #[inline(always)]
    pub(super) fn inside<const BINS: usize>(&self, gate: &RangeGate<BINS>, bin: u16) -> (u16, u16) {
        let (before, after) = (self.before.to_bits(), self.after.to_bits());
        let first = bin.saturating_sub(before.div_ceil(256)).max(gate.first());
        let last = bin.saturating_add(after.div_ceil(256)).min(gate.last());
        (first, last)
    }

    /// The mean of the gated bins farther from the peak bin than a half width, in 1/256
    /// rounded down; `None` if there are none, or the peak is not in the gate. Of these,
    /// `left_out` bins are excluded: they are empty and do not count.
    #[inline(never)]
    fn background_outside<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
        left_out: u32,
    ) -> Option<U24F8> {
        let bin = peak.bin.raw();
        if !gate.contains(bin) {
            return None;
        }
        let (first, last) = self.inside(gate, bin);
        let inside = histogram.counts().get(first.into()..=last.into())?;
        let inside_bins = u32::from(last + 1 - first);
        let inside = inside
            .iter()
            .fold(0, |sum: u32, &count| sum.wrapping_add(count.into()));
        let bins = u32::from(gate.last() + 1 - gate.first()).checked_sub(left_out)?;
        mean(
            histogram.total().wrapping_sub(inside),
            bins.checked_sub(inside_bins)?,
        )
    }

    /// The depth of the pulse around `peak`.
    ///
    /// Counts of more than 10 bits lose their lowest bits, as many as bring the peak to 10.
    /// A bin outside the gate counts as `background`. [`Flags::CLIPPED`] marks a window that
    /// reaches there, or an offset at the limit of [`SubBinOffset`]; [`Flags::SATURATED`] a
    /// full counter of the peak bin.
    #[must_use]
    pub fn estimate<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
        background: U24F8,
    ) -> DepthEstimate {
        match bins_within(histogram, gate, peak.bin) {
            Some(bins) => self.depth::<W>(bins, peak.count),
            None => self.at_the_gate(histogram, gate, peak, background),
        }
    }

    /// The same with excluded bins. The background is the mean outside if there are bins for
    /// it.
    #[inline(always)]
    pub(super) fn estimate_without<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
        background: U24F8,
        excluded: &ExcludedBins,
    ) -> DepthEstimate {
        match bins_within(histogram, gate, peak.bin) {
            Some(bins) => self.depth::<W>(bins, peak.count),
            None => self.at_the_gate_without(histogram, gate, peak, background, excluded),
        }
    }

    #[cold]
    #[inline(never)]
    fn at_the_gate_without<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
        background: U24F8,
        excluded: &ExcludedBins,
    ) -> DepthEstimate {
        let mut left_out = 0;
        if excluded.echoes() > 0 {
            let (first, last) = self.inside(gate, peak.bin.raw());
            left_out =
                excluded.bins_among(gate.first()..=gate.last()) - excluded.bins_among(first..=last);
        }
        let outside = self.background_outside(histogram, gate, peak, left_out);
        self.at_the_gate(histogram, gate, peak, outside.unwrap_or(background))
    }

    /// The depth if the window reaches past the gate. Bins there count as `background`.
    #[inline(never)]
    fn at_the_gate<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
        background: U24F8,
    ) -> DepthEstimate {
        let background = (background.to_bits().saturating_add(128) >> 8).min(W::MAX);
        let mut bins = [W::counter(background); REACH];
        let first = peak.bin.raw().wrapping_sub(BEFORE);
        for (number, bin) in (0..).zip(&mut bins) {
            let number = first.wrapping_add(number);
            if gate.contains(number) {
                *bin = W::counter(histogram.count(number.into()).unwrap_or(0));
            }
        }
        let mut depth = self.depth::<W>(&bins, peak.count);
        depth.flags |= self.clipped(gate, peak.bin, depth.offset);
        depth
    }

    /// The depth of the pulse about the bin `peak` from the light of the bins.
    pub(super) fn of_rates<const BINS: usize>(
        &self,
        rates: &Rates,
        gate: &RangeGate<BINS>,
        peak: BinIndex,
    ) -> DepthEstimate {
        // Relative counts are never full.
        let mut depth = self.depth::<Count10>(&rates.bins, Count::saturating(0));
        depth.flags |= self.clipped(gate, peak, depth.offset);
        depth
    }

    /// [`Flags::CLIPPED`] if the window about the place reaches past the gate.
    fn clipped<const BINS: usize>(
        &self,
        gate: &RangeGate<BINS>,
        peak: BinIndex,
        offset: SubBinOffset,
    ) -> Flags {
        let middle = (i32::from(peak.raw()) << 8) + i32::from(offset.raw());
        let start = middle - i32::from(self.before.to_bits());
        let end = middle + i32::from(self.after.to_bits());
        if start < i32::from(gate.first()) << 8 || end > i32::from(gate.last() + 1) << 8 {
            Flags::CLIPPED
        } else {
            Flags::NONE
        }
    }

    /// The place where the photons of `bins` balance.
    // Most looks end without an event.
    #[cold]
    #[inline(never)]
    fn depth<W: CounterWidth>(&self, bins: &Bins<W>, peak: Count) -> DepthEstimate {
        let excess = if W::BITS > 10 {
            22u32.saturating_sub(peak.raw().leading_zeros())
        } else {
            0
        };
        let mut flags = Flags::NONE;
        if peak.raw() >= W::MAX {
            flags |= Flags::SATURATED;
        }
        let here = self.weights.at_middle::<W>(bins, PEAK, excess);
        let is_after = here > 0;
        let edge = PEAK + usize::from(is_after);
        let there = self.weights.at_start::<W>(bins, edge, excess);
        let offset = if here == 0 {
            middle_of(PEAK)
        } else if has_crossed(here, there) {
            middle_of(PEAK) + between(here, there)
        } else {
            self.farther::<W>(bins, edge, there, excess)
        };
        let offset = match SubBinOffset::new(offset) {
            Some(offset) if offset > SubBinOffset::MIN && offset < SubBinOffset::MAX => offset,
            _ => {
                flags |= Flags::CLIPPED;
                if is_after {
                    SubBinOffset::MAX
                } else {
                    SubBinOffset::MIN
                }
            }
        };
        DepthEstimate { offset, flags }
    }

    /// The place where they balance if it lies beyond the start of `edge`, where the moment is
    /// `there`.
    #[inline(never)]
    fn farther<W: CounterWidth>(
        &self,
        bins: &Bins<W>,
        mut edge: usize,
        mut there: i32,
        excess: u32,
    ) -> i16 {
        let is_after = there > 0;
        while !ENDS.contains(&edge) {
            let bin = if is_after { edge } else { edge - 1 };
            let here = self.weights.at_middle::<W>(bins, bin, excess);
            if has_crossed(there, here) {
                return start_of(edge) + between(there, here);
            }
            edge = if is_after { edge + 1 } else { bin };
            there = self.weights.at_start::<W>(bins, edge, excess);
            if has_crossed(here, there) {
                return middle_of(bin) + between(here, there);
            }
        }
        start_of(edge)
    }
}

/// The bins about `peak` that a window can reach, if the gate has all of them.
#[inline(always)]
fn bins_within<'a, const BINS: usize, W: CounterWidth>(
    histogram: &'a Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    peak: BinIndex,
) -> Option<&'a Bins<W>> {
    let first = peak.raw().wrapping_sub(BEFORE);
    let last = first.wrapping_add(2 * BEFORE - 1);
    if !(gate.contains(first) && gate.contains(last)) {
        return None;
    }
    histogram.counts().get(usize::from(first)..)?.first_chunk()
}

/// Whether a moment is 0, or has another sign than the one before.
#[inline(always)]
const fn has_crossed(before: i32, moment: i32) -> bool {
    moment == 0 || (before ^ moment) < 0
}

/// The start of one of the [`Bins`], in 1/256 bin from the start of the peak bin.
#[inline(always)]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "up to 12 bins"
)]
const fn start_of(bin: usize) -> i16 {
    (bin as i16 - PEAK as i16) * 256
}

#[inline(always)]
const fn middle_of(bin: usize) -> i16 {
    start_of(bin) + 128
}

/// How far the straight line between two moments half a bin apart, `here` and `there`, goes
/// before it is 0, in 1/256 bin. The latter has the other sign or is 0.
#[inline(always)]
#[allow(clippy::cast_possible_truncation, reason = "at most 128")]
fn between(here: i32, there: i32) -> i16 {
    // Moments are below 2²⁵, so that 32 bits hold 128 of them.
    let (part, other) = (here.unsigned_abs(), there.unsigned_abs());
    let whole = part + other;
    let part = (128 * part + whole / 2).checked_div(whole).unwrap_or(0) as i16;
    if here > 0 { part } else { -part }
}

#[cfg(test)]
mod tests {
    use super::has_crossed;

    #[test]
    fn a_moment_crosses_where_it_is_0_or_changes_its_sign() {
        for before in [i32::MIN / 64, -7, -1, 1, 7, i32::MAX / 64] {
            for moment in [i32::MIN / 64, -7, -1, 0, 1, 7, i32::MAX / 64] {
                let is_other = before.signum() != moment.signum();
                assert_eq!(has_crossed(before, moment), is_other, "{before} {moment}");
            }
        }
    }
}
