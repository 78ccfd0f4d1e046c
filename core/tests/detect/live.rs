//! Live counts against the formulas of the module's documentation, in floating point.

use dtof_core::fixed::types::U4F12;
use dtof_core::rule::{ExcludedBins, LiveCounts, LiveDecision};
use dtof_core::{
    BinIndex, Count, Count10, Count16, Count24, CounterWidth, DetectionRule, Histogram, RangeGate,
    WindowRule,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// A histogram and how it is looked at.
struct Case<'a> {
    counts: &'a [u32],
    gate: (usize, usize),
    excluded: &'a ExcludedBins,
    cycles: u32,
    dead_time: usize,
    width: usize,
    z: f64,
    minimum: u32,
    expected: Option<usize>,
}

/// A window by the formulas.
#[derive(Clone, Copy, Debug)]
struct Window {
    first: usize,
    /// `(S - E)²/E`.
    score: f64,
    /// How far above the threshold, in counts.
    margin: f64,
}

impl Case<'_> {
    /// `N - Σ counts of the D bins before b`.
    fn live(&self, bin: usize) -> f64 {
        let before: u32 = self.counts[bin.saturating_sub(self.dead_time)..bin]
            .iter()
            .sum();
        f64::from(self.cycles) - f64::from(before)
    }

    fn is_excluded(&self, bin: usize) -> bool {
        self.excluded.contains(bin as u16)
    }

    /// The laser cycles in which a bin was live and had no photon.
    fn empty(&self, bin: usize) -> f64 {
        self.live(bin) - f64::from(self.counts[bin])
    }

    /// The fewest live laser cycles of a window that is not left out.
    fn least(&self) -> f64 {
        let share = f64::from(self.cycles) * self.width as f64 / 1024.0;
        share.ceil().max(self.minimum.into())
    }

    /// Whether a gated bin was blind or had a photon in nearly all laser cycles.
    fn is_blind(&self) -> bool {
        let mut bins = self.gate.0..=self.gate.1;
        bins.any(|bin| self.empty(bin) * (self.width as f64) < self.least())
    }

    /// All windows above their share that are live often enough.
    fn windows(&self) -> Vec<Window> {
        let (first, last) = self.gate;
        let bins = (first..=last).filter(|&bin| !self.is_excluded(bin));
        let (photons, live) = bins.fold((0.0, 0.0), |(photons, live), bin| {
            (photons + f64::from(self.counts[bin]), live + self.live(bin))
        });
        let mut windows = Vec::new();
        for first in first..=last + 1 - self.width {
            let mut bins = first..first + self.width;
            if self.expected.is_some_and(|bin| !bins.contains(&bin)) {
                continue;
            }
            let inside = bins.clone().map(|bin| self.counts[bin]).sum::<u32>();
            let live_inside: f64 = bins.clone().map(|bin| self.live(bin)).sum();
            if live_inside < self.least()
                || inside < self.minimum
                || bins.any(|bin| self.is_excluded(bin))
            {
                continue;
            }
            let share = live_inside / live;
            let expected = photons * share;
            let excess = f64::from(inside) - expected;
            let variance = expected * (1.0 - share);
            let skew = (self.z * self.z / 6.0 * (1.0 - 2.0 * share)).max(0.0);
            let spread = variance * variance / (variance + self.z * self.z / 36.0);
            if excess > 0.0 {
                windows.push(Window {
                    first,
                    score: excess * excess / expected.max(1.0 / 256.0),
                    margin: excess - skew - self.z * spread.sqrt(),
                });
            }
        }
        windows
    }

    /// Checks a decision. Returns whether it is a detection.
    fn check(&self, decision: &LiveDecision) -> bool {
        let (first, last) = self.gate;
        if (first..=last).any(|bin| self.empty(bin) < 0.0) {
            assert_eq!(decision, &LiveDecision::BLIND);
            return false;
        }
        let windows = self.windows();
        assert_eq!(decision.is_blind, self.is_blind());
        let photons: u32 = self.counts[first..=last].iter().sum();
        // 1/256 photon, and 1 in 4096 of what is expected.
        let tolerance = 0.02 + f64::from(photons) / 4096.0;
        let clear = windows.iter().filter(|one| one.margin > tolerance);
        let highest = clear.fold(0.0, |highest: f64, one| highest.max(one.score));
        let Some(found) = &decision.window else {
            assert!(
                highest == 0.0,
                "missed one of {windows:?} {:?}",
                self.counts
            );
            return false;
        };
        let window = windows
            .iter()
            .find(|one| one.first == usize::from(found.first));
        let window = window.unwrap_or_else(|| panic!("{found:?} of {windows:?}"));
        assert!(
            window.score > 0.98 * highest - 0.1,
            "{window:?} of {windows:?}"
        );
        assert!(window.margin > -tolerance, "{window:?}");
        // What is outside is exact.
        let inside = window.first..window.first + self.width;
        let outside = (first..=last).filter(|bin| !inside.contains(bin) && !self.is_excluded(*bin));
        let (photons, live) = outside.fold((0, 0.0), |(photons, live), bin| {
            (photons + self.counts[bin], live + self.live(bin))
        });
        assert_eq!(usize::from(found.width), self.width);
        assert_eq!(found.photons_outside, photons);
        assert_eq!(found.live_outside, live as u64);
        true
    }
}

