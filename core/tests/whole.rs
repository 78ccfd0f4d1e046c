//! Whole histograms: what lies outside of the gate, and counts that fit no counter.

use std::ops::Range;

use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{
    AnyRule, Count, Count8, Count24, CounterWidth, DepthEstimator, Detection, EchoNumber,
    Histogram, PaperRule, PixelConfig, RangeGate, Statistics, WholeHistogram, WindowRule,
};
use proptest::prelude::*;

const BINS: usize = 64;
type Config = PixelConfig<BINS, AnyRule>;

fn rule(width: u8) -> AnyRule {
    match width {
        0 => PaperRule::new(U8F8::lit("2"), Count::saturating(5)).into(),
        width => WindowRule::new(width, U4F12::lit("3"), Count::saturating(5))
            .unwrap()
            .into(),
    }
}

fn config(width: u8, gate: RangeGate<BINS>, echoes: u8, dead_time: u16) -> Config {
    let estimator = match width {
        0 => DepthEstimator::Centroid3,
        _ => DepthEstimator::for_pulse(U8F8::lit("1")),
    };
    PixelConfig::with_rule(rule(width))
        .gate(gate)
        .estimator(estimator)
        .echoes(EchoNumber::new(echoes).unwrap(), 3)
        .dead_time(dead_time)
        .build()
        .unwrap()
}

/// The echoes, and what the statistics say.
fn decide<W: CounterWidth>(
    config: &Config,
    counts: &[u32; BINS],
    cycles: u64,
) -> (Vec<Detection>, Statistics, WholeHistogram<BINS, W>) {
    let (mut whole, mut statistics) = (WholeHistogram::new(), Statistics::new());
    let mut echoes = Vec::new();
    whole.decide(config, counts, cycles, &mut statistics, |number, echo| {
        echoes.push(*echo);
        assert_eq!(usize::from(number.raw()), echoes.len());
    });
    let events = echoes.len() as u64;
    assert_eq!(
        (statistics.events, statistics.expired),
        (events, u64::from(events == 0))
    );
    let photons = |bins: Range<usize>| {
        counts[bins]
            .iter()
            .map(|&count| u64::from(count))
            .sum::<u64>()
    };
    let [first, end] = [config.gate().first(), config.gate().last() + 1].map(usize::from);
    assert_eq!(statistics.counted, photons(first..end));
    assert_eq!(statistics.photons(), photons(0..BINS));
    (echoes, statistics, whole)
}

/// The peaks of one gate, the highest first, and the highest bin.
fn peaks<W: CounterWidth>(
    config: &Config,
    counts: &[u32; BINS],
    cycles: u32,
) -> (Vec<Detection>, Option<u16>) {
    let mut histogram = Histogram::<BINS, W>::new();
    config.add_frame(&mut histogram, counts);
    let highest = (histogram.total() > 0).then_some(histogram.peak().bin.raw());
    let mut echoes = Vec::new();
    config.detect_echoes(&mut histogram, cycles, |_, echo| echoes.push(*echo));
    (echoes, highest)
}

