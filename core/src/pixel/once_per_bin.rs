//! Photons of one laser cycle in one bin count once.
//!
//! A raindrop sends tens of photons back in one laser cycle, into two or three bins: enough for an event
//! by themselves. A target that stays comes again in the next laser cycles, a drop does not. With one photon a
//! bin and laser cycle, a drop counts as two or three photons.
//!
//! The counts are then binomial instead of Poisson distributed. They spread less, so that there are at
//! most as many false alarms. Of a bright target photons are lost: a bin with `x` photons a laser cycle counts
//! `1 - exp(-x)`. That is 2 % less at 0.04 and a fifth at half a photon, where the depth begins to suffer,
//! because the middle of the pulse loses more than its sides.
//!
//! The bins of a laser cycle stand outside the pixel, as four words for 128 bins, so that a pixel without
//! them takes no room for them. However the photons of a laser cycle are split over calls, the result is the
//! same.
//!
//! ```
//! use dtof_core::{AsyncPixel, LaserCycle, OncePerBin, PixelAddress, PixelConfig, Statistics, checked};
//!
//! const CONFIG: PixelConfig<128> = checked!(PixelConfig::paper().build());
//! let mut pixel = AsyncPixel::<128>::new(PixelAddress::new(0));
//! let mut bins = OncePerBin::<{ OncePerBin::words(128) }>::new();
//! let mut statistics = Statistics::default();
//!
//! pixel.count_once_per_bin(&CONFIG, &mut statistics, &mut bins, &[60, 61, 60]);
//! pixel.count_once_per_bin(&CONFIG, &mut statistics, &mut bins, &[60]); // still the same laser cycle
//! bins.end_laser_cycle();
//! pixel.end_laser_cycle(&CONFIG, &mut statistics, LaserCycle::new(0));
//! assert_eq!((pixel.histogram().total(), statistics.repeated), (2, 2));
//! ```
//!
//! Cost on a Cortex-M4: 29 instructions a photon in laser cycles of 16, with their ends.

use super::AsyncPixel;
use crate::config::PixelConfig;
use crate::detect::DetectionRule;
use crate::histogram::counter::CounterWidth;
use crate::statistics::Statistics;

/// The bins of one pixel that have had a photon in the present laser cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct OncePerBin<const WORDS: usize> {
    bins: [u32; WORDS],
}

impl OncePerBin<0> {
    /// The words for so many bins.
    #[must_use]
    pub const fn words(bins: usize) -> usize {
        bins.div_ceil(32)
    }
}

impl<const WORDS: usize> OncePerBin<WORDS> {
    /// At the beginning of a laser cycle.
    #[must_use]
    pub const fn new() -> Self {
        Self { bins: [0; WORDS] }
    }

    /// Whether a photon is the first of its bin in this laser cycle. One with a TDC code past the bins
    /// of all words always is: it is rejected later.
    #[inline]
    pub fn is_first(&mut self, code: u16) -> bool {
        let Some(word) = self.bins.get_mut(usize::from(code >> 5)) else {
            return true;
        };
        let bit = 1 << (code & 31);
        let is_first = *word & bit == 0;
        *word |= bit;
        is_first
    }

    /// Ends a laser cycle, with photons or without.
    #[inline]
    pub const fn end_laser_cycle(&mut self) {
        *self = Self::new();
    }
}

impl<const WORDS: usize> Default for OncePerBin<WORDS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const BINS: usize, W: CounterWidth> AsyncPixel<BINS, W> {
    /// Counts photons of the current laser cycle as [`Self::count_batch`] does, except those in a bin that
    /// has had one. Those are counted as repeated. `bins` are those of this pixel.
    pub fn count_once_per_bin<R: DetectionRule, const WORDS: usize>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        bins: &mut OncePerBin<WORDS>,
        codes: &[u16],
    ) {
        const { assert!(WORDS * 32 >= BINS, "one bit a bin") };
        let mut repeated = 0;
        let mut is_first = |code: u16| {
            // The last word of few bins has places that no bin has.
            let is_past = BINS < WORDS * 32 && usize::from(code) >= BINS;
            let is_first = is_past || bins.is_first(code);
            repeated += u32::from(!is_first);
            is_first
        };
        if self.weighs_dead_time(config) {
            let codes = codes.iter().copied().filter(|&code| is_first(code));
            codes.for_each(|code| self.count(config, code));
        } else {
            let gate = config.gate();
            let gated_out = self.histogram.add_gated_where(codes, gate, is_first);
            self.gated_out = self.gated_out.wrapping_add(gated_out);
            self.histogram.leave_out(repeated);
        }
        statistics.repeated += u64::from(repeated);
    }
}
