//! Sub-bin depth from a window that lies evenly about the pulse.
//!
//! A centroid of whole bins around the peak bin is drawn towards that bin. The window
//! then holds more of one flank of the pulse than of the other. Here the window is as
//! wide as the pulse. It moves, in 1/256 bin, until the centroid of the photons in it is
//! its own centre. A bin at its end counts with the part that is inside, at the middle of
//! that part.
//!
//! The window starts on the middle of the peak bin and moves three times, with
//! half width `h`, position `x` and `n` the photons of a bin,
//!
//! ```text
//! x ← x + Σ n·part·(middle of the part - x) / (Σ n·part - 2h·background)
//! ```
//!
//! An even background has its own centroid in the middle of the window. So the background
//! does not move the place where the window comes to rest, only how far each step goes.
//! For that a mean is needed. The paper's background is the highest bin of a quadrant:
//! too little is left to divide by, and the steps go too far. So
//! [`CentredWindow::background_outside`] takes the mean of the bins that are farther from
//! the peak bin than half the width.
//!
//! With `h` = 2σ + 1/2 bins for a pulse of standard deviation σ the error is within 1.2 of
//! the Cramér–Rao bound, on average within 1.1: `core/tests/depth/error.rs` prints
//! and holds the table.
//!
//! A pulse that falls more slowly than it rises, as many do, has a wider window after the
//! place than before it ([`CentredWindow::with_sides`]). Photons of the wider side count
//! less, by the square of how much wider it is. So both sides of an even background still
//! balance. Such a window moves five times. It comes to rest where the sum of the squares of
//! `distance / half width` has a minimum, if each photon outside counts as 1. That place in
//! the pulse depends on both half widths, and so does the offset of ranges.
//!
//! ```
//! use dtof_core::fixed::types::{U8F8, U24F8};
//! use dtof_core::{CentredWindow, Histogram, RangeGate};
//!
//! let mut histogram = Histogram::<128>::new();
//! histogram.add_batch(&[40, 40, 40, 41, 41, 41]); // evenly about 41.0
//! let window = CentredWindow::for_pulse(const { U8F8::lit("0.75") });
//! let gate = RangeGate::full();
//! let depth = window.estimate(&histogram, &gate, histogram.peak(), U24F8::ZERO);
//! assert_eq!(depth.offset.raw(), 256); // the peak is bin 40
//! ```
//!
//! Cost on a Cortex-M4: 680 to 770 instructions, once an event; with two half widths 1,040.

use fixed::types::{U8F8, U24F8};

use super::estimate::Depth;
use crate::flags::Flags;
use crate::histogram::counter::CounterWidth;
use crate::histogram::gate::RangeGate;
use crate::histogram::{Histogram, Peak, mean};
use crate::units::SubBinOffset;

/// A window that moves onto the pulse, and how far it reaches before and after its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CentredWindow {
    before: U8F8,
    after: U8F8,
}

/// Bins that a window can reach, from [`BEFORE`] the peak bin on: an offset of -2
/// to 2 bins, less or plus 4.
const REACH: u16 = 12;
/// How many of these lie before the peak bin.
const BEFORE: u16 = 6;
/// What an offset may be.
const OFFSETS: [i16; 2] = [SubBinOffset::MIN.raw(), SubBinOffset::MAX.raw()];
/// How often a window moves, and one whose half widths differ, which starts farther from where
/// it comes to rest.
const STEPS: u32 = 3;
const SKEW_STEPS: u32 = 5;

impl CentredWindow {
    /// The narrowest half width: 1 bin.
    pub const MIN: U8F8 = U8F8::lit("1");
    /// The widest half width: 4 bins.
    pub const MAX: U8F8 = U8F8::lit("4");
    /// The widest pulse that a window suits, as a standard deviation in bins.
    pub const WIDEST_PULSE: U8F8 = U8F8::lit("1.75");
    /// What the half width is above twice the pulse's standard deviation.
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
            Some(Self { before, after })
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
            None if half_width.to_bits() < Self::MIN.to_bits() => Self {
                before: Self::MIN,
                after: Self::MIN,
            },
            None => Self {
                before: Self::MAX,
                after: Self::MAX,
            },
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