/// The formula in floating point: the gate without the slopes of what lies outside, or none if nothing is left.
fn without_slopes(
    config: &Config,
    width: u16,
    counts: &[u32; BINS],
    cycles: u32,
) -> Option<Config> {
    let given = *config.gate();
    let mean = |bins: Range<u16>| {
        let photons = bins.clone().map(|bin| f64::from(counts[usize::from(bin)]));
        photons.sum::<f64>() / bins.len() as f64
    };
    let is_slope = |window: &Range<u16>, beside: Range<u16>, mut between: Range<u16>| {
        let level = mean(window.clone());
        let most = |bin: u16| {
            let count = f64::from(counts[usize::from(bin)]);
            count + 2.0 * count.sqrt()
        };
        mean(beside) >= level && between.all(|bin| most(bin) >= level)
    };
    let mut gate = given;
    loop {
        let config = config.with_gate(gate);
        let (echoes, highest) = peaks::<Count24>(&config, counts, cycles);
        let mut bins: Vec<u16> = echoes.iter().map(|echo| echo.peak.bin.raw()).collect();
        if bins.is_empty() {
            bins.extend(highest);
        }
        let (Some(&near), Some(&far)) = (bins.iter().min(), bins.iter().max()) else {
            return Some(config);
        };
        let window = |bin: u16| {
            bin.saturating_sub(width / 2).max(given.first())
                ..(bin + width / 2).min(given.last()) + 1
        };
        let (near, far) = (window(near), window(far));
        let behind = far.end..(far.end + width).min(BINS as u16);
        let left = if given.first() > 0
            && is_slope(
                &near,
                near.start.saturating_sub(width)..near.start,
                given.first() - 1..near.start,
            ) {
            (near.end, gate.last() + 1)
        } else if given.last() < BINS as u16 - 1
            && is_slope(&far, behind, far.end..given.last() + 2)
        {
            (gate.first(), far.start)
        } else {
            return Some(config);
        };
        gate = RangeGate::new(left.0, left.1.checked_sub(1)?).ok()?;
    }
}

