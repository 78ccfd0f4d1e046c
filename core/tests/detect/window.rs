//! The window rule decides as it is written, whatever the counts, and as seldom without
//! a target as it says.

use dtof_core::fixed::types::{U4F12, U8F8, U24F8};
use dtof_core::rule::{ExcludedBins, detect};
use dtof_core::{
    BinIndex, Count, Count10, Count16, Count24, CounterWidth, DepthEstimator, DetectionRule,
    Histogram, RangeGate, WindowRule, WindowWidthError,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use crate::common::{parallel, window as window_formula};

/// The most photons of all gated windows of `width` bins that hold the bin `peak`, the
/// photons outside it, and how many bins these are in, of which `left_out` do not count.
fn window<const BINS: usize, W: CounterWidth>(
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    width: usize,
    peak: BinIndex,
    left_out: usize,
) -> (u64, u64, u64) {
    let counts: Vec<u64> = (gate.first()..=gate.last())
        .map(|bin| histogram.count(bin.into()).unwrap().into())
        .collect();
    let peak = usize::from(peak.raw() - gate.first());
    let most = (0..=counts.len() - width)
        .filter(|&start| (start..start + width).contains(&peak))
        .map(|start| counts[start..start + width].iter().sum())
        .max();
    let (most, all): (u64, u64) = (most.unwrap(), counts.iter().sum());
    (most, all - most, (counts.len() - left_out - width) as u64)
}

/// The background in 1/256 of a detection, the rule in whole numbers that cannot
/// overflow, and checked against the rule in real ones.
pub fn as_written<const BINS: usize, W: CounterWidth>(
    rule: &WindowRule,
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    peak: BinIndex,
    left_out: usize,
) -> Option<U24F8> {
    let width = rule.width();
    let (inside, outside, bins) = window(histogram, gate, width.into(), peak, left_out);
    // 1/4096 squared; z²/6 and z²/36·B² from 1/16, and z² in 1/256, rounded down.
    let z_squared = i128::from(rule.z().to_bits()).pow(2);
    let (skew, sixteenths) = ((z_squared / 6) >> 20, z_squared >> 20);
    let z_squared = z_squared >> 16;
    let (s, r, n, w) = (
        i128::from(inside),
        i128::from(outside),
        i128::from(bins),
        i128::from(width),
    );
    let above = 16 * (n * s - w * r) - (n - w).max(0) * skew;
    // N/(N + c) of the upper 16 bits, in 1/2¹⁶ and rounded down.
    let spread = n * w * (s + r);
    let small = (n + w).pow(2) * sixteenths / (36 * 16);
    let sum = spread + small;
    let shift = (0..).find(|&shift| sum >> shift < 1 << 16).unwrap();
    let part = ((spread >> shift) << 16).checked_div(sum >> shift);
    // Rounded, that may be below N - c, which N²/(N + c) never is.
    let sixteenths = ((spread * part.unwrap_or(0)) >> 12).max((spread - small) << 4);
    let clear = above > 0 && 16 * above.pow(2) > z_squared * sixteenths;

    let z = rule.z().to_num();
    let (all, width) = (inside + outside, u64::from(width));
    if let Some(exceeds) = window_formula::exceeds(inside, all, width, bins + width, z) {
        assert_eq!(clear, exceeds, "{inside} of {all}");
    }
    let fires = clear && inside >= u64::from(rule.minimum_count().raw());
    fires.then(|| U24F8::from_bits(((outside << 8) / bins) as u32))
}

/// Random histograms with a peak that stands more or less clear: both answers, often.
fn check<const BINS: usize, W: CounterWidth>(rounds: u32, seed: u64) {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut fired = 0;
    for round in 0..rounds {
        let (gate, histogram, most) = super::rules::histogram::<BINS, W>(&mut rng, round);
        let z = U4F12::from_bits(rng.next_u32() as u16 >> (rng.next_u32() % 16));
        let minimum = rng.next_u32() % (2 * most) * (round % 2);
        let width = 1 + (rng.next_u32() % 7) as u8;
        let rule = WindowRule::new(width, z, Count::saturating(minimum)).unwrap();
        // Without a photon there is no peak, nor a bin of one.
        let expected = (histogram.total() > 0)
            .then(|| as_written(&rule, &histogram, &gate, histogram.peak().bin, 0));
        let expected = expected.flatten();
        let fires = super::rules::gives(&rule, &histogram, &gate, expected);
        fired += u32::from(fires);
    }
    super::rules::both_often(fired, rounds);
}

#[test]
fn it_decides_as_it_is_written() {
    check::<8, Count10>(20_000, 1);
    check::<128, Count10>(5000, 2);
    check::<128, Count16>(5000, 3);
    check::<128, Count24>(5000, 4);
    check::<1024, Count10>(500, 5);
    check::<1024, Count16>(500, 6);
}

/// 10⁸ in all, most of them of few bins.
#[test]
#[ignore = "takes some minutes: `.ci/long proofs`"]
fn it_decides_as_it_is_written_a_hundred_million_times() {
    parallel::for_each(1000, |part| {
        let seed = 100 + 10 * part;
        check::<8, Count10>(40_000, seed);
        check::<16, Count16>(20_000, seed + 1);
        check::<32, Count24>(20_000, seed + 2);
        check::<64, Count10>(10_000, seed + 3);
        check::<128, Count10>(4000, seed + 4);
        check::<128, Count16>(3000, seed + 5);
        check::<128, Count24>(2500, seed + 6);
        check::<1024, Count16>(500, seed + 7);
    });
}

/// All bins full or empty but the window's, every width, the least and largest z.
#[test]
fn it_decides_as_it_is_written_at_the_extremes() {
    fn all<const BINS: usize, W: CounterWidth>() {
        let gates = [
            RangeGate::<BINS>::full(),
            RangeGate::new(0, 7).unwrap(),
            RangeGate::new(BINS as u16 - 8, BINS as u16 - 1).unwrap(),
        ];
        for gate in gates {
            for background in [0, 1, W::MAX / 2, W::MAX - 1, W::MAX] {
                for (bin, other) in [(0, 1), (7, 6), (BINS - 1, BINS - 2), (BINS / 2, 3)] {
                    for count in [1, W::MAX / 2 + 1, W::MAX] {
                        let mut counts = [background; BINS];
                        (counts[bin], counts[other]) = (count, count);
                        let mut histogram = Histogram::<BINS, W>::new();
                        histogram.add_frame(&counts, &gate);
                        for width in 1..=WindowRule::MAX_WIDTH {
                            for z in [0, 1, 17_613, u16::MAX] {
                                let z = U4F12::from_bits(z);
                                let rule = WindowRule::new(width, z, Count::default()).unwrap();
                                let found = rule.detect(
                                    &histogram,
                                    &gate,
                                    histogram.peak(),
                                    &ExcludedBins::NONE,
                                );
                                let bin = histogram.peak().bin;
                                let expected = (histogram.total() > 0)
                                    .then(|| as_written(&rule, &histogram, &gate, bin, 0));
                                assert_eq!(found, expected.flatten());
                            }
                        }
                    }
                }
            }
        }
    }
    all::<8, Count10>();
    all::<1024, Count10>();
    all::<1024, Count16>();
    all::<256, Count24>();
}

/// Of an even background and a peak of one bin: three counts on either side of where the answer
/// turns.
#[test]
fn it_decides_as_it_is_written_where_the_answer_turns() {
    fn all<const BINS: usize, W: CounterWidth>(rounds: u32) {
        let mut rng = Pcg32::seed_from_u64(BINS as u64 + u64::from(W::BITS));
        let gate = RangeGate::<BINS>::full();
        let mut turned = 0;
        for _ in 0..rounds {
            let background = rng.next_u32() % (W::MAX >> (1 + rng.next_u32() % (W::BITS - 1)));
            let z = U4F12::from_bits(rng.next_u32() as u16 >> (rng.next_u32() % 8));
            let width = 1 + (rng.next_u32() % 7) as u8;
            let rule = WindowRule::new(width, z, Count::default()).unwrap();
            let bin = (rng.next_u32() as usize) % BINS;
            let of = |count: u32| {
                let mut counts = [background; BINS];
                counts[bin] = count;
                let mut histogram = Histogram::<BINS, W>::new();
                histogram.add_frame(&counts, &gate);
                histogram
            };
            let peak = BinIndex::new(bin as u16).unwrap();
            let expected = |count| as_written(&rule, &of(count), &gate, peak, 0);
            let (mut low, mut high) = (background + 1, W::MAX);
            if expected(low).is_some() || expected(high).is_none() {
                continue;
            }
            while high - low > 1 {
                let middle = low.midpoint(high);
                *(if expected(middle).is_some() {
                    &mut high
                } else {
                    &mut low
                }) = middle;
            }
            for count in high.saturating_sub(3).max(background + 1)..=(high + 3).min(W::MAX) {
                let histogram = of(count);
                let found = rule.detect(&histogram, &gate, histogram.peak(), &ExcludedBins::NONE);
                assert_eq!(
                    found,
                    expected(count),
                    "{count} above {background}, {rule:?}"
                );
            }
            turned += 1;
        }
        assert!(turned > rounds / 2, "{turned} of {rounds}");
    }
    all::<8, Count10>(300);
    all::<8, Count24>(600);
    all::<128, Count10>(300);
    all::<128, Count24>(300);
    all::<1024, Count16>(30);
}

#[test]
fn only_windows_that_can_be_used() {
    for width in 0..=u8::MAX {
        let rule = WindowRule::new(width, U4F12::ONE, Count::saturating(9));
        if (1..=7).contains(&width) {
            let rule = rule.unwrap();
            let minimum = rule.minimum_count().raw();
            assert_eq!((rule.width(), rule.z(), minimum), (width, U4F12::ONE, 9));
        } else {
            assert_eq!(rule, Err(WindowWidthError));
            assert!(WindowWidthError.text().contains("1 to 7 bins"));
        }
    }
}

/// Whether so many photons in one of eight bins are a detection.
fn is_detected(photons: usize, width: u8, z: U4F12) -> bool {
    let rule = WindowRule::new(width, z, Count::default()).unwrap();
    let mut histogram = Histogram::<8>::new();
    histogram.add_batch(&vec![3; photons]);
    detect(
        &histogram,
        &RangeGate::full(),
        &rule,
        &DepthEstimator::default(),
    )
    .is_some()
}

#[test]
fn an_empty_histogram_is_no_detection() {
    for width in 1..=7 {
        assert!(!is_detected(0, width, U4F12::ZERO));
    }
}

#[test]
fn a_window_of_most_bins_needs_many_photons() {
    let z = U4F12::lit("4");
    assert!(!is_detected(107, 7, z) && is_detected(108, 7, z));
}

#[test]
fn the_width_suits_the_pulse() {
    for (sigma, width) in [
        ("0", 2),
        ("0.6", 2),
        ("0.61", 3),
        ("1", 3),
        ("1.25", 3),
        ("1.26", 5),
        ("1.5", 5),
        ("255", 5),
    ] {
        let sigma: U8F8 = sigma.parse().unwrap();
        assert_eq!(WindowRule::width_for_pulse(sigma), width, "{sigma}");
    }
}

/// What fires does so with any lower z, and with one more photon; a photon alone never does,
/// unless z is less than 2.5.
#[test]
fn more_photons_and_a_lower_z_never_undo_a_detection() {
    for last in 7..16 {
        let gate = RangeGate::<16>::new(0, last).unwrap();
        for width in 1..=7 {
            let mut before = [false; 256];
            for photons in 1..=150 {
                let mut histogram = Histogram::<16>::new();
                histogram.add_batch(&vec![3; photons]);
                let fires: [bool; 256] = std::array::from_fn(|z| {
                    let z = U4F12::from_bits((z as u16) << 8);
                    let rule = WindowRule::new(width, z, Count::default()).unwrap();
                    rule.detect(&histogram, &gate, histogram.peak(), &ExcludedBins::NONE)
                        .is_some()
                });
                assert!(fires.is_sorted_by(|lower, higher| lower >= higher));
                assert!(before.iter().zip(&fires).all(|(before, now)| before <= now));
                assert!(photons > 1 || !fires[40..].contains(&true));
                before = fires;
            }
        }
    }
}