    /// The first and the last of the bins about `bin` that are no farther from it than a half width, within the gate.
    #[inline(always)]
    pub(super) fn inside<const BINS: usize>(&self, gate: &RangeGate<BINS>, bin: u16) -> (u16, u16) {
        let (before, after) = (self.before.to_bits(), self.after.to_bits());
        let first = bin.saturating_sub(before.div_ceil(256)).max(gate.first());
        let last = bin.saturating_add(after.div_ceil(256)).min(gate.last());
        (first, last)
    }

    /// The mean of the gated bins farther from the peak bin than a half width, in 1/256
    /// rounded down; `None` if there are none, or the peak is not in the gate. Of these,
    /// `left_out` bins are empty and do not count.
    #[inline(never)]
    #[must_use]
    pub fn background_outside<const BINS: usize, W: CounterWidth>(
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

    /// The depth of the pulse around `peak`, less the `background` a bin.
    ///
    /// Each step is rounded to the nearest 1/256 bin and limited to a bin; the
    /// offset to what [`SubBinOffset`] holds. Of counts past 10 bits the lowest are
    /// dropped, as many as bring the peak within 10. A bin outside the gate counts
    /// as background; [`Flags::CLIPPED`] tells that the window reaches there, and
    /// [`Flags::SATURATED`] that the counter of the peak bin is full.
    #[inline(never)]
    #[must_use]
    pub fn estimate<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
        background: U24F8,
    ) -> Depth {
        let excess = if W::BITS > 10 {
            22u32.saturating_sub(peak.count.raw().leading_zeros())
        } else {
            0
        };
        let scaled = |count: u32| (count >> excess).min(1023).cast_signed();
        let background = (background.to_bits() >> excess).min(1023 << 8);

        let mut bins = [((background + 128) >> 8).cast_signed(); REACH as usize];
        let first = peak.bin.raw().wrapping_sub(BEFORE);
        let last = first.wrapping_add(REACH - 1);
        if gate.contains(first) && gate.contains(last) {
            let counts = histogram.counts().get(first.into()..=last.into());
            for (bin, &count) in bins.iter_mut().zip(counts.unwrap_or_default()) {
                *bin = scaled(count.into());
            }
        } else {
            for (number, bin) in (0..).zip(&mut bins) {
                let number = first.wrapping_add(number);
                if gate.contains(number) {
                    *bin = scaled(histogram.count(number.into()).unwrap_or(0));
                }
            }
        }

        let before = i32::from(self.before.to_bits());
        let after = i32::from(self.after.to_bits());
        let background = background.cast_signed();
        let offset = if before == after {
            even(&bins, before, background)
        } else {
            Skew::new(before, after).come_to_rest(&bins, background)
        };

        let mut flags = Flags::NONE;
        if peak.count.raw() >= W::MAX {
            flags |= Flags::SATURATED;
        }
        let middle = (i32::from(peak.bin.raw()) << 8) + i32::from(offset);
        let start = i32::from(gate.first()) << 8;
        let end = i32::from(gate.last() + 1) << 8;
        // The offset holds no more than two bins about the peak.
        let [least, most] = OFFSETS;
        let at_limit = offset <= least || offset >= most;
        if middle - before < start || middle + after > end || at_limit {
            flags |= Flags::CLIPPED;
        }
        Depth {
            offset: SubBinOffset::new(offset).unwrap_or(SubBinOffset::CENTRE),
            flags,
        }
    }
}

/// Moves a window as often as `steps`, each time by the step that `next` has for its place, from
/// the start of the first bin it can reach. All it reaches lies within these bins, as offsets lie
/// within two bins about the start of the peak bin.
#[inline(always)]
fn come_to_rest(steps: u32, next: impl Fn(i32) -> i16) -> i16 {
    let [least, most] = OFFSETS;
    let mut offset = SubBinOffset::CENTRE.raw();
    for _ in 0..steps {
        let step = next(i32::from(offset) + i32::from(BEFORE << 8));
        if step == 0 {
            break;
        }
        offset = (offset + step).clamp(least, most);
    }
    offset
}

