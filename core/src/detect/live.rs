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
//! That is exact, whatever the light, if D is whole bins and the TDC is live again at the next laser
//! pulse. Of a dead time in between, or of one that is not well known, D is the next lower number: one
//! bin too few hardly matters, one too many makes a target of the bin D behind a bright one.
//!
//! Under a flat background each photon lies in a window
//! with the probability `p = Σ live(window) / Σ live(all gated bins)`. So the window rule
//! compares a window's photons with `T·p` instead of `T·w/B`:
//!
//! ```text
//! (S - E - z²/6·(1 - 2p))² > z²·V²/(V + z²/36)     E = T·p     V = E·(1 - p)
//! ```
//!
//! All gated windows are looked at, because the highest bin is often the front of the slope.
//! Of those above the threshold the one with the largest `(S - E)²/E` is reported. That is rounded
//! down to 1/256. The last of several wins a tie: of windows around the same photons, it was live least.
//!
//! A window that was live in fewer than one of [`LiveCounts::LEAST_SHARE`] laser cycles, or in fewer than
//! the rule's minimum of photons, is left out. Bins around an echo that was reported are left out, too, but their photons go on
//! blinding the bins behind them, as those before the gate do.
//!
//! Source: the estimator of P. B. Coates, "The correction for photon 'pile-up' in the
//! measurement of radiative lifetimes", J. Phys. E 1 (1968) 878, for the first photon of a
//! laser cycle; the sum of D bins for shorter dead times and the test are ours.

use core::marker::PhantomData;
use core::ops::{Range, RangeInclusive};

use crate::depth::Counted;
use crate::histogram::counter::CounterWidth;
use crate::histogram::excluded::ExcludedBins;
use crate::histogram::gate::RangeGate;
use crate::histogram::{Histogram, Peak};
use crate::units::{BinIndex, Count};

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
    /// Whether a gated bin was blind or had a photon in nearly all laser cycles, so that windows there
    /// or behind it are left out; or all are, because the counts contradict the dead time.
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
    /// The fewest laser cycles in which a bin was live and had no photon.
    fewest_empty: u32,
}

/// A window, and the photons expected in it, in 1/256.
#[derive(Clone, Copy)]
struct Candidate {
    first: usize,
    photons: u32,
    live: u32,
    expected: u64,
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
    /// live; and of more laser cycles than [`Self::MAX_CYCLES`].
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

    /// The bin with the most light of the `width` bins from `first` on, the lowest of several, and its
    /// photons. A bin that is left out has none.
    #[inline(never)]
    #[must_use]
    pub fn brightest(&self, first: u16, width: u16) -> Peak {
        let (mut brightest, mut highest) = (first, 0);
        for bin in first..first.saturating_add(width) {
            let counted = self.counted(bin);
            let light = if self.is_left_out(counted.live) {
                0
            } else {
                counted.light()
            };
            if light > highest {
                (brightest, highest) = (bin, light);
            }
        }
        Peak {
            bin: BinIndex::saturating(brightest),
            count: Count::saturating(self.count(brightest.into())),
        }
    }

    /// The photons of a bin, and the laser cycles in which it was live.
    pub(crate) fn counted(&self, bin: u16) -> Counted {
        Counted {
            photons: self.count(bin.into()).into(),
            live: self.live(bin).into(),
        }
    }

    /// Whether a bin was live in too few laser cycles.
    #[must_use]
    pub fn is_left_out(&self, live: u64) -> bool {
        live * u64::from(Self::LEAST_SHARE) < u64::from(self.cycles)
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
        let Some(totals) = self.totals() else {
            return LiveDecision::BLIND;
        };
        let z_squared = u32::from(z) * u32::from(z);
        // Below half of z² no window of less than a quarter of the light is a detection.
        let most = 4 * u64::from(width) * u64::from(self.cycles);
        let half = u64::from(z_squared >> 17);
        let least = self.least_live(width.into()).max(minimum);
        let levels = Levels {
            excess: if totals.live < most { 0 } else { half },
            least,
            minimum,
            z_squared,
            live: totals.live,
        };
        let window = self.largest_excess(width, expected, &totals, &levels);
        LiveDecision {
            window: window.map(|window| LiveWindow {
                #[allow(clippy::cast_possible_truncation, reason = "less than 1024")]
                first: window.first as u16,
                width,
                photons_outside: totals.photons.wrapping_sub(window.photons),
                live_outside: totals.live.wrapping_sub(window.live.into()),
            }),
            // At most 28 + 3 bits.
            is_blind: totals.fewest_empty.wrapping_mul(width.into()) < least,
        }
    }

    /// The count of a bin, 0 of bins that do not exist.
    #[inline(always)]
    fn count(&self, bin: usize) -> u32 {
        let count = self.histogram.counts().get(bin);
        count.map_or(0, |&count| count.into())
    }

