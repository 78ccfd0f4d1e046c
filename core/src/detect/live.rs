//! Counts of a TDC with a dead time, and how often each bin was live.
//!
//! After a photon such a TDC is blind for some bins, or to the end of the laser cycle. Early
//! photons hide later ones, so that a flat background is counted as a slope. The counts
//! themselves say how often each bin was live: with N laser cycles and a dead time of D bins
//!
//! ```text
//! live(b) = N - Σ counts of the D bins before b
//! ```
//!
//! which is exact, whatever the light. Under a flat background each photon lies in a window
//! with the probability `p = Σ live(window) / Σ live(all gated bins)`. So the window rule
//! compares a window's photons with `T·p` instead of `T·w/B`:
//!
//! ```text
//! (S - E - z²/6·(1 - 2p))² > z²·V²/(V + z²/36)     E = T·p     V = E·(1 - p)
//! ```
//!
//! All gated windows are looked at, because the highest bin is often the front of the slope.
//! The window with the largest `(S - E)²/E` is tested.
//!
//! A window that was live in fewer than one of [`LiveCounts::LEAST_SHARE`] laser cycles is
//! left out. Bins around an echo that was reported are left out, too, but their photons go on
//! blinding the bins behind them, as those before the gate do.
//!
//! Source: the estimator of P. B. Coates, "The correction for photon 'pile-up' in the
//! measurement of radiative lifetimes", J. Phys. E 1 (1968) 878, for the first photon of a
//! laser cycle; the sum of D bins for shorter dead times and the test are ours.

use core::ops::{Range, RangeInclusive};

use crate::depth::Counted;
use crate::histogram::Histogram;
use crate::histogram::counter::CounterWidth;
use crate::histogram::excluded::ExcludedBins;
use crate::histogram::gate::RangeGate;
use crate::units::BinIndex;

/// The counts of one exposure with what is needed to weigh them.
#[derive(Clone, Copy, Debug)]
pub struct LiveCounts<'a, const BINS: usize, W: CounterWidth> {
    histogram: &'a Histogram<BINS, W>,
    gate: &'a RangeGate<BINS>,
    excluded: &'a ExcludedBins,
    cycles: u32,
    dead_time: u16,
}

/// What a rule decides from live counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LiveDecision {
    /// The detection.
    pub window: Option<LiveWindow>,
    /// Whether windows were left out, because they were hardly ever live; or all of them, because
    /// the counts contradict the dead time.
    pub is_blind: bool,
}

/// A window that stands clear of the background, and what lies outside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LiveWindow {
    /// Its first bin.
    pub first: u16,
    /// Its bins.
    pub width: u16,
    /// Photons of the gated bins outside it.
    pub photons_outside: u32,
    /// The live laser cycles of these bins, added up.
    pub live_outside: u64,
}

/// The photons of all bins that are not left out, and their live laser cycles, added up.
#[derive(Clone, Copy)]
struct Totals {
    photons: u32,
    live: u64,
}

/// A window and its excess over the background, in 1/256 photon.
#[derive(Clone, Copy)]
struct Candidate {
    first: usize,
    photons: u32,
    live: u32,
    expected: u64,
    excess: u64,
}

impl LiveDecision {
    /// No detection, and nothing left out.
    pub const NONE: Self = Self {
        window: None,
        is_blind: false,
    };
    /// No detection, because the counts contradict the dead time.
    pub const BLIND: Self = Self {
        window: None,
        is_blind: true,
    };
}

impl<'a, const BINS: usize, W: CounterWidth> LiveCounts<'a, BINS, W> {
    /// A window is left out that was live in fewer than one of so many laser cycles.
    pub const LEAST_SHARE: u32 = 1024;
    /// The most laser cycles of an exposure.
    pub const MAX_CYCLES: u32 = 1 << 28;

