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
//! Cost on a Cortex-M4: 650 to 765 instructions, once an event.

use fixed::types::{U8F8, U24F8};

use super::estimate::Depth;
use crate::flags::Flags;
use crate::histogram::counter::CounterWidth;
use crate::histogram::gate::RangeGate;
use crate::histogram::{Histogram, Peak, mean};
use crate::units::SubBinOffset;

/// A window that moves onto the pulse, and how wide it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CentredWindow {
    half_width: U8F8,
}

/// Bins that a window can reach, from [`BEFORE`] the peak bin on: an offset of -2
/// to 2 bins, less or plus 4.
const REACH: u16 = 12;
/// How many of these lie before the peak bin.
const BEFORE: u16 = 6;
/// How often the window moves.
const STEPS: u32 = 3;

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
        let bits = half_width.to_bits();
        if bits < Self::MIN.to_bits() || bits > Self::MAX.to_bits() {
            return None;
        }
        Some(Self { half_width })
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
                half_width: Self::MIN,
            },
            None => Self {
                half_width: Self::MAX,
            },
        }
    }

    /// Half the width, in bins.
    #[must_use]
    pub const fn half_width(&self) -> U8F8 {
        self.half_width
    }

    /// The mean of the gated bins farther from the peak bin than half the width, in 1/256
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
        let (bin, reach) = (peak.bin.raw(), self.half_width.to_bits().div_ceil(256));
        if !gate.contains(bin) {
            return None;
        }
        let first = bin.saturating_sub(reach).max(gate.first());
        let last = bin.saturating_add(reach).min(gate.last());
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

        let half = i32::from(self.half_width.to_bits());
        let below = (half * background.cast_signed()) >> 7;
        let [least, most] = [SubBinOffset::MIN, SubBinOffset::MAX].map(SubBinOffset::raw);
        let mut offset = SubBinOffset::CENTRE.raw();
        for _ in 0..STEPS {
            let step = step(&bins, offset.into(), half, below);
            if step == 0 {
                break;
            }
            offset = (offset + step).clamp(least, most);
        }

        let mut flags = Flags::NONE;
        if peak.count.raw() >= W::MAX {
            flags |= Flags::SATURATED;
        }
        let middle = (i32::from(peak.bin.raw()) << 8) + i32::from(offset);
        let [start, end] = [gate.first(), gate.last() + 1].map(|bin| i32::from(bin) << 8);
        // The offset holds no more than two bins about the peak.
        let at_limit = offset <= least || offset >= most;
        if middle - half < start || middle + half > end || at_limit {
            flags |= Flags::CLIPPED;
        }
        Depth {
            offset: SubBinOffset::new(offset).unwrap_or(SubBinOffset::CENTRE),
            flags,
        }
    }
}

/// How far the centroid lies from the middle of a window of `half` the width
/// about `offset`, in 1/256 bin; `below` of its photons, in 1/256, are background.
#[inline(always)]
#[allow(clippy::cast_possible_truncation, reason = "at most 256")]
fn step(bins: &[i32; REACH as usize], offset: i32, half: i32, below: i32) -> i16 {
    // From the start of the first of `bins`: within them, as offsets lie within two
    // bins about the start of the peak bin.
    let middle = offset + i32::from(BEFORE << 8);
    let (start, end) = (middle - half, middle + half);
    let [first, last] = [start, end].map(|end| (end >> 8).cast_unsigned() as usize);
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
    let photons = (photons << 8) + left.0 + right.0;
    let moment = (moment << 8) + left.1 + right.1;
    let signal = (photons - below).max(photons >> 2).cast_unsigned();
    let rounded = (moment.unsigned_abs() + signal).checked_div(2 * signal);
    let step = rounded.unwrap_or(0).min(256) as i16;
    if moment < 0 { -step } else { step }
}