/// Decides on `counts` and checks it.
fn check<const BINS: usize, W: CounterWidth>(
    counts: &[u32; BINS],
    gate: RangeGate<BINS>,
    excluded: &ExcludedBins,
    cycles: u32,
    dead_time: u16,
    rule: &WindowRule,
    expected: Option<u16>,
) -> bool {
    let mut histogram = Histogram::<BINS, W>::new();
    let _ = histogram.add_frame(counts, &RangeGate::full());
    let live = LiveCounts::new(&histogram, &gate, excluded, cycles, dead_time);
    let decision = rule.detect_live(&live.unwrap(), expected.map(BinIndex::saturating));
    let case = Case {
        counts,
        gate: (gate.first().into(), gate.last().into()),
        excluded,
        cycles,
        dead_time: dead_time.into(),
        width: rule.width().into(),
        z: rule.z().to_num(),
        minimum: rule.minimum_count().raw(),
        expected: expected.map(usize::from),
    };
    case.check(&decision)
}

/// All histograms of 8 bins with up to 3 counts each, at all dead times.
#[test]
fn small_histograms_are_decided_by_the_formula() {
    let mut fired = 0;
    for code in 0..1u32 << 16 {
        let counts = std::array::from_fn(|bin| code >> (2 * bin) & 3);
        let photons: u32 = counts.iter().sum();
        for dead_time in 1..=8 {
            let width = 1 + (code % 3) as u8;
            let z = [U4F12::lit("1.2"), U4F12::lit("2.5")][code as usize / 3 % 2];
            let rule = WindowRule::new(width, z, Count::saturating(1)).unwrap();
            let cycles = [photons, 3, 24][code as usize % 5 % 3].max(1);
            fired += u32::from(check::<8, Count10>(
                &counts,
                RangeGate::full(),
                &ExcludedBins::NONE,
                cycles,
                dead_time,
                &rule,
                None,
            ));
        }
    }
    println!("{fired} detections");
    assert!(fired > 1000);
}

/// A slope with a target, as a TDC with this dead time counts it.
fn drawn<const BINS: usize>(rng: &mut Pcg32, dead_time: usize, cycles: u32) -> [u32; BINS] {
    let mut uniform = || f64::from(rng.next_u32()) / 4_294_967_296.0;
    let light = 0.002 * 100f64.powf(uniform());
    let target = (uniform() * BINS as f64) as usize;
    let strength = uniform() * 0.5;
    let mut counts = [0; BINS];
    for bin in 0..BINS {
        let before: u32 = counts[bin.saturating_sub(dead_time)..bin].iter().sum();
        let live = f64::from(cycles.saturating_sub(before));
        let light = if bin == target {
            light + strength
        } else {
            light
        };
        let mean = live * (1.0 - (-light).exp());
        let spread = mean.sqrt() * (uniform() + uniform() + uniform() - 1.5) * 2.0;
        counts[bin] = (mean + spread).round().clamp(0.0, live) as u32;
    }
    counts
}

