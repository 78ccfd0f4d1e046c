//! The window rule, a calibrated test: all photons of the pulse against all the others.
//!
//! Let `B` gated bins hold `T` photons. Of all windows of `w` bins that contain the peak bin,
//! take the one with the most photons, `S`. The peak is a detection if
//!
//! ```text
//! S > Tp + z·V/√(V + z²/36) + z²/6·(1 - 2p)     p = w/B     V = Tp·(1 - p)
//! ```
//!
//! with the last term at least 0. This is a quantile of the binomial distribution of `T`
//! photons that fall into all bins with equal probability: its mean, `z` standard deviations
//! `√V`, and two corrections for the skew of small counts. They are those of Cornish and
//! Fisher, `z²/6` and `-z³/(72·√V)`; the second has a form that also fits below one photon,
//! where the series does not. The background need not be known. One `z` gives the same rate
//! of false alarms from fractions of a count a bin to hundreds, for every width and from 8
//! bins on. The α of the paper's rule has to follow the background. The histogram keeps its
//! total, so this takes no pass over the bins.
//!
//! With `n = B - w` bins outside, multiplied by `B` and squared, this is
//!
//! ```text
//! (B·S - w·T - z²/6·(n - w))² > z²·N²/(N + c)     N = n·w·T     c = z²/36·B²
//! ```
//!
//! if the term to be squared is positive. There is no root. The right side is at least
//! `z²·(N - c)`, so it is divided only if the left side exceeds that.
//!
//! ```
//! use dtof_core::fixed::types::U4F12;
//! use dtof_core::{Count, DepthEstimator, Histogram, RangeGate, WindowRule};
//! use dtof_core::rule::detect;
//!
//! let rule = WindowRule::new(2, const { U4F12::lit("4.3") }, Count::saturating(4))?;
//! let mut histogram = Histogram::<128>::new();
//! histogram.add_batch(&[7, 60, 60, 61]);
//! let (gate, estimator) = (RangeGate::full(), DepthEstimator::default());
//! assert_eq!(detect(&histogram, &gate, &rule, &estimator), None);
//! histogram.add_batch(&[61, 60]);
//! assert!(detect(&histogram, &gate, &rule, &estimator).is_some());
//! # Ok::<(), dtof_core::WindowWidthError>(())
//! ```

use core::ops::RangeInclusive;

use fixed::types::{U4F12, U8F8, U24F8};

use super::live::{LiveCounts, LiveDecision};
use super::rule::DetectionRule;
use super::tracking::Tracking;
use super::window_z::{block_z, tracking_z};
use crate::check::impl_error;
use crate::histogram::counter::CounterWidth;
use crate::histogram::excluded::ExcludedBins;
use crate::histogram::gate::RangeGate;
use crate::histogram::{Histogram, Peak, mean};
use crate::units::{BinIndex, BlockLevel, Count};

/// The sum of a window around the peak against the photons of all bins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct WindowRule {
    width: u8,
    z: U4F12,
    minimum_count: Count,
}

/// The window is not 1 to [`WindowRule::MAX_WIDTH`] bins wide.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct WindowWidthError;

impl WindowWidthError {
    /// The error in one line.
    #[must_use]
    pub const fn text(self) -> &'static str {
        "the window must be 1 to 7 bins wide"
    }
}

impl_error!(WindowWidthError);

impl WindowRule {
    /// The widest window: a gate always leaves a bin outside it.
    pub const MAX_WIDTH: u8 = 7;

    /// A window of `width` bins, `z` standard deviations above the background and
    /// at least `minimum_count` photons in the window.
    ///
    /// [`Self::width_for_pulse`] gives a width for a pulse.
    ///
    /// If the window takes half of the `B` gated bins or more, a detection needs more than
    /// `z²·(width/(B - width) - B²/(36·width·(B - width)))` photons even without background.
    /// That is many if few bins are left: with 7 of 8 and z 4 more than 107.
    ///
    /// # Errors
    /// Fails unless `width` is 1 to [`Self::MAX_WIDTH`].
    pub const fn new(width: u8, z: U4F12, minimum_count: Count) -> Result<Self, WindowWidthError> {
        if width == 0 || width > Self::MAX_WIDTH {
            return Err(WindowWidthError);
        }
        Ok(Self {
            width,
            z,
            minimum_count,
        })
    }

