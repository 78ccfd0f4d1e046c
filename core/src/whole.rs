//! The decision on a whole histogram, as a sensor counts it: once, on all its photons.
//!
//! Counts that do not fit their counters are divided by a power of two, and the laser cycles by the same. They are
//! then less noisy than Poisson numbers of their size, so that there are no more false alarms. Bins with less than that
//! power become empty, so a target much dimmer than another may be lost. The photons of an event are divided, too.
//!
//! What lies outside of the range gate may reach into it: the tail of a cover glass, or the edge of a bright surface. Its
//! slope exceeds the background at the end of the gate. So a peak at the end is no surface if as many photons
//! lie in the bins beside its window, outside of it, and none of the bins between has surely fewer than the mean of the
//! window. The gate is then narrowed past that slope, and decided on again.
//!
//! ```
//! use dtof_core::{EchoNumber, PixelConfig, Statistics, WholeHistogram, checked};
//!
//! const CONFIG: PixelConfig<128> = checked!(PixelConfig::paper().build());
//! let mut counts = [900u32; 128];
//! (counts[40], counts[41]) = (70_000_000, 30_000_000); // more than 24 bits
//! let (mut whole, mut statistics) = (WholeHistogram::<128>::new(), Statistics::new());
//! let mut echoes = Vec::new();
//! whole.decide(&CONFIG, &counts, 500_000, &mut statistics, |number, echo| echoes.push((number, *echo)));
//! assert_eq!((echoes[0].0, echoes[0].1.peak.bin.raw()), (EchoNumber::FIRST, 40));
//! assert_eq!((statistics.events, statistics.counted), (1, 100_000_000 + 126 * 900));
//! ```
//!
//! Cost: that of a decision, and of another one for each window of a slope that is left out: of a tail over all of 128
//! bins 56 with a window of 3 bins, half a million instructions. Usual histograms have none, or two or three.
//!
//! Source: ours.

use core::ops::Range;

use crate::config::PixelConfig;
use crate::detect::{Detection, DetectionRule, LiveCounts};
use crate::histogram::Histogram;
use crate::histogram::counter::{Count24, CounterWidth, PhotonCount};
use crate::histogram::gate::RangeGate;
use crate::statistics::Statistics;
use crate::units::{BinIndex, EchoNumber};

/// Room for the decision on one whole histogram, and how the last one was made.
#[derive(Clone, Debug)]
pub struct WholeHistogram<const BINS: usize, W: CounterWidth = Count24> {
    histogram: Histogram<BINS, W>,
    gate: RangeGate<BINS>,
    cycles: u32,
    shift: u32,
}

impl<const BINS: usize, W: CounterWidth> WholeHistogram<BINS, W> {
    /// The most photons in a bin that are not divided. A full counter could have lost one.
    pub const MOST: u32 = W::MAX - 1;