fn random<const BINS: usize, W: CounterWidth>(seed: u64, most_cycles: u32) -> u32 {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut fired = 0;
    for _ in 0..4000 {
        let mut below = |limit: u32| rng.next_u32() % limit;
        let cycles = 1 + below(most_cycles) / (1 << below(12));
        let dead_time = 1 + below(BINS as u32 + 4) as u16;
        let first = below(BINS as u32 / 2 - 8) as u16;
        let last = BINS as u16 - 1 - below(BINS as u32 / 4) as u16;
        let width = 1 + below(7) as u8;
        let rule = WindowRule::new(width, U4F12::lit("4"), Count::saturating(below(6)));
        let mut excluded = ExcludedBins::new(below(4) as u8);
        if below(3) == 0 {
            excluded.push(BinIndex::saturating(first + below(8) as u16));
        }
        let expected = (below(3) == 0).then(|| first + below(u32::from(last - first)) as u16);
        let counts = drawn::<BINS>(&mut rng, dead_time.into(), cycles);
        if counts.iter().any(|&count| count >= W::MAX) {
            continue;
        }
        let gate = RangeGate::new(first, last).unwrap();
        let rule = rule.unwrap();
        fired += u32::from(check::<BINS, W>(
            &counts, gate, &excluded, cycles, dead_time, &rule, expected,
        ));
    }
    fired
}

/// Gates, echoes, an expected bin, all dead times and widths of counters.
#[test]
fn drawn_histograms_are_decided_by_the_formula() {
    let fired = [
        random::<64, Count10>(1, 5000),
        random::<128, Count10>(2, 5000),
        random::<64, Count16>(3, 100_000),
        random::<256, Count24>(4, 1 << 28),
    ];
    println!("{fired:?} detections of 4000 each");
    assert!(fired.iter().all(|&fired| fired > 400));
}

/// Full counters, before the gate or in it, and too many laser cycles cannot be weighed.
#[test]
fn counts_that_cannot_be_weighed_are_refused() {
    let gate = RangeGate::new(4, 15).unwrap();
    let weighs = |bin: usize, count: u32, cycles: u32| {
        let mut counts = [0u32; 16];
        counts[bin] = count;
        let mut histogram = Histogram::<16>::new();
        let _ = histogram.add_frame(&counts, &RangeGate::full());
        LiveCounts::new(&histogram, &gate, &ExcludedBins::NONE, cycles, 16).is_some()
    };
    assert!(weighs(2, 1022, 2000) && !weighs(2, 1023, 2000));
    assert!(weighs(7, 1023, 2000) && !weighs(7, 1024, 2000));
    assert!(weighs(7, 9, 1 << 28) && !weighs(7, 9, (1 << 28) + 1));
}

/// The bin with the most light is the peak: not one that was never live, nor one that was live once.
#[test]
fn the_brightest_bin_is_the_one_with_the_most_light() {
    let brightest = |bins: [(usize, u32); 3], cycles| {
        let mut counts = [0u32; 128];
        for (bin, count) in bins {
            counts[bin] = count;
        }
        let mut histogram = Histogram::<128, Count16>::new();
        let _ = histogram.add_frame(&counts, &RangeGate::full());
        let gate = RangeGate::full();
        let live = LiveCounts::new(&histogram, &gate, &ExcludedBins::NONE, cycles, 5).unwrap();
        let peak = live.brightest(56, 3);
        (peak.bin.raw(), peak.count.raw())
    };
    // Bin 56 is blind after the 100 photons of bin 51, bins 57 and 58 are live.
    assert_eq!(brightest([(51, 100), (57, 40), (58, 20)], 100), (57, 40));
    // Bin 56 has a photon in its only live laser cycle, bin 57 one in 399 of 400.
    assert_eq!(brightest([(51, 399), (56, 1), (57, 398)], 400), (57, 398));
    // The first of two.
    assert_eq!(brightest([(51, 0), (56, 30), (57, 21)], 100), (56, 30));
    assert_eq!(brightest([(51, 0), (56, 0), (58, 0)], 100), (56, 0));
}