    /// The width for a pulse of the standard deviation `sigma` in bins: 2 bins up
    /// to 0.6, 3 up to 1.25, 5 above.
    #[must_use]
    pub const fn width_for_pulse(sigma: U8F8) -> u8 {
        let bits = sigma.to_bits();
        if bits <= const { U8F8::lit("0.6").to_bits() } {
            2
        } else if bits <= const { U8F8::lit("1.25").to_bits() } {
            3
        } else {
            5
        }
    }

    /// Bins in the window.
    #[must_use]
    pub const fn width(&self) -> u8 {
        self.width
    }

    /// How many standard deviations above the background.
    #[must_use]
    pub const fn z(&self) -> U4F12 {
        self.z
    }

    /// The fewest photons in the window of a detection.
    #[must_use]
    pub const fn minimum_count(&self) -> Count {
        self.minimum_count
    }

    /// The same rule with another z.
    pub(super) const fn with_z(self, z: U4F12) -> Self {
        Self { z, ..self }
    }

    /// The rules of a pixel that tracks. Together they have the false alarms of this rule. z
    /// is limited to the range of [`z_for`](crate::z_for). It is never higher than this
    /// rule's near the last event, and never lower elsewhere.
    #[must_use]
    pub fn tracking<const BINS: usize>(&self, gate: &RangeGate<BINS>) -> Tracking<Self> {
        let [near, far] = tracking_z(self.z, gate);
        Tracking::new(
            self.with_z(near),
            self.with_z(far),
            u16::from(self.width) - 1,
        )
    }

    /// The rule for blocks of pixels with this rule; its z is not lower. The blocks of all
    /// `levels` together have a third as many false alarms as pixels: see
    /// [`z_for_levels`](crate::rule::z_for_levels).
    #[must_use]
    pub fn of_blocks(&self, levels: BlockLevel) -> Self {
        self.with_z(block_z(self.z, levels))
    }

    /// The most photons in a gated window that contains the peak bin: at most 7 · 2²⁴.
    #[inline(always)]
    fn window_sum<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
    ) -> u32 {
        highest_sum(histogram, self.starts_about(gate, peak.bin), self.width)
    }

    /// Where the gated windows that contain a bin begin.
    #[inline(always)]
    pub(super) fn starts_about<const BINS: usize>(
        &self,
        gate: &RangeGate<BINS>,
        bin: BinIndex,
    ) -> RangeInclusive<u16> {
        let width = u16::from(self.width);
        let (bin, last) = (bin.raw(), gate.last());
        let first_start = (bin + 1).saturating_sub(width).max(gate.first());
        first_start..=bin.min((last + 1).saturating_sub(width))
    }
}

/// The most photons in a window of those that begin at `starts`.
#[inline(always)]
fn highest_sum<const BINS: usize, W: CounterWidth>(
    histogram: &Histogram<BINS, W>,
    starts: RangeInclusive<u16>,
    width: u8,
) -> u32 {
    let width = u16::from(width);
    // From the first bin of the first window to the last of the last.
    let bins = usize::from(*starts.start())..usize::from(*starts.end() + width);
    let bins = histogram.counts().get(bins).unwrap_or_default();
    let windows = bins.split_at_checked(width.into());
    let (first, entering) = windows.unwrap_or_default();
    let mut sum = first
        .iter()
        .fold(0, |sum: u32, &count| sum.wrapping_add(count.into()));
    let mut highest = sum;
    for (&leaving, &entering) in bins.iter().zip(entering) {
        sum = sum
            .wrapping_add(entering.into())
            .wrapping_sub(leaving.into());
        highest = highest.max(sum);
    }
    highest
}

