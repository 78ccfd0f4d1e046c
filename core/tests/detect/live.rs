//! Live counts against the formulas of the module's documentation, in floating point. `core/tests/proofs/live.rs` has all
//! small histograms.

use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::rule::{ExcludedBins, LiveCounts};
use dtof_core::{
    BinIndex, CentredWindow, Count, Count10, Count16, Count24, CounterWidth, DepthEstimator,
    Detection, DetectionRule, EchoNumber, Flags, Histogram, PixelConfig, RangeGate, SubBinOffset,
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
    // Bin 57 is live in one of 1024 laser cycles, which is enough, or in fewer.
    let live_twice = [(52, 2046), (57, 1), (58, 0)];
    assert_eq!(brightest(live_twice, 2048), (57, 1));
    assert_eq!(brightest([(52, 2047), (57, 1), (58, 0)], 2049), (56, 0));
    // The first of two.
    assert_eq!(brightest([(51, 0), (56, 30), (57, 21)], 100), (56, 30));
    assert_eq!(brightest([(51, 0), (56, 0), (58, 0)], 100), (56, 0));
}

/// Where next to nothing is expected, `z²/6` photons decide: 2.7 for a z of 4.
#[test]
fn two_photons_where_none_are_expected_are_no_detection() {
    fn fires<W: CounterWidth>(photons: u32) -> bool {
        let rule = WindowRule::new(1, U4F12::lit("4"), Count::saturating(1)).unwrap();
        let mut counts = [0; 1024];
        counts[500] = photons;
        let (gate, none) = (RangeGate::full(), ExcludedBins::NONE);
        check::<1024, W>(&counts, gate, &none, 1000, 3, &rule, None)
    }
    for photons in 1..6 {
        assert_eq!(fires::<Count10>(photons), photons > 2);
        assert_eq!(fires::<Count16>(photons), photons > 2);
    }
}

