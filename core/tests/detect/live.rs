//! Live counts against the formulas of the module's documentation, in floating point. `core/tests/proofs/live.rs` has all
//! small histograms.

use dtof_core::fixed::types::U4F12;
use dtof_core::rule::{ExcludedBins, LiveCounts};
use dtof_core::{
    BinIndex, Count, Count10, Count16, Count24, CounterWidth, DetectionRule, Histogram, RangeGate,
    WindowRule,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use crate::common::live::Exposure;

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
    let live = LiveCounts::new(&histogram, &gate, excluded, cycles, dead_time).unwrap();
    let expected = expected.map(BinIndex::saturating);
    let decision = rule.detect_live(&live, expected);
    let bins = (gate.first().into(), gate.last().into());
    let exposure = Exposure::new(counts, bins, excluded, cycles, dead_time.into());
    if let Some(window) = decision.window {
        let peak = live.brightest(window.first, window.width);
        assert!(exposure.has_most_light(window.first, window.width, peak.bin));
    }
    exposure.check(rule, expected, &decision).fires
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

/// Windows of up to 7 nearly full counters of 24 bits, wherever they lie.
#[test]
fn of_windows_with_the_most_photons_the_brightest_is_reported() {
    for width in 1..=7 {
        for (first, second) in [(10, 40), (40, 10)] {
            for part in [2, 3, 10, 100, 10_000] {
                let mut counts = [1000; 64];
                counts[first..first + 7].fill(Count24::MAX - 1);
                counts[second..second + 7].fill((Count24::MAX - 1) / part);
                check_wide(&counts, width);
            }
        }
    }
}

/// With 2²⁴ photons above four times as many the level is rounded down by up to 1, and a photon is half of that.
#[test]
fn of_windows_that_are_nearly_as_bright_one_is_reported() {
    for more in 1..20 {
        for less in [0, 1, 2, 3] {
            let mut counts = [9_600_000; 64];
            counts[10..17].fill(13_000_000);
            counts[40..47].fill(13_000_000);
            counts[13] += 5 * more;
            counts[43] += 5 * more - less;
            check_wide(&counts, 7);
        }
    }
}

fn check_wide(counts: &[u32; 64], width: u8) {
    let rule = WindowRule::new(width, U4F12::lit("4"), Count::saturating(5)).unwrap();
    let cycles = LiveCounts::<64, Count24>::MAX_CYCLES;
    let (gate, none) = (RangeGate::full(), ExcludedBins::NONE);
    let fired = check::<64, Count24>(counts, gate, &none, cycles, 1, &rule, None);
    assert!(fired);
}

/// Also if `(S - E)²/E` does not fit 32 bits, as of full counters where few photons are expected.
#[test]
fn behind_bright_bins_the_brightest_window_is_reported() {
    let mut counts = [0; 1024];
    counts[..70].fill(1022);
    let rule = WindowRule::new(7, U4F12::lit("4"), Count::saturating(5)).unwrap();
    let gate = RangeGate::new(63, 1023).unwrap();
    // Bins 63 to 69 are live in 1149 laser cycles, and bins behind them in more.
    let none = ExcludedBins::NONE;
    assert!(check::<1024, Count10>(
        &counts, gate, &none, 65_535, 63, &rule, None
    ));
    assert!(check::<1024, Count16>(
        &counts, gate, &none, 65_535, 63, &rule, None
    ));
}