    /// Photons of some bins. Those of all fit 32 bits.
    #[inline(never)]
    fn photons(&self, bins: Range<usize>) -> u32 {
        let bins = self.histogram.counts().get(bins).unwrap_or_default();
        bins.iter()
            .fold(0, |sum: u32, &count| sum.wrapping_add(count.into()))
    }

    /// Photons of the bins that blind `bin`.
    fn blind(&self, bin: usize) -> u32 {
        self.photons(bin.saturating_sub(self.dead_time.into())..bin)
    }

    /// One pass over the gated bins. `None` if a bin was blind or had a photon in more laser cycles
    /// than there were.
    #[inline(never)]
    fn totals(&self) -> Option<Totals> {
        let gated = self.gate.bins();
        let dead_time = usize::from(self.dead_time);
        let all = self.histogram.counts();
        let counts = all.get(gated.clone())?;
        // Bins that no photon has ceased to blind yet: all of them if only the first photon counts.
        let from = dead_time.saturating_sub(gated.start).min(counts.len());
        let (early, late) = counts.split_at_checked(from)?;
        let ended = all.get((gated.start + from).saturating_sub(dead_time)..)?;
        let photons = self.photons(gated.clone());
        let mut blind = self.blind(gated.start);
        let mut blind_sum = Sum::<W>::ZERO;
        for &count in early {
            blind_sum.add(blind);
            blind = blind.wrapping_add(count.into());
        }
        let mut highest = blind;
        for (&count, &ended) in late.iter().zip(ended) {
            blind_sum.add(blind);
            blind = blind.wrapping_add(count.into());
            highest = highest.max(blind);
            blind = blind.wrapping_sub(ended.into());
        }
        let fewest_empty = self.cycles.checked_sub(highest)?;
        let bins = counts.len() as u64;
        let live = (u64::from(self.cycles) * bins).wrapping_sub(blind_sum.total());
        let mut totals = Totals {
            photons,
            live,
            fewest_empty,
        };
        if self.excluded.echoes() > 0 {
            self.leave_out_excluded(&mut totals);
        }
        (totals.live > 0).then_some(totals)
    }

    #[cold]
    #[inline(never)]
    fn leave_out_excluded(&self, totals: &mut Totals) {
        let bins = self.gate.first()..=self.gate.last();
        for bin in bins.filter(|&bin| self.excluded.contains(bin)) {
            totals.photons = totals.photons.wrapping_sub(self.count(bin.into()));
            totals.live = totals.live.wrapping_sub(self.live(bin).into());
        }
    }

    /// Finds the window with the largest excess of those above the threshold.
    ///
    /// From one window to the next the live laser cycles lose the photons of the window, and gain
    /// those of the window a dead time before it.
    #[inline(never)]
    fn largest_excess(
        &self,
        width: u16,
        expected: Option<BinIndex>,
        totals: &Totals,
        levels: &Levels,
    ) -> Option<Candidate> {
        let starts = self.starts(width, expected);
        let (first, last) = (usize::from(*starts.start()), usize::from(*starts.end()));
        let width = usize::from(width);
        let dead_time = usize::from(self.dead_time);
        // Where photons cease to blind a bin of the window, and all of it.
        let split = (dead_time + 1).saturating_sub(width).max(first).min(last);
        let end = dead_time.max(split).min(last);
        let counts = |bins: Range<usize>| self.histogram.counts().get(bins).unwrap_or_default();
        let live = (first..first + width).fold(0u32, |sum, bin| {
            sum.wrapping_add(self.cycles.wrapping_sub(self.blind(bin)))
        });
        let mut scan = Scan {
            levels: *levels,
            share: totals.share::<W>(),
            start: first,
            photons: self.photons(first..first + width),
            live,
            before: 0,
            best: None,
        };
        let pairs = |bins: Range<usize>| {
            let entering = counts(bins.start + width..bins.end + width);
            counts(bins).iter().zip(entering)
        };
        for (&leaving, &entering) in pairs(first..split) {
            scan.visit(self, width);
            scan.step(leaving, entering);
        }
        scan.before = self
            .photons(split.saturating_sub(dead_time)..(split + width).saturating_sub(dead_time));
        let blinding = counts((split + width).saturating_sub(dead_time)..BINS);
        for ((&leaving, &entering), &more) in pairs(split..end).zip(blinding) {
            scan.visit(self, width);
            scan.step(leaving, entering);
            scan.before = scan.before.wrapping_add(more.into());
        }
        let ended = pairs(end.saturating_sub(dead_time)..last.saturating_sub(dead_time));
        for ((&leaving, &entering), (&less, &more)) in pairs(end..last).zip(ended) {
            scan.visit(self, width);
            scan.step(leaving, entering);
            scan.before = scan
                .before
                .wrapping_add(more.into())
                .wrapping_sub(less.into());
        }
        scan.visit(self, width);
        scan.best
    }