/// Nothing is brighter than a window that has every photon and all light. No bin behind it is ever live.
#[test]
fn a_window_of_all_light_is_no_detection() {
    fn fires<W: CounterWidth>(cycles: u32) -> bool {
        let mut counts = [0; 16];
        counts[8] = cycles / 2 + 1;
        counts[9] = cycles - counts[8];
        // A window without bin 8 has too few photons.
        let minimum = Count::saturating(counts[8]);
        let rule = WindowRule::new(3, U4F12::lit("1"), minimum).unwrap();
        let gate = RangeGate::new(8, 15).unwrap();
        let none = ExcludedBins::NONE;
        check::<16, W>(&counts, gate, &none, cycles, 16, &rule, None)
    }
    for cycles in 7..1000 {
        assert!(!fires::<Count10>(cycles));
        assert!(!fires::<Count16>(cycles));
        assert!(!fires::<Count24>(cycles * 1000));
    }
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

/// The first bin of the window that is reported, with counters of 10, 16 and 24 bits.
fn reported(
    counts: &[u32; 64],
    cycles: u32,
    dead_time: u16,
    rule: &WindowRule,
) -> [Option<u16>; 3] {
    fn first<W: CounterWidth>(
        counts: &[u32; 64],
        cycles: u32,
        dead_time: u16,
        rule: &WindowRule,
    ) -> Option<u16> {
        let mut histogram = Histogram::<64, W>::new();
        let gate = RangeGate::full();
        let _ = histogram.add_frame(counts, &gate);
        let live = LiveCounts::new(&histogram, &gate, &ExcludedBins::NONE, cycles, dead_time);
        let window = rule.detect_live(&live.unwrap(), None).window;
        window.map(|window| window.first)
    }
    [
        first::<Count10>(counts, cycles, dead_time, rule),
        first::<Count16>(counts, cycles, dead_time, rule),
        first::<Count24>(counts, cycles, dead_time, rule),
    ]
}

/// With a z of 0 a photon more than anywhere else is enough.
#[test]
fn any_excess_is_above_no_threshold() {
    let mut counts = [1000; 64];
    counts[30] = 1001;
    let rule = WindowRule::new(1, U4F12::ZERO, Count::saturating(1)).unwrap();
    assert_eq!(reported(&counts, 1 << 20, 1, &rule), [Some(30); 3]);
}

/// Far from each other, or around the same photons.
#[test]
fn the_last_of_windows_with_equal_light_is_reported() {
    for photons in 20..=200 {
        let mut counts = [0; 64];
        for bin in [20, 40, 50] {
            counts[bin] = photons;
        }
        for width in 1..=5 {
            let rule = WindowRule::new(width, U4F12::lit("2"), Count::saturating(1)).unwrap();
            let firsts = reported(&counts, 1000, 4, &rule);
            assert_eq!(firsts, [Some(50); 3], "{photons} {width}");
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

/// Photons of an exposure: with a bin behind which the TDC is live in hardly a laser cycle, with two bright bins, or neither.
fn blinding(rng: &mut Pcg32, dead_time: usize, cycles: u32) -> [u32; 64] {
    let mut counts = drawn::<64>(rng, dead_time, cycles);
    let code = rng.next_u32() >> 8;
    let first = code as usize % 50;
    let mut shine = |bin: usize, photons: &dyn Fn(u32) -> u32| {
        let before: u32 = counts[bin.saturating_sub(dead_time)..bin].iter().sum();
        counts[bin] = photons(cycles - before);
        let blind = bin + 1..(bin + 1 + dead_time).min(64);
        counts[blind].fill(0);
    };
    match code % 3 {
        0 => shine(first, &|live| live.saturating_sub(code % 7)),
        1 => {
            shine(first, &|live| live / 3);
            shine(first + 2 + (code >> 8) as usize % 8, &|live| live / 2);
        }
        _ => {}
    }
    counts
}

/// What [`check_detection`] has seen: clipped, not clipped, behind an echo, offsets other than the middle.
type Seen = [u32; 4];

/// Checks depth, flags and background of a detection after `echoes` by the formulas.
fn check_detection(
    found: &Detection,
    counts: &[u32; 64],
    config: &PixelConfig<64, WindowRule>,
    [guard, dead_time]: [u16; 2],
    cycles: u32,
    echoes: &[u16],
    seen: &mut Seen,
) {
    let gate = config.gate();
    let mut excluded = ExcludedBins::new(guard as u8);
    for &echo in echoes {
        excluded.push(BinIndex::saturating(echo));
    }
    let mut histogram = Histogram::<64, Count16>::new();
    let _ = histogram.add_frame(counts, &RangeGate::full());
    let weighed = LiveCounts::new(&histogram, gate, &excluded, cycles, dead_time).unwrap();
    let window = config.rule().detect_live(&weighed, None).window.unwrap();
    let peak = weighed.brightest(window.first, window.width);
    assert_eq!(found.peak, peak);
    let bins = (gate.first().into(), gate.last().into());
    let exposure = Exposure::new(counts, bins, &excluded, cycles, dead_time.into());
    assert!(exposure.has_most_light(window.first, window.width, peak.bin));
    let (count, peak) = (peak.count.raw(), peak.bin.raw());
    assert_eq!(count, counts[usize::from(peak)]);

    let live = |bin: u16| exposure.live[usize::from(bin)] as f64;
    let is_gated = |bin: &u16| (gate.first()..=gate.last()).contains(bin);
    let is_excluded = |bin: u16| echoes.iter().any(|echo| echo.abs_diff(bin) <= guard);
    let is_blind = |bin: u16| live(bin) * 1024.0 < f64::from(cycles);

    let outside = (
        f64::from(window.photons_outside),
        window.live_outside as f64,
    );
    if outside.1 > 0.0 {
        let background = outside.0 * live(peak) / outside.1;
        let rest = background - f64::from(found.background.raw());
        assert!((-0.5..0.5).contains(&rest), "{background} {found:?}");
    }

    let flags = found.depth.flags;
    let is_tail = echoes.iter().any(|echo| {
        let behind = i32::from(peak) - i32::from(echo + guard);
        (1..=i32::from(guard)).contains(&behind)
    });
    assert_eq!(flags.contains(Flags::TAIL), is_tail);
    let reach = config.estimator().reach();
    let mut around = (peak.saturating_sub(reach)..=peak + reach).filter(is_gated);
    let is_clipped = around.any(|bin| is_excluded(bin) || is_blind(bin));
    let at = f64::from(peak) + f64::from(found.depth.offset.raw()) / 256.0;
    let leaves_gate = match config.estimator() {
        DepthEstimator::Centroid3 => peak == gate.first() || peak == gate.last(),
        DepthEstimator::CentredWindow(window) => {
            let limits = [SubBinOffset::MIN, SubBinOffset::MAX];
            at - window.before().to_num::<f64>() < f64::from(gate.first())
                || at + window.after().to_num::<f64>() > f64::from(gate.last()) + 1.0
                || limits.contains(&found.depth.offset)
        }
    };
    let is_clipped = is_clipped || leaves_gate;
    assert_eq!(flags.contains(Flags::CLIPPED), is_clipped, "{found:?}");
    seen[0] += u32::from(is_clipped && !leaves_gate);
    seen[1] += u32::from(!is_clipped);
    seen[2] += u32::from(is_tail);

    if *config.estimator() != DepthEstimator::Centroid3 {
        return;
    }
    // A bin with a photon in each laser cycle counts as half a cycle short of that.
    let light = |photons: f64, live: f64| {
        let live = live.max(1.0);
        (live / (live - photons).max(0.5)).ln()
    };
    let above = |bin: u16| {
        if !is_gated(&bin) || is_excluded(bin) || is_blind(bin) {
            return 0.0;
        }
        let own = light(counts[usize::from(bin)].into(), live(bin));
        (own - light(outside.0, outside.1)).max(0.0)
    };
    let [left, centre, right] = [peak.wrapping_sub(1), peak, peak + 1].map(above);
    let sum = left + centre + right;
    let offset = if sum > 0.0 { (right - left) / sum } else { 0.0 };
    let middle = f64::from(found.depth.offset.raw()) / 256.0 - 0.5;
    // The offset is rounded to 1/256, and light to 1/1023 of the highest of 12 bins.
    let reached = (peak.saturating_sub(6)..peak + 6).map(above);
    let highest = reached.fold(0.0, f64::max);
    let rounding = 0.51 / 256.0 + 3.0 / 1023.0 * highest / sum.max(1e-9);
    assert!(
        (middle - offset).abs() < rounding,
        "{middle} {offset} {rounding}"
    );
    seen[3] += u32::from(offset != 0.0);
}

/// The first and the second echo, of three bins and of windows about the centre.
#[test]
fn detections_are_those_of_live_counts() {
    let mut rng = Pcg32::seed_from_u64(9);
    let mut seen = Seen::default();
    for trial in 0..20_000u32 {
        let mut below = |limit: u32| rng.next_u32() % limit;
        let cycles = 100 + below(3000);
        let (dead_time, guard) = (1 + below(20) as u16, below(4) as u16);
        let (first, last) = (below(24) as u16, 63 - below(16) as u16);
        let gate = RangeGate::new(first, last).unwrap();
        let width = 1 + below(5) as u8;
        let rule = WindowRule::new(width, U4F12::lit("4"), Count::saturating(5)).unwrap();
        let estimator = match trial % 3 {
            0 => {
                let half = U8F8::from_num(1.0 + f64::from(below(3)));
                DepthEstimator::CentredWindow(CentredWindow::new(half).unwrap())
            }
            _ => DepthEstimator::Centroid3,
        };
        let config = PixelConfig::<64, _>::with_rule(rule)
            .gate(gate)
            .estimator(estimator)
            .echoes(EchoNumber::new(2).unwrap(), guard as u8)
            .build()
            .unwrap()
            .with_dead_time(dead_time);
        let counts = blinding(&mut rng, dead_time.into(), cycles);
        let mut histogram = Histogram::<64, Count16>::new();
        let _ = histogram.add_frame(&counts, &RangeGate::full());
        let mut echoes = Vec::new();
        config.detect_echoes(&mut histogram, cycles, |_, found| {
            let known = [guard, dead_time];
            check_detection(found, &counts, &config, known, cycles, &echoes, &mut seen);
            echoes.push(found.peak.bin.raw());
        });
    }
    println!("{seen:?} of 20,000");
    assert!(seen.iter().all(|&seen| seen > 50), "{seen:?}");
}