/// Where a window of `half` the width comes to rest.
#[inline(never)]
fn even(bins: &[i32; REACH as usize], half: i32, background: i32) -> i16 {
    // So much of the photons in the window is background.
    let below = (half * background) >> 7;
    come_to_rest(STEPS, |middle| {
        Sums::of(bins, middle, middle - half, middle + half).step(below)
    })
}

/// A window whose half widths differ.
struct Skew {
    before: i32,
    after: i32,
    /// What a photon before the place counts, and one after it, in 1/65536.
    weights: [u32; 2],
}

/// The weight of a photon that counts as 1.
const WHOLE: u32 = 1 << 16;

impl Skew {
    /// The narrower side counts whole, the other by the square of the half widths' ratio.
    #[inline(always)]
    fn new(before: i32, after: i32) -> Self {
        // Below 1, so that its square is below 2³².
        let [narrow, wide] = [before.min(after), before.max(after)].map(i32::cast_unsigned);
        let ratio = (narrow << 16).checked_div(wide).unwrap_or(0);
        let weight = ratio.wrapping_mul(ratio) >> 16;
        Self {
            before,
            after,
            weights: if before < after {
                [WHOLE, weight]
            } else {
                [weight, WHOLE]
            },
        }
    }

    #[inline(never)]
    fn come_to_rest(&self, bins: &[i32; REACH as usize], background: i32) -> i16 {
        let [before, after] = self.weights;
        let width = weighted(self.before, before) + weighted(self.after, after);
        let below = (width * background) >> 8;
        come_to_rest(SKEW_STEPS, |middle| {
            let sides = [
                (middle - self.before, middle, before),
                (middle, middle + self.after, after),
            ];
            let mut all = Sums {
                photons: 0,
                moment: 0,
            };
            for (start, end, weight) in sides {
                let side = Sums::of(bins, middle, start, end);
                all.photons += weighted(side.photons, weight);
                all.moment += weighted(side.moment, weight);
            }
            all.step(below)
        })
    }
}

#[inline(always)]
#[allow(clippy::cast_possible_truncation, reason = "no more than it was")]
fn weighted(amount: i32, weight: u32) -> i32 {
    ((i64::from(amount) * i64::from(weight)) >> 16) as i32
}

/// The photons of a part of the histogram.
struct Sums {
    /// How many they are, in 1/256.
    photons: i32,
    /// The sum of their distances from a place, in 1/512 bin times that.
    moment: i32,
}

impl Sums {
    /// From `start` to `end`, with the distances from `middle`, all from the start of the first
    /// of `bins` in 1/256 bin, and within them.
    #[inline(always)]
    fn of(bins: &[i32; REACH as usize], middle: i32, start: i32, end: i32) -> Self {
        let first = (start >> 8).cast_unsigned() as usize;
        let last = (end >> 8).cast_unsigned() as usize;
        let part = |bin: usize, part: i32, twice_middle: i32| {
            let photons = bins.get(bin).copied().unwrap_or(0) * part;
            (photons, photons * (twice_middle - 2 * middle))
        };
        let left = part(first, 256 - (start & 255), start + (start | 255) + 1);
        let right = part(last, end & 255, end + (end & !255));

        // In 1/512 bin.
        let mut distance = ((start | 255) + 1 - middle) * 2 + 256;
        let (mut photons, mut moment) = (0, 0);
        for &count in bins.get(first + 1..last).unwrap_or_default() {
            photons += count;
            moment += count * distance;
            distance += 512;
        }
        // Photons in 1/256: at most 8 bins of 10 bits. Their moment is at most 10 bits
        // times 8 + 12 on one side, and on the other less.
        Self {
            photons: (photons << 8) + left.0 + right.0,
            moment: (moment << 8) + left.1 + right.1,
        }
    }

    /// How far the centroid lies from the place, in 1/256 bin; `below` of the photons, in
    /// 1/256, are background.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "at most 256")]
    fn step(&self, below: i32) -> i16 {
        let signal = (self.photons - below)
            .max(self.photons >> 2)
            .cast_unsigned();
        let rounded = (self.moment.unsigned_abs() + signal).checked_div(2 * signal);
        let step = rounded.unwrap_or(0).min(256) as i16;
        if self.moment < 0 { -step } else { step }
    }
}
