//! The histogram of one macropixel.
//!
//! Counters saturate and never wrap. What a full counter cannot take is counted as
//! *saturated*, a TDC code beyond the last bin as *rejected*. Every photon is accounted for:
//!
//! ```text
//! photons offered = total + saturated + rejected
//! ```
//!
//! Photons outside the range gate never enter the histogram. The pixels of a TDC with a
//! [dead time](crate::PixelConfigBuilder::dead_time) keep those before the gate in their
//! counters, but not in the total and the peak.
//!
//! The highest bin is tracked while counting. Counts only grow, so the key
//! `(count << log2(BINS)) - bin` of the highest bin is the maximum of the keys of all
//! photons. The lowest index wins a tie. Reading the peak needs no search.
//!
//! ```
//! use dtof_core::Histogram;
//!
//! let mut histogram = Histogram::<128>::new();
//! histogram.add_batch(&[40, 41, 40, 7, 300]);
//! assert_eq!(histogram.peak().bin.raw(), 40);
//! assert_eq!(histogram.peak().count.raw(), 2);
//! assert_eq!((histogram.total(), histogram.rejected()), (4, 1));
//! ```
//!
//! Cost on a Cortex-M4: 10 instructions a photon in a batch, 39 to clear 128 bins, 1066
//! to take 128 bins that were counted elsewhere.
//!
//! Source: the saturating 10-bit counters of the paper's FPGA (section IV-B). Its
//! search for the highest bin is [`ComparatorTree`](crate::paper::ComparatorTree).

pub mod counter;
pub mod excluded;
pub mod gate;

use core::ops::{Range, RangeInclusive};
use core::sync::atomic::{Ordering, compiler_fence};

use fixed::types::U24F8;

use self::counter::{Count10, CounterWidth, PhotonCount};
use self::gate::RangeGate;
use crate::units::{BinIndex, Count};

/// A bin and its count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Peak {
    /// The bin.
    pub bin: BinIndex,
    /// Its photons.
    pub count: Count,
}

/// Photon counts of one macropixel over `BINS` bins, a power of two from 8 to
/// 1024 (checked when compiled).
///
/// 1 byte a bin for [`Count8`](crate::Count8), 2 for [`Count10`] and [`Count16`](crate::Count16), 4 for
/// [`Count20`](crate::Count20) and [`Count24`](crate::Count24), and 16 bytes more.
#[derive(Clone, Debug)]
pub struct Histogram<const BINS: usize, W: CounterWidth = Count10> {
    counts: [W::Counter; BINS],
    peak_key: u32,
    total: u32,
    rejected: u32,
    saturated: u32,
}

impl<const BINS: usize, W: CounterWidth> Histogram<BINS, W> {
    const LOG2_BINS: u32 = {
        assert!(BINS.is_power_of_two(), "BINS must be a power of two");
        assert!(BINS >= 8 && BINS <= 1024, "BINS must be from 8 to 1024");
        assert!(
            BINS.ilog2() + W::BITS <= 32,
            "a peak key must fit 32 bits: fewer bins or narrower counters"
        );
        BINS.ilog2()
    };

    /// Whether the key of a count that is too high may exceed 32 bits.
    const KEY_MAY_OVERFLOW: bool = Self::LOG2_BINS + W::BITS == 32;