    /// Before the first decision.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            histogram: Histogram::new(),
            gate: RangeGate::full(),
            cycles: 0,
            shift: 0,
        }
    }

    /// Decides on `counts`, the photons of each bin in `cycles` laser cycles. Calls `echo` for each echo, at most
    /// [`PixelConfig::echoes`], the highest peak first. X, L1, L2 and tracking have no effect.
    ///
    /// `statistics` get all photons, undivided, the events, an exposure that has expired if there is none, and a blind
    /// look if a target may be hidden: with a [dead time](crate::PixelConfigBuilder::dead_time) that the rule weighs, a
    /// gated bin was blind or had a photon in nearly all laser cycles, or the counts contradict the dead time. In that
    /// last case there is no echo, as the depth could be wrong. Without a dead time `cycles` do not matter.
    pub fn decide<R: DetectionRule, C: PhotonCount>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        counts: &[C; BINS],
        cycles: u64,
        statistics: &mut Statistics,
        mut echo: impl FnMut(EchoNumber, &Detection),
    ) {
        let most_cycles = match config.weighs_dead_time() {
            true => LiveCounts::<BINS, W>::MAX_CYCLES.into(),
            false => u64::MAX,
        };
        statistics.add_counts(counts, config.gate());
        let highest = counts
            .iter()
            .fold(0, |highest: u32, &count| highest.max(count.into()));
        let exceeds = |shift| highest >> shift > Self::MOST || cycles >> shift > most_cycles;
        self.shift = 0;
        while self.shift < 31 && exceeds(self.shift) {
            self.shift += 1;
        }
        self.cycles = u32::try_from(cycles >> self.shift).unwrap_or(u32::MAX);
        let mut gated = *config;
        loop {
            self.gate = *gated.gate();
            self.fill(config, counts);
            let highest = self.histogram.peak().bin;
            let is_empty = self.histogram.total() == 0;
            let mut found = [None; EchoNumber::LAST.raw() as usize];
            let (mut places, mut ends) = (found.iter_mut(), None);
            let is_blind = gated.detect_echoes(&mut self.histogram, self.cycles, |_, detection| {
                let bin = detection.peak.bin;
                let [nearest, farthest] = ends.unwrap_or([bin; 2]);
                ends = Some([bin.min(nearest), bin.max(farthest)]);
                if let Some(place) = places.next() {
                    *place = Some(*detection);
                }
            });
            // A slope with the highest bin may hide a peak.
            let ends = ends.unwrap_or([highest; 2]);
            let slope = match is_empty {
                true => None,
                false => self.slope(config, counts, ends),
            };
            match slope {
                Some(Some(narrower)) => {
                    gated = gated.with_gate(narrower);
                    continue;
                }
                Some(None) => found = [None; EchoNumber::LAST.raw() as usize],
                None => {}
            }
            let mut number = EchoNumber::FIRST.raw();
            for detection in found.iter().flatten() {
                echo(
                    EchoNumber::new(number).unwrap_or(EchoNumber::LAST),
                    detection,
                );
                statistics.events += 1;
                number += 1;
            }
            statistics.expired += u64::from(number == EchoNumber::FIRST.raw());
            statistics.blind_looks += u64::from(is_blind);
            return;
        }
    }

    /// The photons that the last decision was made from, if it was one with these `counts`: those in its gate, divided if
    /// they did not fit. With a dead time that the rule weighs, the counters before the gate have theirs, too.
    #[must_use]
    pub fn photons<R: DetectionRule, C: PhotonCount>(
        &self,
        config: &PixelConfig<BINS, R>,
        counts: &[C; BINS],
    ) -> Histogram<BINS, W> {
        let mut other = self.clone();
        other.fill(config, counts);
        other.histogram
    }

    /// The gate of the last decision: that of the configuration, or a part of it.
    #[must_use]
    pub const fn gate(&self) -> &RangeGate<BINS> {
        &self.gate
    }

    /// The laser cycles of the last decision, divided as its photons.
    #[must_use]
    pub const fn cycles(&self) -> u32 {
        self.cycles
    }

    fn fill<R: DetectionRule, C: PhotonCount>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        counts: &[C; BINS],
    ) {
        let keeps_before = config.weighs_dead_time();
        self.histogram
            .fill(counts, self.shift, &self.gate, keeps_before);
    }

    /// If the nearest or the farthest peak is the slope of something outside of the gate of the configuration, the gate
    /// without it, unless too few bins are left.
    #[inline(never)]
    fn slope<R: DetectionRule, C: PhotonCount>(
        &self,
        config: &PixelConfig<BINS, R>,
        counts: &[C; BINS],
        [nearest, farthest]: [BinIndex; 2],
    ) -> Option<Option<RangeGate<BINS>>> {
        let (given, width) = (config.gate(), config.rule().window_bins().clamp(1, 255));
        let bins = RangeGate::<BINS>::full().last() + 1;
        let window = |peak: BinIndex| {
            let from = peak.raw().saturating_sub(width / 2).max(given.first());
            from..(peak.raw() + width / 2).min(given.last()) + 1
        };
        let (near, far) = (window(nearest), window(farthest));
        let before = near.start.saturating_sub(width)..near.start;
        let behind = far.end..(far.end + width).min(bins);
        let left = if given.first() > 0
            && self.falls_into(counts, &near, before, given.first() - 1..near.start)
        {
            near.end..self.gate.last() + 1
        } else if self.falls_into(counts, &far, behind, far.end..given.last() + 2) {
            self.gate.first()..far.start
        } else {
            return None;
        };
        let last = left.end.checked_sub(1);
        Some(last.and_then(|last| RangeGate::new(left.start, last).ok()))
    }

    /// Whether the bins `beside` a window have at least its mean, and each of the bins `between` may have: past the last bin
    /// there is none.
    #[inline(never)]
    fn falls_into<C: PhotonCount>(
        &self,
        counts: &[C; BINS],
        window: &Range<u16>,
        beside: Range<u16>,
        mut between: Range<u16>,
    ) -> bool {
        let (inside, width) = (self.sum(counts, window.clone()), window.len() as u64);
        // A count c is surely fewer if c + 2·√c < inside / width. These are squares of at most 32 bits.
        let may_have = |bin: u16| {
            let count = self.sum(counts, bin..bin + 1);
            let missing = inside.saturating_sub(count * width);
            missing * missing <= 4 * count * width * width
        };
        let bins_beside = beside.len() as u64;
        self.sum(counts, beside) * width >= inside * bins_beside && between.all(may_have)
    }

    /// The photons of these bins, fewer than 256, divided.
    #[inline(never)]
    fn sum<C: PhotonCount>(&self, counts: &[C; BINS], bins: Range<u16>) -> u64 {
        let counts = counts
            .get(bins.start.into()..bins.end.into())
            .unwrap_or_default();
        let mut photons = 0u32;
        for &count in counts {
            photons = photons.wrapping_add(count.into() >> self.shift);
        }
        photons.into()
    }
}

impl<const BINS: usize, W: CounterWidth> Default for WholeHistogram<BINS, W> {
    fn default() -> Self {
        Self::new()
    }
}