    /// The counts of `cycles` laser cycles of a TDC that is blind for `dead_time` bins after each
    /// photon. `histogram` has the photons before the gate as well, and those of the `excluded`
    /// bins.
    ///
    /// `None` if a counter is full, so that it is unknown how often the bins behind it were
    /// live; and above [`Self::MAX_CYCLES`].
    #[inline(always)]
    #[must_use]
    pub fn new(
        histogram: &'a Histogram<BINS, W>,
        gate: &'a RangeGate<BINS>,
        excluded: &'a ExcludedBins,
        cycles: u32,
        dead_time: u16,
    ) -> Option<Self> {
        let before = histogram.counts().get(..gate.first().into())?;
        let is_full = |&count: &W::Counter| count.into() >= W::MAX;
        if histogram.saturated() > 0 || cycles > Self::MAX_CYCLES || before.iter().any(is_full) {
            return None;
        }
        Some(Self {
            histogram,
            gate,
            excluded,
            cycles,
            dead_time,
        })
    }

    /// The histogram.
    #[must_use]
    pub const fn histogram(&self) -> &'a Histogram<BINS, W> {
        self.histogram
    }

    /// The gate.
    #[must_use]
    pub const fn gate(&self) -> &'a RangeGate<BINS> {
        self.gate
    }

    /// The bins around echoes that were reported.
    #[must_use]
    pub const fn excluded(&self) -> &'a ExcludedBins {
        self.excluded
    }

    /// Laser cycles in which `bin` was live; 0 if the counts contradict the dead time.
    #[must_use]
    pub fn live(&self, bin: u16) -> u32 {
        self.cycles.saturating_sub(self.blind(bin.into()))
    }

    /// The photons of a bin, and the laser cycles in which it was live.
    pub(crate) fn counted(&self, bin: u16) -> Counted {
        Counted {
            photons: self.count(bin.into()).into(),
            live: self.live(bin).into(),
        }
    }

    /// Whether a bin, or a window on average, was live in too few laser cycles.
    #[must_use]
    pub fn is_left_out(&self, live: u64, bins: u16) -> bool {
        live * u64::from(Self::LEAST_SHARE) < u64::from(self.cycles) * u64::from(bins)
    }

    /// The window of `width` bins with the largest excess, if it stands `z` (in 1/4096) standard
    /// deviations above the background and has `minimum` photons; of the windows that contain
    /// `expected`, if that is given.
    #[inline(never)]
    pub(super) fn best_window(
        &self,
        width: u16,
        z: u16,
        minimum: u32,
        expected: Option<BinIndex>,
    ) -> LiveDecision {
        // A TDC of the first photon has no sum of bins that ends: two thirds of the time.
        if usize::from(self.dead_time) >= BINS {
            self.best::<true>(width, z, minimum, expected)
        } else {
            self.best::<false>(width, z, minimum, expected)
        }
    }

    #[inline(always)]
    fn best<const FIRST_ONLY: bool>(
        &self,
        width: u16,
        z: u16,
        minimum: u32,
        expected: Option<BinIndex>,
    ) -> LiveDecision {
        let Some(totals) = self.totals::<FIRST_ONLY>() else {
            return LiveDecision::BLIND;
        };
        let z_squared = u32::from(z) * u32::from(z);
        let (candidate, lowest) =
            self.largest_excess::<FIRST_ONLY>(width, z_squared, minimum, expected, totals);
        let window = candidate.filter(|one| one.stands_clear(z_squared, totals.live));
        LiveDecision {
            window: window.map(|window| LiveWindow {
                #[allow(clippy::cast_possible_truncation, reason = "less than 1024")]
                first: window.first as u16,
                width,
                photons_outside: totals.photons.wrapping_sub(window.photons),
                live_outside: totals.live.wrapping_sub(window.live.into()),
            }),
            is_blind: self.is_left_out(lowest.into(), width),
        }
    }

    /// The count of a bin, 0 of bins that do not exist.
    #[inline(always)]
    fn count(&self, bin: usize) -> u32 {
        let count = self.histogram.counts().get(bin);
        count.map_or(0, |&count| count.into())
    }

    /// Photons of the bins that blind `bin`. Saturates.
    fn blind(&self, bin: usize) -> u32 {
        let first = bin.saturating_sub(self.dead_time.into());
        let bins = self.histogram.counts().get(first..bin).unwrap_or_default();
        bins.iter()
            .fold(0, |sum: u32, &count| sum.saturating_add(count.into()))
    }

    /// One pass over the gated bins. `None` if a bin was blind in more laser cycles than there
    /// were.
    #[inline(always)]
    fn totals<const FIRST_ONLY: bool>(&self) -> Option<Totals> {
        let gated = self.gate.bins();
        let dead_time = usize::from(self.dead_time);
        let has_excluded = self.excluded.echoes() > 0;
        let mut blind = self.blind(gated.start);
        let (mut photons, mut live_sum) = (0u32, 0u64);
        let counts = self.histogram.counts().get(gated.clone())?;
        for (bin, &count) in gated.zip(counts) {
            let live = self.cycles.checked_sub(blind)?;
            let count: u32 = count.into();
            #[allow(clippy::cast_possible_truncation, reason = "less than 1024")]
            if !(has_excluded && self.excluded.contains(bin as u16)) {
                photons = photons.wrapping_add(count);
                live_sum += u64::from(live);
            }
            // At most 28 bits and 24.
            blind += count;
            if !FIRST_ONLY {
                blind = blind.wrapping_sub(self.count(bin.wrapping_sub(dead_time)));
            }
        }
        (live_sum > 0).then_some(Totals {
            photons,
            live: live_sum,
        })
    }

    /// The window with the largest excess, and the lowest sum of live laser cycles of a window.
    ///
    /// From one window to the next the live laser cycles lose the photons of the window, and gain
    /// those of the window a dead time before it.
    #[inline(always)]
    fn largest_excess<const FIRST_ONLY: bool>(
        &self,
        width: u16,
        z_squared: u32,
        minimum: u32,
        expected: Option<BinIndex>,
        totals: Totals,
    ) -> (Option<Candidate>, u32) {
        let starts = self.starts(width, expected);
        let least = self.least_live(width.into());
        let width = usize::from(width);
        let dead_time = usize::from(self.dead_time);
        let (first, last) = (usize::from(*starts.start()), usize::from(*starts.end()));
        let counts = self.histogram.counts();
        let sum = |bins: Range<usize>| {
            let bins = counts.get(bins).unwrap_or_default().iter();
            bins.fold(0u32, |sum, &count| sum.wrapping_add(count.into()))
        };
        let mut photons = sum(first..first + width);
        let bins = first..first + width;
        let mut live = bins.fold(0u32, |sum, bin| {
            sum.wrapping_add(self.cycles.saturating_sub(self.blind(bin)))
        });
        let ended = |bin: usize| bin.saturating_sub(dead_time);
        let mut before = sum(ended(first)..ended(first + width));

        let (share, shift) = totals.share::<W>();
        #[allow(clippy::cast_possible_truncation, reason = "live is less than 2³²")]
        let quarter = (totals.live / 4).min(u32::MAX.into()) as u32;
        // Below half of z² no window of less than a quarter of the light is a detection.
        let mut best_score = (u64::from(z_squared >> 16) / 2, 1);
        let (mut best, mut lowest) = (None, u32::MAX);
        for start in first..=last {
            lowest = lowest.min(live);
            if photons >= minimum {
                // Rounded up: a window of all light has no excess.
                let expected = (u64::from(live).wrapping_mul(share) >> shift) + 1;
                let excess = (u64::from(photons) << 8).saturating_sub(expected);
                let square = excess.saturating_mul(excess);
                let is_better = || {
                    is_higher::<W>((square, expected), best_score)
                        || best.is_none() && live > quarter
                };
                if excess > 0
                    && is_better()
                    && live >= least
                    && !self.touches_excluded(start, width)
                {
                    best_score = (square, expected);
                    best = Some(Candidate {
                        first: start,
                        photons,
                        live,
                        expected,
                        excess,
                    });
                }
            }
            live = live.wrapping_sub(photons);
            if !FIRST_ONLY {
                live = live.wrapping_add(before);
                let leaving = start.wrapping_sub(dead_time);
                before = before
                    .wrapping_add(self.count(leaving.wrapping_add(width)))
                    .wrapping_sub(self.count(leaving));
            }
            photons = photons
                .wrapping_add(self.count(start + width))
                .wrapping_sub(self.count(start));
        }
        (best, lowest)
    }
    /// Where windows may start: in the gate, and so that they contain `expected`.
    #[inline(always)]
    fn starts(&self, width: u16, expected: Option<BinIndex>) -> RangeInclusive<u16> {
        let first = self.gate.first();
        // A gate has 8 bins or more, a window at most 7.
        let last = (self.gate.last() + 1).saturating_sub(width);
        match expected {
            Some(bin) => {
                let bin = bin.raw();
                first.max((bin + 1).saturating_sub(width))..=last.min(bin)
            }
            None => first..=last,
        }
    }

    /// The fewest live laser cycles of a window that is not left out.
    #[inline(always)]
    fn least_live(&self, width: u32) -> u32 {
        // At most 28 + 3 bits.
        self.cycles.wrapping_mul(width).div_ceil(Self::LEAST_SHARE)
    }

    #[inline(always)]
    fn touches_excluded(&self, start: usize, width: usize) -> bool {
        let mut bins = start..start + width;
        #[allow(clippy::cast_possible_truncation, reason = "less than 1024")]
        let is_excluded = |bin: usize| self.excluded.contains(bin as u16);
        self.excluded.echoes() > 0 && bins.any(is_excluded)
    }
}