/// Counts with a background, and pulses with tails.
fn scene() -> impl Strategy<Value = [u32; BINS]> {
    let pulse = (0..BINS, 0u32..400, 1u32..4, any::<bool>());
    let background = (0u32..40, prop::collection::vec(0u32..8, BINS));
    (background, prop::collection::vec(pulse, 0..4)).prop_map(|((level, noise), pulses)| {
        let mut counts: Vec<u32> = noise.iter().map(|more| level + more).collect();
        for (at, photons, fall, is_mirrored) in pulses {
            for (distance, bin) in (at..BINS).enumerate() {
                let bin = if is_mirrored { BINS - 1 - bin } else { bin };
                counts[bin] += photons >> (distance as u32 / fall).min(31);
            }
        }
        counts.try_into().unwrap()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn a_slope_of_what_lies_outside_is_no_echo(
        counts in scene(),
        width in 0u8..8,
        (first, bins) in (0u16..40, 8u16..64),
        echoes in 1u8..=4,
        dead_time in prop_oneof![3 => Just(0u16), 1 => 1u16..80],
    ) {
        let gate = RangeGate::new(first, (first + bins).min(BINS as u16) - 1).unwrap();
        let config = config(width, gate, echoes, dead_time);
        let cycles = 20_000;
        let (found, _, whole) = decide::<Count24>(&config, &counts, cycles.into());
        match without_slopes(&config, width.max(1).into(), &counts, cycles) {
            None => prop_assert!(found.is_empty()),
            Some(left) => {
                prop_assert_eq!(found, peaks::<Count24>(&left, &counts, cycles).0);
                prop_assert_eq!(whole.gate(), left.gate());
                let mut histogram = Histogram::<BINS, Count24>::new();
                left.add_frame(&mut histogram, &counts);
                let photons = whole.photons(&config, &counts);
                prop_assert_eq!(photons.counts(), histogram.counts());
                prop_assert_eq!(photons.total(), histogram.total());
                prop_assert_eq!(photons.peak(), histogram.peak());
                prop_assert_eq!(whole.cycles(), cycles);
            }
        }
    }

    /// Counts that do not fit are decided on as those that are divided by the least power of two.
    #[test]
    fn counts_that_do_not_fit_are_divided(
        counts in scene(), more in 0u32..24, width in 1u8..6, dead_time in prop::sample::select(vec![0u16, 20, 64]),
        cycles in prop_oneof![1u64..100_000, 0u64..1 << 59],
    ) {
        let counts = counts.map(|count| count << more);
        let config = config(width, RangeGate::full(), 2, dead_time);
        let weighs = dead_time > 0;
        let fits = |shift: u32| {
            let most = if weighs { 1 << 28 } else { u64::MAX };
            counts.iter().all(|&count| count >> shift < (1 << 8) - 1) && cycles >> shift <= most
        };
        let shift = (0..64).find(|&shift| fits(shift)).unwrap();
        let divided = counts.map(|count| count.checked_shr(shift).unwrap_or(0));
        let left = u32::try_from(cycles >> shift).unwrap_or(u32::MAX);
        let (found, statistics, whole) = decide::<Count8>(&config, &counts, cycles);
        prop_assert_eq!((found, whole.cycles()), (peaks::<Count8>(&config, &divided, left).0, left));
        // No counter is full, so that none of its photons is lost.
        prop_assert_eq!((statistics.saturated, statistics.ended_full), (0, 0));
        prop_assert_eq!(whole.photons(&config, &counts).saturated(), 0);
    }
}

#[test]
fn a_full_counter_no_longer_hides_a_target_behind_a_dead_time() {
    let config = config(3, RangeGate::full(), 1, 4);
    let mut counts = [30_000u32; BINS];
    for (bin, photons) in [(40, 2_000_000), (41, 20_000_000), (42, 2_000_000)] {
        counts[bin] = photons;
    }
    let (found, statistics, _) = decide::<Count24>(&config, &counts, 100_000_000);
    assert_eq!(found.len(), 1);
    assert_eq!((found[0].peak.bin.raw(), statistics.blind_looks), (41, 0));
    // The same by hand: half of all.
    let (half, ..) = decide::<Count24>(&config, &counts.map(|count| count / 2), 50_000_000);
    assert_eq!(found, half);
}

/// Behind the slope of what lies outside: a bin with surely fewer photons makes the pulse a surface. Their mean of
/// 106.7 is 87.9 and two standard deviations.
#[test]
fn a_gap_makes_it_a_surface() {
    let config = config(3, RangeGate::new(10, 63).unwrap(), 1, 0);
    for (gap, is_surface) in [(100, false), (88, false), (87, true), (0, true)] {
        let mut counts = [0u32; BINS];
        counts[7..11].fill(300);
        counts[11] = gap;
        counts[12..15].copy_from_slice(&[100, 120, 100]);
        let (found, _, whole) = decide::<Count24>(&config, &counts, 1000);
        assert_eq!(found.len(), usize::from(is_surface), "{gap}");
        assert!(!is_surface || whole.gate().first() == 12);
    }
}

/// Photons before the gate are no slope of a gate without photons: it stays as it is, and nothing is found.
#[test]
fn an_empty_gate_stays() {
    for (width, dead_time) in [(0, 0), (3, 0), (3, 1), (7, 0)] {
        let gate = RangeGate::new(10, 63).unwrap();
        let config = config(width, gate, 2, dead_time);
        let mut counts = [0u32; BINS];
        counts[..10].fill(300);
        let (found, statistics, whole) = decide::<Count24>(&config, &counts, 10_000);
        assert_eq!((found.len(), statistics.blind_looks), (0, 0));
        assert_eq!(*whole.gate(), gate);
        assert_eq!(whole.photons(&config, &counts).total(), 0);
    }
}

/// A fast laser: one photon in some millions of laser cycles is still a weight for the depth.
#[test]
fn few_photons_of_many_laser_cycles_have_their_depth() {
    let config = config(5, RangeGate::full(), 1, 20);
    for cycles in [1_000u64, 1_000_000, 80_000_000, 1 << 28] {
        let mut counts = [0u32; BINS];
        counts[40..43].copy_from_slice(&[10, 40, 30]);
        let (found, _, _) = decide::<Count24>(&config, &counts, cycles);
        assert_eq!(found.len(), 1);
        let place =
            256 * i32::from(found[0].peak.bin.raw()) + i32::from(found[0].depth.offset.raw());
        // The centroid of bins 40 to 42, and half a bin.
        let expected = 256 * 41 + 128 + 256 * (30 - 10) / 80;
        assert!(
            (place - expected).abs() <= 12,
            "{cycles}: {place}, {expected}"
        );
    }
}
