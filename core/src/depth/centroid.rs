//! The paper's depth: the centroid of three bins.
//!
//! The background is subtracted first. With `l`, `c`, `r` the counts of the peak bin's
//! left neighbour, itself and its right neighbour, minus the background and not
//! below 0, the pulse lies
//!
//! ```text
//! peak bin + 0.5 + (r - l) / (l + c + r)      in bins from the start of bin 0
//! ```
//!
//! so that photons spread evenly over bin i give i + 0.5. The result is a
//! fixed-point number with 8 fractional bits, rounded to the nearest 1/256 bin.
//!
//! ```
//! use dtof_core::fixed::types::U24F8;
//! use dtof_core::{Histogram, RangeGate};
//! use dtof_core::paper::centroid;
//!
//! let mut histogram = Histogram::<128>::new();
//! histogram.add_batch(&[40, 40, 40, 41]);
//! let depth = centroid(&histogram, &RangeGate::full(), histogram.peak(), U24F8::ZERO);
//! assert_eq!(depth.offset.raw(), 128 + 64); // 40.75 bins
//! ```
//!
//! Cost on a Cortex-M4: 68 instructions; on a Cortex-M0+, which has no division, 161. It
//! suits pulses of up to 0.5 bins (σ). The depth of wider ones is biased towards the middle
//! of the peak bin.
//!
//! Source: the paper's section III-A names the centre of mass around the peak (CMM). The
//! three bins and the subtracted background are our choice.

use fixed::types::U24F8;

use super::estimate::DepthEstimate;
use crate::flags::Flags;
use crate::histogram::counter::CounterWidth;
use crate::histogram::gate::RangeGate;
use crate::histogram::{Histogram, Peak};
use crate::units::SubBinOffset;

/// Three-bin centroid around `peak`, minus the `background` a bin.
///
/// Within 1/512 bin of the real-valued formula for 10- and 16-bit counters,
/// within 1/256 bin for 24-bit ones. It is the middle of the peak bin if no count
/// exceeds the background. A neighbour outside the gate counts as empty.
#[inline(always)]
#[must_use]
pub fn centroid<const BINS: usize, W: CounterWidth>(
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    peak: Peak,
    background: U24F8,
) -> DepthEstimate {
    let neighbour = |bin: u16| {
        if gate.contains(bin) {
            histogram.count(bin.into())
        } else {
            None
        }
    };
    let left = neighbour(peak.bin.raw().wrapping_sub(1));
    let right = neighbour(peak.bin.raw() + 1);

    let mut flags = Flags::NONE;
    if peak.count.raw() >= W::MAX {
        flags |= Flags::SATURATED;
    }
    if left.is_none() || right.is_none() {
        flags |= Flags::CLIPPED;
    }

    let above = |count: u32| (count << 8).saturating_sub(background.to_bits());
    let left = above(left.unwrap_or(0));
    let centre = above(peak.count.raw());
    let right = above(right.unwrap_or(0));
    // Only their ratio matters. Values of more than 22 bits, 14 of them whole counts, lose
    // their lowest bits, so that 256 times the numerator fits 32 bits.
    let excess = if W::BITS > 14 {
        10u32.saturating_sub((left | centre | right).leading_zeros())
    } else {
        0
    };
    let (left, centre, right) = (left >> excess, centre >> excess, right >> excess);
    DepthEstimate {
        offset: offset_of(left, centre, right),
        flags,
    }
}

/// The place of the pulse from counts above the background, all in the same unit.
#[inline(always)]
pub(crate) fn offset_of(left: u32, centre: u32, right: u32) -> SubBinOffset {
    let sum = left + centre + right;
    // At most 128 when `peak` is the highest bin.
    let shift = share(right.abs_diff(left), sum).min(256) as i16;
    let shift = if right < left { -shift } else { shift };
    SubBinOffset::new(SubBinOffset::CENTRE.raw() + shift).unwrap_or(SubBinOffset::CENTRE)
}

/// Whether the processor has a division instruction: all but the smallest do.
const HAS_DIVISION: bool = cfg!(any(
    all(target_arch = "arm", target_has_atomic = "32"),
    all(target_arch = "riscv32", target_feature = "m"),
));

/// `256 · part / whole`, to the nearest whole number, halves up; 0 of nothing. `part` is at most
/// `whole`, which is below 3 · 2²².
#[inline(always)]
fn share(part: u32, whole: u32) -> u32 {
    if HAS_DIVISION {
        share_by_division(part, whole)
    } else {
        share_bit_by_bit(part, whole)
    }
}

#[inline(always)]
fn share_by_division(part: u32, whole: u32) -> u32 {
    let share = ((part << 8) + whole / 2).checked_div(whole);
    share.unwrap_or(0)
}

/// The same in half the time of a division in software.
// Out of line: most looks end without an event.
#[inline(never)]
const fn share_bit_by_bit(part: u32, whole: u32) -> u32 {
    if whole == 0 {
        return 0;
    }
    let (mut share, mut rest) = (0, part);
    let mut bit = 0;
    while bit < 8 {
        rest <<= 1;
        share <<= 1;
        if rest >= whole {
            rest -= whole;
            share += 1;
        }
        bit += 1;
    }
    if 2 * rest >= whole { share + 1 } else { share }
}

#[cfg(test)]
mod tests {
    use super::{share_bit_by_bit, share_by_division};

    /// All small numbers and the largest ones.
    #[test]
    fn both_ways_share_alike() {
        let check = |part: u32, whole: u32| {
            let share = (u64::from(part) * 512 + u64::from(whole))
                .checked_div(u64::from(whole) * 2)
                .unwrap_or(0);
            assert_eq!(u64::from(share_by_division(part, whole)), share);
            assert_eq!(u64::from(share_bit_by_bit(part, whole)), share);
        };
        for whole in (0..1024).chain((3 << 22) - 1024..3 << 22) {
            let step = 1 + whole as usize / 1024;
            (0..=whole)
                .step_by(step)
                .for_each(|part| check(part, whole));
        }
    }
}