impl Totals {
    /// Photons a live laser cycle as a fixed-point number, and the bits after the point less 8: a
    /// window's live laser cycles times the first, shifted right by the second, are the photons
    /// expected in it, in 1/256.
    ///
    /// A window's live laser cycles are at most all of them, so that the product is below 2⁶⁴.
    #[inline(always)]
    fn share<W: CounterWidth>(&self) -> (u64, u32) {
        let photons = u64::from(self.photons);
        // With 10 bits at most 2²⁰ photons. Then the product's upper word is the result.
        let bits = if W::BITS <= 10 {
            40
        } else {
            photons.leading_zeros().min(62)
        };
        let share = (photons << bits).checked_div(self.live);
        (share.unwrap_or(0), bits - 8)
    }
}

impl Candidate {
    /// The test of the module's documentation. `live` are the live laser cycles of all bins, and
    /// `z_squared` is in 1/2²⁴.
    fn stands_clear(&self, z_squared: u32, live: u64) -> bool {
        // 31 + 16 bits, at most 1.
        let share = (u64::from(self.live) << 16).checked_div(live);
        let share = share.unwrap_or(0).min(1 << 16);
        // 40 + 16 bits.
        let variance = (self.expected * ((1 << 16) - share)) >> 16;
        let sixth = u64::from(z_squared / 6);
        let skew = (sixth * (1u64 << 16).saturating_sub(2 * share)) >> 32;
        let square_of_sixth = u64::from(z_squared / 36) >> 16;
        // V²/(V + c) without a square.
        let less = (variance * square_of_sixth).checked_div(variance + square_of_sixth);
        let spread = variance - less.unwrap_or(0);
        // Far above any variance.
        let above = self.excess.saturating_sub(skew).min(1 << 31);
        above * above > (u64::from(z_squared >> 12) * spread) >> 4
    }
}

/// Whether the first of two squares of an excess is higher for its expected photons.
#[inline(always)]
fn is_higher<W: CounterWidth>(one: (u64, u64), other: (u64, u64)) -> bool {
    if W::BITS <= 10 {
        // 42 + 21 bits.
        one.0 * other.1 > other.0 * one.1
    } else {
        u128::from(one.0) * u128::from(other.1) > u128::from(other.0) * u128::from(one.1)
    }
}