/// Whether the `inside` photons of a window of `width` of `bins` bins stand `z` (in 1/4096)
/// standard deviations above what `total` photons in all bins have there on average. `NARROW` is for
/// counters of up to 10 bits, of one pixel or of nine together.
#[inline(always)]
pub(super) fn stands_clear<const NARROW: bool>(
    inside: u32,
    total: u32,
    width: u32,
    bins: u32,
    z: u16,
) -> bool {
    let bins_outside = bins - width;

    // In 1/16 counts.
    let z_squared = u32::from(z) * u32::from(z);
    let skew = bins_outside.saturating_sub(width) * ((z_squared / 6) >> 20);
    let (inside_times, total_times) = (bins << 4, width << 4);
    let above = if NARROW {
        // Of nine pixels: 14 + 16 bits, 7 + 24 bits and 20 bits, so `above` has 30.
        // Overwritten memory may have any total; the products then wrap.
        let level = total_times.wrapping_mul(total).wrapping_add(skew);
        let Some(above) = inside_times.wrapping_mul(inside).checked_sub(level) else {
            return false;
        };
        above
    } else {
        let level = u64::from(total_times) * u64::from(total) + u64::from(skew);
        let Some(above) = (u64::from(inside_times) * u64::from(inside)).checked_sub(level) else {
            return false;
        };
        // Its square is then above any variance.
        u32::try_from(above).unwrap_or(u32::MAX).min((1 << 30) - 1)
    };
    // At most 8 + 3 + 32 bits, or 10 + 3 + 30; in 1/16, and with z², 20 more.
    let spread = u64::from(bins_outside * width) * u64::from(total);
    let exceeds = |sixteenths: u64| {
        (u64::from(above) * u64::from(above)) << 4
            > sixteenths.wrapping_mul((z_squared >> 16).into())
    };
    // 20 + 12 bits, and after the division 23.
    let most = bins * bins * (z_squared >> 20) / (36 << 4);
    if above == 0 || !exceeds(spread.saturating_sub(most.into()) << 4) {
        return false;
    }
    // N/(N + c) of the upper 16 bits, in 1/2¹⁶.
    let sum = spread + u64::from(most);
    let shift = u64::BITS - (sum >> 16).leading_zeros();
    #[allow(clippy::cast_possible_truncation, reason = "16 bits")]
    let [sum, part] = [sum >> shift, spread >> shift].map(|value| value as u32);
    let Some(part) = (part << 16).checked_div(sum) else {
        return false;
    };
    // 43 + 17 bits.
    exceeds((spread * u64::from(part)) >> 12)
}

impl DetectionRule for WindowRule {
    #[inline(always)]
    fn detect<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
        excluded: &ExcludedBins,
    ) -> Option<U24F8> {
        let inside = self.window_sum(histogram, gate, peak);
        if inside < self.minimum_count.raw() {
            return None;
        }
        let (width, total) = (u32::from(self.width), histogram.total());
        let bins = excluded.bins_left(gate)?;
        let z = self.z.to_bits();
        let stands_clear = if W::BITS <= 10 {
            stands_clear::<true>(inside, total, width, bins, z)
        } else {
            stands_clear::<false>(inside, total, width, bins, z)
        };
        if !stands_clear {
            return None;
        }
        mean(total.wrapping_sub(inside), bins - width)
    }

    #[inline(always)]
    fn window_bins(&self) -> u16 {
        self.width.into()
    }

    #[inline(always)]
    fn fewest_photons(&self) -> u32 {
        self.minimum_count.raw().max(1)
    }

    #[inline(always)]
    fn weighs_dead_time(&self) -> bool {
        true
    }

    #[inline(always)]
    fn detect_live<const BINS: usize, W: CounterWidth>(
        &self,
        counts: &LiveCounts<'_, BINS, W>,
        expected: Option<BinIndex>,
    ) -> LiveDecision {
        counts.best_window(
            self.width.into(),
            self.z.to_bits(),
            self.minimum_count.raw(),
            expected,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::stands_clear;

    #[test]
    fn overwritten_counts_overflow_no_product() {
        let counts = || (0..u32::BITS).flat_map(|bit| [(1 << bit) - 1, 1 << bit, u32::MAX - bit]);
        for (inside, total) in
            counts().flat_map(|inside| counts().map(move |total| (inside, total)))
        {
            for (width, bins) in [(1, 8), (7, 8), (3, 256), (1, 1024), (7, 1024)] {
                for z in [0, 1, 4096, 20_000, u16::MAX] {
                    let narrow = stands_clear::<true>(inside, total, width, bins, z);
                    let wide = stands_clear::<false>(inside, total, width, bins, z);
                    // Those of nine pixels with counters of 10 bits.
                    let is_valid =
                        inside <= total.min(9 * 1023 * width) && total <= 9 * 1023 * bins;
                    assert!(!is_valid || narrow == wide, "{inside} of {total}");
                }
            }
        }
    }
}
