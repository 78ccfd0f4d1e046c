//! The average rule decides as Eq. 5 has it, in exact numbers.

use dtof_core::fixed::types::{U8F8, U24F8};
use dtof_core::paper::centroid;
use dtof_core::rule::{ExcludedBins, detect};
use dtof_core::{
    AverageRule, BinPosition, Count, Count10, Count16, Count24, CounterWidth, DepthEstimator,
    DetectionRule, Histogram, RangeGate,
};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// `peak > T/B + α·√(T/B)` in whole numbers that cannot overflow, and the mean in 1/256
/// rounded down. Of the bins `left_out` do not count.
pub fn as_written<const BINS: usize, W: CounterWidth>(
    rule: &AverageRule,
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    left_out: usize,
) -> Option<U24F8> {
    let gated = gate.first()..=gate.last();
    let counts = gated
        .clone()
        .map(|bin| histogram.count(bin.into()).unwrap());
    let (bins, total) = (
        (gated.len() - left_out) as u128,
        counts.clone().map(u128::from).sum::<u128>(),
    );
    let peak = u128::from(counts.max().unwrap());
    let alpha = u128::from(rule.threshold().alpha().to_bits());
    // Both sides times 256, squared.
    let above = (bins * peak).saturating_sub(total);
    let clear = (256 * above).pow(2) > alpha.pow(2) * bins * total;
    // As Eq. 5 is printed, where the real numbers are clear.
    let mean = total as f64 / bins as f64;
    let level = mean + alpha as f64 / 256.0 * mean.sqrt();
    assert!((peak as f64 - level).abs() < 1e-9 * level || clear == (peak as f64 > level));
    let fires = clear && peak >= u128::from(rule.threshold().minimum_count().raw());
    fires.then(|| U24F8::from_bits((total * 256 / bins) as u32))
}

/// Random histograms with a peak that stands more or less clear: both answers, often.
fn check<const BINS: usize, W: CounterWidth>(rounds: u32, seed: u64) {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut fired = 0;
    for round in 0..rounds {
        let (gate, histogram, most) = super::rules::histogram::<BINS, W>(&mut rng, round);
        let alpha = U8F8::from_bits(rng.next_u32() as u16 >> (rng.next_u32() % 16));
        let minimum = rng.next_u32() % (2 * most) * (round % 2);
        let rule = AverageRule::new(alpha, Count::saturating(minimum));
        let expected = as_written(&rule, &histogram, &gate, 0);
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
}

/// Every count of the highest bin around the threshold, for every number of other photons
/// up to 200 and the ends of α.
#[test]
fn every_threshold_of_eight_bins_is_exact() {
    let gate = RangeGate::full();
    for alpha in [0, 1, 819, 1024, 2048, u16::MAX] {
        let rule = AverageRule::new(U8F8::from_bits(alpha), Count::saturating(0));
        for rest in 0..200u32 {
            for peak in rest.div_ceil(7)..=(rest + 60).min(1023) {
                // The rest lies in the other bins as evenly as it can.
                let frame: [u32; 8] = core::array::from_fn(|bin| match bin as u32 {
                    0 => peak,
                    bin => (rest + bin - 1) / 7,
                });
                let mut histogram = Histogram::<8>::new();
                histogram.add_frame(&frame, &gate);
                let expected = as_written(&rule, &histogram, &gate, 0);
                assert_eq!(
                    rule.detect(&histogram, &gate, histogram.peak(), &ExcludedBins::NONE),
                    expected
                );
            }
        }
    }
}

#[test]
fn the_widest_counters_do_not_overflow() {
    let gate = RangeGate::full();
    let largest = Count24::MAX;
    for others in [0, 1, largest / 2, largest - 1, largest] {
        let mut frame = [others; 256];
        frame[9] = largest;
        let mut histogram = Histogram::<256, Count24>::new();
        histogram.add_frame(&frame, &gate);
        for alpha in [0, 1, 256, u16::MAX] {
            let rule = AverageRule::new(U8F8::from_bits(alpha), Count::saturating(1));
            let expected = as_written(&rule, &histogram, &gate, 0);
            assert_eq!(
                rule.detect(&histogram, &gate, histogram.peak(), &ExcludedBins::NONE),
                expected
            );
        }
    }
}

/// A pulse of 0.33 bins without background, in every 64th of a bin, and so many photons that
/// none of it is noise: how far off the centroid is with the rule's background, and with none.
#[test]
fn the_pulse_in_the_average_moves_the_centroid() {
    let share = |from: f64| 0.5 * (1.0 + libm::erf(from / 0.33 / 2f64.sqrt()));
    let mut worst = [0.0_f64; 2];
    for place in 0..64 {
        let place = 4.0 + f64::from(place) / 64.0;
        let frame: [u32; 8] = core::array::from_fn(|bin| {
            let part = share((bin + 1) as f64 - place) - share(bin as f64 - place);
            (1e6 * part.max(0.0)) as u32
        });
        let mut histogram = Histogram::<8, Count24>::new();
        histogram.add_frame(&frame, &RangeGate::full());
        let rule = AverageRule::new(U8F8::lit("4"), Count::saturating(5));
        let found = detect(
            &histogram,
            &RangeGate::full(),
            &rule,
            &DepthEstimator::default(),
        );
        let none = centroid(
            &histogram,
            &RangeGate::full(),
            histogram.peak(),
            U24F8::ZERO,
        );
        let peak = found.unwrap().peak.bin;
        let positions = [
            found.unwrap().position(),
            BinPosition::of(peak, none.offset),
        ];
        for (worst, position) in worst.iter_mut().zip(positions) {
            *worst = worst.max((f64::from(position.raw()) / 256.0 - place).abs());
        }
    }
    assert!((0.11..0.13).contains(&worst[0]), "{worst:?}");
    assert!((0.02..0.04).contains(&worst[1]), "{worst:?}");
}

#[test]
fn an_empty_histogram_is_no_detection() {
    let rule = AverageRule::new(U8F8::ZERO, Count::default());
    let (empty, estimator) = (Histogram::<8>::new(), DepthEstimator::default());
    assert!(detect(&empty, &RangeGate::full(), &rule, &estimator).is_none());
}

proptest! {
    /// One photon more in the peak never takes a detection away; one more elsewhere never
    /// makes one.
    #[test]
    fn it_rises_with_the_peak_and_falls_with_the_rest(
        frame in proptest::array::uniform8(0u32..40), alpha in 0u16..2048, bin in 0usize..8,
    ) {
        let rule = AverageRule::new(U8F8::from_bits(alpha), Count::saturating(3));
        let gate = RangeGate::full();
        let fires = |frame: &[u32; 8]| {
            let mut histogram = Histogram::<8>::new();
            histogram.add_frame(frame, &gate);
            rule.detect(&histogram, &gate, histogram.peak(), &ExcludedBins::NONE).is_some()
        };
        let highest = *frame.iter().max().unwrap();
        let peak = frame.iter().position(|&count| count == highest).unwrap();
        let before = fires(&frame);
        let mut more = frame;
        more[bin] += 1;
        let after = fires(&more);
        if bin == peak {
            prop_assert!(after || !before);
        } else if frame[bin] < highest {
            prop_assert!(before || !after);
        }
    }
}