    /// The level that a window reaches which is at least as good as this one. `None` if this one has too few photons
    /// or live laser cycles, touches an echo, does not stand clear, or has a lower level than the best.
    #[cold]
    #[inline(never)]
    fn next_level(&self, window: &Candidate, width: usize, levels: &Levels) -> Option<u64> {
        if window.photons < levels.minimum
            || window.live < levels.least
            || self.touches_excluded(window.first, width)
            || !window.stands_clear(levels.z_squared, levels.live)
        {
            return None;
        }
        let excess = excess(window.photons, window.expected);
        // Up to 35 bits. Of more than 32 the square takes the upper ones.
        let level = if excess >> 32 == 0 {
            excess.wrapping_mul(excess).checked_div(window.expected)?
        } else {
            let upper = excess >> 4;
            let level = upper.wrapping_mul(upper).checked_div(window.expected)?;
            level.saturating_mul(1 << 8)
        };
        (level >= levels.excess).then_some(level)
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

/// What a window has to reach, or exceed.
#[derive(Clone, Copy)]
struct Levels {
    /// The square of the excess over the expected photons, in 1/256.
    excess: u64,
    /// Live laser cycles: fewer are left out.
    least: u32,
    /// The fewest photons.
    minimum: u32,
    /// In 1/2²⁴.
    z_squared: u32,
    /// The live laser cycles of all bins.
    live: u64,
}

/// A pass over windows: the present one, and the best so far.
struct Scan {
    levels: Levels,
    share: (u64, u32),
    start: usize,
    photons: u32,
    live: u32,
    /// Photons of the window a dead time before.
    before: u32,
    best: Option<Candidate>,
}

impl Scan {
    /// Compares the present window with the best.
    #[inline(always)]
    fn visit<const BINS: usize, W: CounterWidth>(
        &mut self,
        counts: &LiveCounts<'_, BINS, W>,
        width: usize,
    ) {
        let (photons, live) = (self.photons, self.live);
        let expected = u64::from(live).wrapping_mul(self.share.0) >> self.share.1;
        // Rounded up: a window of all light has no excess.
        let expected = if W::BITS <= 10 {
            #[allow(clippy::cast_possible_truncation, reason = "28 bits")]
            u64::from((expected as u32).wrapping_add(1))
        } else {
            expected + 1
        };
        if reaches::<W>(photons, expected, self.levels.excess) {
            let candidate = Candidate {
                first: self.start,
                photons,
                live,
                expected,
            };
            if let Some(level) = counts.next_level(&candidate, width, &self.levels) {
                self.levels.excess = level;
                self.best = Some(candidate);
            }
        }
    }

    /// Goes on to the next window.
    #[inline(always)]
    fn step(&mut self, leaving: impl Into<u32>, entering: impl Into<u32>) {
        self.start += 1;
        self.live = self
            .live
            .wrapping_sub(self.photons)
            .wrapping_add(self.before);
        self.photons = self
            .photons
            .wrapping_add(entering.into())
            .wrapping_sub(leaving.into());
    }
}

/// A sum of one number a bin. Of counters of 10 bits it fits a word.
struct Sum<W> {
    narrow: u32,
    wide: u64,
    width: PhantomData<W>,
}

impl<W: CounterWidth> Sum<W> {
    const ZERO: Self = Self {
        narrow: 0,
        wide: 0,
        width: PhantomData,
    };

    #[inline(always)]
    fn add(&mut self, value: u32) {
        // 10 + 10 bits of photons, in 10 bits of bins.
        if W::BITS <= 10 {
            self.narrow = self.narrow.wrapping_add(value);
        } else {
            self.wide += u64::from(value);
        }
    }

    #[inline(always)]
    fn total(&self) -> u64 {
        self.wide + u64::from(self.narrow)
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
    #[inline(never)]
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
        let above = excess(self.photons, self.expected)
            .saturating_sub(skew)
            .min(1 << 31);
        above * above > (u64::from(z_squared >> 12) * spread) >> 4
    }
}

/// The excess of `photons` over the `expected` ones, in 1/256.
#[inline(always)]
fn excess(photons: u32, expected: u64) -> u64 {
    (u64::from(photons) << 8).saturating_sub(expected)
}

/// Whether the square of the excess is at least `level` times the `expected` photons, all in 1/256.
/// With counters of 10 bits the lower word of `level` is compared, which is no more than all of it.
#[inline(always)]
fn reaches<W: CounterWidth>(photons: u32, expected: u64, level: u64) -> bool {
    if W::BITS <= 10 {
        // A window has 13 bits of photons, and all bins have 20.
        #[allow(
            clippy::cast_possible_truncation,
            reason = "28 bits, and the lower 32 of a level"
        )]
        let (expected, level) = (expected as u32, level as u32);
        let Some(excess) = (photons << 8).checked_sub(expected) else {
            return false;
        };
        u64::from(excess) * u64::from(excess) >= u64::from(level) * u64::from(expected)
    } else {
        let excess = u128::from(excess(photons, expected));
        excess * excess >= u128::from(level) * u128::from(expected)
    }
}