    /// An empty histogram.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(Self::LOG2_BINS >= 3) };
        Self {
            counts: [W::ZERO; BINS],
            peak_key: 0,
            total: 0,
            rejected: 0,
            saturated: 0,
        }
    }

    /// Counts one photon with the TDC code `code`.
    ///
    /// A code of `BINS` or more is rejected and counted, never wrapped; a full
    /// counter stays full and the photon is counted as saturated.
    #[inline]
    pub fn add(&mut self, code: u16) {
        self.add_gated(code, &RangeGate::full());
    }

    /// Counts one photon for each TDC code, as [`Self::add`] does.
    #[inline]
    pub fn add_batch(&mut self, codes: &[u16]) {
        self.add_gated_batch(codes, &RangeGate::full());
    }

    /// Counts one photon, as [`Self::add`] does, if its bin is gated. Returns the
    /// photons outside the gate, 0 or 1.
    #[inline]
    pub(crate) fn add_gated(&mut self, code: u16, gate: &RangeGate<BINS>) -> u32 {
        let Some(counter) = self.counts.get_mut(usize::from(code)) else {
            self.rejected = self.rejected.saturating_add(1);
            return 0;
        };
        if !gate.contains(code) {
            return 1;
        }
        let mut saturated = 0;
        Self::count_photon(counter, code, &mut self.peak_key, &mut saturated);
        if saturated > 0 {
            self.saturated = self.saturated.saturating_add(1);
        } else {
            self.total = self.total.wrapping_add(1);
        }
        0
    }

    /// Counts one photon for each TDC code whose bin is gated. Returns the photons
    /// outside the gate.
    #[inline]
    pub(crate) fn add_gated_batch(&mut self, codes: &[u16], gate: &RangeGate<BINS>) -> u32 {
        // Bins from 0 on save an instruction a photon.
        if gate.is_full() {
            self.add_gated_where(codes, &RangeGate::full(), |_| true)
        } else {
            self.add_gated_where(codes, gate, |_| true)
        }
    }

    /// The same of the photons for which `counts` is true. The total has the others as well.
    #[inline(always)]
    pub(crate) fn add_gated_where(
        &mut self,
        codes: &[u16],
        gate: &RangeGate<BINS>,
        mut counts: impl FnMut(u16) -> bool,
    ) -> u32 {
        // Local, so that they stay in registers.
        let (mut peak_key, mut saturated, mut rejected, mut gated_out) = (self.peak_key, 0, 0, 0);
        let counters = self.counts.get_mut(gate.bins()).unwrap_or_default();
        let first = usize::from(gate.first());
        let mut count = |&code: &u16| {
            if !counts(code) {
                return;
            }
            // One comparison: bins before the first wrap to the far end.
            match counters.get_mut(usize::from(code).wrapping_sub(first)) {
                Some(counter) => {
                    Self::count_photon(counter, code, &mut peak_key, &mut saturated);
                }
                None if usize::from(code) < BINS => gated_out += 1,
                None => rejected += 1,
            }
        };
        // Eight an iteration, for little loop overhead.
        let (eights, rest) = codes.as_chunks::<8>();
        for [a, b, c, d, e, f, g, h] in eights {
            count(a);
            count(b);
            count(c);
            count(d);
            count(e);
            count(f);
            count(g);
            count(h);
        }
        rest.iter().for_each(count);

        self.peak_key = peak_key;
        let lost = saturated + rejected + gated_out;
        #[allow(clippy::cast_possible_truncation)] // fewer than 2³² photons
        let counted = (codes.len() as u32).wrapping_sub(lost);
        self.total = self.total.wrapping_add(counted);
        if lost > 0 {
            self.saturated = self.saturated.saturating_add(saturated);
            self.rejected = self.rejected.saturating_add(rejected);
        }
        gated_out
    }

    /// Counts one photon in the counter of its bin, unless that is full.
    #[inline(always)]
    fn count_photon(counter: &mut W::Counter, code: u16, peak_key: &mut u32, saturated: &mut u32) {
        let mut count = (*counter).into() + 1;
        let key = Self::key(count, code.into());
        // No bin is higher than the peak, so only a new peak can be too high for its
        // counter.
        if key > *peak_key || Self::KEY_MAY_OVERFLOW {
            if count > W::MAX {
                count = W::MAX;
                *saturated += 1;
            } else {
                *peak_key = key.max(*peak_key);
            }
        }
        *counter = W::counter(count);
    }

    /// Adds the gated bins of a histogram that was counted elsewhere, such as the
    /// 5-laser-cycle mini-frames of the paper's sensor (section III-A).
    ///
    /// Counters saturate bin by bin. Returns the photons outside the gate; saturates at
    /// `u32::MAX`.
    pub fn add_frame<C: PhotonCount>(&mut self, frame: &[C; BINS], gate: &RangeGate<BINS>) -> u32 {
        if gate.is_full() && self.peak_key == 0 {
            let (highest, total) = C::highest_and_sum(frame);
            if highest <= W::MAX {
                self.copy(frame, highest, total);
                return 0;
            }
        }
        let gated = gate.bins();
        self.add_to_each(frame.get(gated.clone()).unwrap_or_default(), gate);
        let outside = |bins: Option<&[C]>| {
            let photons = bins.unwrap_or_default().iter();
            photons.fold(0u32, |sum, &photons| sum.saturating_add(photons.into()))
        };
        outside(frame.get(..gated.start)).saturating_add(outside(frame.get(gated.end..)))
    }

    /// Does what [`Self::add_to_each`] does to an empty histogram, in half the time.
    /// `highest` is the highest count, which fits the counters, and `total` their sum.
    #[inline(always)]
    fn copy<C: PhotonCount>(&mut self, frame: &[C; BINS], highest: u32, total: u32) {
        let (counters, _) = self.counts.as_chunks_mut::<8>();
        let (photons, _) = frame.as_chunks::<8>();
        let one = |photons: C| W::counter(photons.into());
        for (counters, &[a, b, c, d, e, f, g, h]) in counters.iter_mut().zip(photons) {
            *counters = [
                one(a),
                one(b),
                one(c),
                one(d),
                one(e),
                one(f),
                one(g),
                one(h),
            ];
            // Otherwise this is a call of `memcpy`, which takes twice as long.
            compiler_fence(Ordering::Release);
        }
        self.total = total;
        self.peak_key = Self::key_of(frame, highest);
    }

    /// The key of the first of the bins with the highest count.
    #[inline(always)]
    fn key_of<C: PhotonCount>(counts: &[C; BINS], highest: u32) -> u32 {
        let bin = C::first_reaching(counts, highest).unwrap_or_default();
        #[allow(clippy::cast_possible_truncation)] // less than 1024
        Self::key(highest, bin as u32)
    }

    /// Adds the photons of the gated bins.
    #[inline(never)]
    fn add_to_each<C: PhotonCount>(&mut self, photons: &[C], gate: &RangeGate<BINS>) {
        let counters = self.counts.get_mut(gate.bins()).unwrap_or_default();
        let (mut total, mut saturated, mut peak_key) = (0u32, 0u32, self.peak_key);
        let bins = u32::from(gate.first())..;
        for (bin, (counter, &photons)) in bins.zip(counters.iter_mut().zip(photons)) {
            let photons: u32 = photons.into();
            if photons > 0 {
                let before: u32 = (*counter).into();
                let mut count = before.saturating_add(photons);
                total = total.wrapping_add(photons);
                if count > W::MAX {
                    let lost = photons - W::MAX.saturating_sub(before);
                    count = W::MAX;
                    total = total.wrapping_sub(lost);
                    saturated = saturated.saturating_add(lost);
                }
                *counter = W::counter(count);
                peak_key = peak_key.max(Self::key(count, bin));
            }
        }
        self.total = self.total.wrapping_add(total);
        self.saturated = self.saturated.saturating_add(saturated);
        self.peak_key = peak_key;
    }

    /// The highest bin; the lowest index wins a tie. Bin 0 with a count of 0
    /// while the histogram is empty.
    #[inline]
    #[must_use]
    pub fn peak(&self) -> Peak {
        // The inverse of `key`: the count rounds up, the bin is the difference. The masks
        // change nothing, but save a comparison.
        let last_bin = (1 << Self::LOG2_BINS) - 1;
        let count = (self.peak_key.wrapping_add(last_bin) >> Self::LOG2_BINS) & W::MAX;
        let bin = self.peak_key.wrapping_neg() & last_bin;
        Peak {
            bin: BinIndex::saturating((bin & 0x3ff) as u16),
            count: Count::saturating(count),
        }
    }

    /// The counters, bin 0 first.
    #[inline]
    #[must_use]
    pub const fn counts(&self) -> &[W::Counter; BINS] {
        &self.counts
    }

    /// The count of one bin, or `None` past the last.
    #[inline]
    #[must_use]
    pub fn count(&self, bin: usize) -> Option<u32> {
        self.counts.get(bin).map(|&count| count.into())
    }

    /// Photons counted since the last [`Self::clear`]: the sum of all bins.
    #[inline]
    #[must_use]
    pub const fn total(&self) -> u32 {
        self.total
    }

    /// Photons with a TDC code past the last bin, since the last
    /// [`Self::clear`]. Saturates at `u32::MAX`.
    #[inline]
    #[must_use]
    pub const fn rejected(&self) -> u32 {
        self.rejected
    }

    /// Photons that met a full counter, since the last [`Self::clear`]. Saturates
    /// at `u32::MAX`.
    #[inline]
    #[must_use]
    pub const fn saturated(&self) -> u32 {
        self.saturated
    }

    /// Counts the photons of a whole histogram in place of what was counted before: those in the `gate`, and with
    /// `keeps_before` those before it in their counters alone. Each is divided by 2 to the power of `shift`, and then fits.
    #[inline(never)]
    pub(crate) fn fill<C: PhotonCount>(
        &mut self,
        frame: &[C; BINS],
        shift: u32,
        gate: &RangeGate<BINS>,
        keeps_before: bool,
    ) {
        let kept = if keeps_before { 0 } else { gate.first() }..=gate.last();
        let (mut total, mut peak_key) = (0u32, 0);
        for (bin, (counter, &photons)) in (0..).zip(self.counts.iter_mut().zip(frame)) {
            let photons = photons.into() >> shift;
            *counter = W::ZERO;
            if photons > 0 && kept.contains(&bin) {
                *counter = W::counter(photons.min(W::MAX));
                if bin >= gate.first() {
                    total = total.wrapping_add(photons);
                    peak_key = Self::key(photons, bin.into()).max(peak_key);
                }
            }
        }
        (self.peak_key, self.total) = (peak_key, total);
        (self.rejected, self.saturated) = (0, 0);
    }

    /// Counts the photons of `codes` before bin `first`, which the gate leaves out, in their
    /// counters alone: not in the total, and not as a peak. They blind a TDC with a dead time all
    /// the same. A full counter stays full.
    #[inline(never)]
    pub(crate) fn keep_before(&mut self, first: u16, codes: &[u16]) {
        for &code in codes.iter().filter(|&&code| code < first) {
            if let Some(counter) = self.counts.get_mut(usize::from(code)) {
                *counter = W::counter(((*counter).into() + 1).min(W::MAX));
            }
        }
    }

    /// The same with a histogram that was counted elsewhere.
    #[inline(never)]
    pub(crate) fn keep_frame_before<C: PhotonCount>(&mut self, first: u16, frame: &[C; BINS]) {
        let bins = self.counts.iter_mut().zip(frame).take(first.into());
        for (counter, &photons) in bins {
            let count = (*counter).into().saturating_add(photons.into());
            *counter = W::counter(count.min(W::MAX));
        }
    }

    /// Adds some bins of another histogram, and its total. Counters saturate. The peak is not kept.
    #[inline(never)]
    pub(crate) fn add_bins<V: CounterWidth>(
        &mut self,
        other: &Histogram<BINS, V>,
        bins: Range<u16>,
    ) {
        let bins = usize::from(bins.start)..usize::from(bins.end);
        let (counters, photons) = (self.counts.get_mut(bins.clone()), other.counts.get(bins));
        for (counter, &photons) in counters
            .unwrap_or_default()
            .iter_mut()
            .zip(photons.unwrap_or_default())
        {
            let count = (*counter).into().saturating_add(photons.into());
            *counter = W::counter(count.min(W::MAX));
        }
        self.total = self.total.saturating_add(other.total);
    }

    /// Leaves photons out of the total.
    pub(crate) const fn leave_out(&mut self, photons: u32) {
        self.total = self.total.wrapping_sub(photons);
    }

    /// Empties the bins of some ranges. Returns the photons they held, which are no longer in
    /// [`Self::total`]. The peak is the highest of the other bins.
    pub(crate) fn empty(&mut self, ranges: impl Iterator<Item = RangeInclusive<u16>>) -> u32 {
        let mut emptied = 0u32;
        for range in ranges {
            let (first, last) = (usize::from(*range.start()), usize::from(*range.end()));
            for counter in self.counts.iter_mut().take(last + 1).skip(first) {
                emptied = emptied.wrapping_add((*counter).into());
                *counter = W::ZERO;
            }
        }
        self.total = self.total.wrapping_sub(emptied);
        // A peak that is still there is still the highest.
        if self.count(self.peak().bin.raw().into()) == Some(0) {
            let highest = W::Counter::highest(&self.counts);
            self.peak_key = Self::key_of(&self.counts, highest);
        }
        emptied
    }

    /// Empties the histogram for the next exposure.
    #[inline]
    pub fn clear(&mut self) {
        // Not `fill`: it calls `memset`, which takes twice as long. The fence, which is not
        // an instruction, keeps the compiler from calling it, too.
        let (blocks, rest) = self.counts.as_chunks_mut::<8>();
        for block in blocks {
            *block = [W::ZERO; 8];
            compiler_fence(Ordering::Release);
        }
        rest.fill(W::ZERO);
        self.peak_key = 0;
        self.total = 0;
        self.rejected = 0;
        self.saturated = 0;
    }

    /// Orders bins by count, the lower bin first among equals. `count` is at
    /// least 1 and `bin` less than `BINS`, so nothing goes below zero.
    #[inline]
    const fn key(count: u32, bin: u32) -> u32 {
        (count << Self::LOG2_BINS).wrapping_sub(bin)
    }
}

impl<const BINS: usize, W: CounterWidth> Default for Histogram<BINS, W> {
    fn default() -> Self {
        Self::new()
    }
}

/// The mean of `photons` in so many `bins`, in 1/256 rounded down; `None` if there are no bins.
// Out of line: only detections need it.
#[inline(never)]
pub(crate) fn mean(photons: u32, bins: u32) -> Option<U24F8> {
    let whole = photons.checked_div(bins)?;
    // At most 2¹⁰ bins, so that the rest fits.
    let rest = (photons.wrapping_sub(whole.wrapping_mul(bins)) << 8).checked_div(bins)?;
    Some(U24F8::from_bits((whole << 8) + rest))
}
