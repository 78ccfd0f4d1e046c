//! Dynamic depth against its definition, over whole sequences of events.

use dtof_core::events::{
    DynamicDepthConfig, DynamicDepthEvent, DynamicDepthPixel, Polarity, Reference,
    ZeroThresholdError,
};
use dtof_core::fixed::types::{I24F8, U16F16, U24F8};
use dtof_core::{
    BinIndex, BinPosition, BlockLevel, Count, DepthEvent, EchoNumber, Flags, LaserCycle,
    PixelAddress, RangeScale, SubBinOffset,
};
use proptest::prelude::*;

/// 250 ps bins, 37.474 mm each.
fn scale() -> RangeScale {
    RangeScale::new(U16F16::from_num(250), I24F8::ZERO).unwrap()
}

fn config(threshold_mm: f64, reference: Reference) -> DynamicDepthConfig {
    DynamicDepthConfig::new(U24F8::from_num(threshold_mm), &scale(), reference).unwrap()
}

/// An event at `position`, in 1/256 bins.
fn event(cycle: u64, position: i32) -> DepthEvent {
    let bin = (position.max(0) >> 8).min(1023);
    DepthEvent {
        pixel: PixelAddress::new(7),
        level: BlockLevel::PIXEL,
        echo: EchoNumber::FIRST,
        cycle: LaserCycle::new(cycle),
        exposure: 44,
        peak_bin: BinIndex::new(bin.try_into().unwrap()).unwrap(),
        offset: SubBinOffset::new((position - (bin << 8)).try_into().unwrap()).unwrap(),
        peak_count: Count::saturating(9),
        background: Count::saturating(1),
        flags: flags_of(position),
    }
}

/// Now one, now another, now none.
fn flags_of(position: i32) -> Flags {
    let bits = [1, 2, 4, 0, 0, 0, 0][(position % 7).unsigned_abs() as usize];
    Flags::from_bits(bits).unwrap()
}

fn observe<const N: usize>(
    config: &DynamicDepthConfig,
    positions: &[i32],
) -> Vec<Option<DynamicDepthEvent>> {
    let mut pixel = DynamicDepthPixel::<N>::new();
    (0..)
        .zip(positions)
        .map(|(cycle, &position)| pixel.observe(config, &event(cycle, position)))
        .collect()
}

/// As the definition has it, in exact whole numbers: (index, N times the change).
fn defined(n: usize, threshold: u32, reference: Reference, positions: &[i32]) -> Vec<(usize, i64)> {
    let sums: Vec<i64> = positions
        .windows(n)
        .map(|window| window.iter().copied().map(i64::from).sum())
        .collect();
    let mut changes = Vec::new();
    let mut reported = sums.first().copied().unwrap_or(0);
    for (index, &sum) in sums.iter().enumerate().skip(1) {
        let against = match reference {
            Reference::Previous => sums[index - 1],
            Reference::Reported => reported,
        };
        if (sum - against).abs() > i64::from(threshold) * n as i64 {
            changes.push((index + n - 1, sum - against));
            reported = sum;
        }
    }
    changes
}

fn check<const N: usize>(threshold_mm: f64, reference: Reference, positions: &[i32]) {
    let config = config(threshold_mm, reference);
    let found: Vec<(usize, DynamicDepthEvent)> = observe::<N>(&config, positions)
        .into_iter()
        .enumerate()
        .filter_map(|(index, change)| Some((index, change?)))
        .collect();
    let defined = defined(N, config.threshold(), reference, positions);
    assert_eq!(found.len(), defined.len());
    for ((index, found), (at, change)) in found.iter().zip(defined) {
        assert_eq!(*index, at);
        assert_eq!(i64::from(found.change()), change / N as i64);
        let polarity = [Polarity::Farther, Polarity::Nearer][usize::from(change < 0)];
        assert_eq!(found.polarity(), polarity);
        assert_eq!((found.pixel.raw(), found.cycle.raw()), (7, at as u64));
        let of_mean = positions[at.saturating_sub(N)..=at].iter();
        let flags = of_mean.fold(Flags::NONE, |flags, &position| flags | flags_of(position));
        assert_eq!(found.flags, flags);
        let last = positions[at + 1 - N..=at].iter();
        let sum: i64 = last.copied().map(i64::from).sum();
        let mean = (2 * sum + N as i64).div_euclid(2 * N as i64);
        assert_eq!(i64::from(found.position.raw()), mean);
    }
}

#[test]
fn a_wall_is_silent_and_a_step_is_reported_once_an_event_until_the_mean_has_followed() {
    for reference in [Reference::Previous, Reference::Reported] {
        let config = config(100.0, reference);
        let wall = vec![20 * 256; 50];
        assert!(observe::<3>(&config, &wall).iter().all(Option::is_none));
        // 12 bins, 450 mm: three times a third of it.
        let mut step = wall.clone();
        step.extend([32 * 256; 50]);
        let changes = observe::<3>(&config, &step);
        let at: Vec<usize> = (0..100).filter(|&index| changes[index].is_some()).collect();
        assert_eq!(at, [50, 51, 52]);
        let mut changes = changes.iter().flatten();
        assert!(changes.all(|change| change.change() == 4 * 256));
    }
}

#[test]
fn slow_motion_is_seen_against_what_was_reported_alone() {
    // A quarter bin, 9.4 mm, an event: a threshold of 100 mm every eleven events.
    let slow: Vec<i32> = (0..200).map(|index| 10 * 256 + index * 64).collect();
    let changes = |reference| {
        let changes = observe::<3>(&config(100.0, reference), &slow);
        changes.iter().flatten().count()
    };
    assert_eq!(changes(Reference::Previous), 0);
    assert_eq!(changes(Reference::Reported), (200 - 3) / 11);
}

#[test]
fn the_threshold_is_strict_and_rounded_to_the_nearest_step() {
    // 100 mm are 683.13 steps of 1/256 bin.
    assert_eq!(config(100.0, Reference::Previous).threshold(), 683);
    for (step, seen) in [(683, false), (684, true)] {
        let changes = observe::<1>(&config(100.0, Reference::Previous), &[5000, 5000 + step]);
        assert_eq!(changes[1].is_some(), seen);
    }
    let zero = DynamicDepthConfig::new(U24F8::from_num(0.05), &scale(), Reference::Previous);
    assert_eq!(zero, Err(ZeroThresholdError));
    // More than any two positions are apart: never.
    let never = config(16_777_215.0, Reference::Reported);
    let changes = observe::<1>(&never, &[-512, 262_399]);
    assert!(changes.iter().all(Option::is_none));
}

#[test]
fn a_change_is_not_zero_and_no_more_than_two_positions_can_be_apart() {
    let position = BinPosition::MIN;
    let new = |change| {
        let (pixel, level) = (PixelAddress::new(1), BlockLevel::PIXEL);
        DynamicDepthEvent::new(
            pixel,
            level,
            LaserCycle::new(2),
            position,
            change,
            Flags::NONE,
        )
    };
    let most = 1023 * 256 + 511 + 512;
    for change in [1, 2, most - 1, most] {
        let (nearer, farther) = (new(-change).unwrap(), new(change).unwrap());
        assert_eq!((nearer.change(), farther.change()), (-change, change));
        let polarities = (nearer.polarity(), farther.polarity());
        assert_eq!(polarities, (Polarity::Nearer, Polarity::Farther));
    }
    for change in [0, most + 1, -most - 1, i32::MAX, i32::MIN] {
        assert_eq!(new(change), None);
    }
}

#[test]
fn it_takes_the_memory_it_says() {
    assert_eq!(size_of::<DynamicDepthPixel<3>>(), 24);
    assert_eq!(size_of::<DynamicDepthPixel<10>>(), 60);
}

fn positions() -> impl Strategy<Value = Vec<i32>> {
    let any = -512i32..=262_399;
    let near = 10_000i32..14_000;
    prop::collection::vec(prop_oneof![1 => any, 4 => near], 0..80)
}

proptest! {
    #[test]
    fn it_is_what_it_is_defined_to_be(
        positions in positions(),
        threshold_mm in 0.1f64..2000.0,
        reported: bool,
    ) {
        let reference = if reported { Reference::Reported } else { Reference::Previous };
        check::<1>(threshold_mm, reference, &positions);
        check::<3>(threshold_mm, reference, &positions);
        check::<10>(threshold_mm, reference, &positions);
    }

    #[test]
    fn a_distance_in_bins_is_that_of_the_range(distance in 0u32.., width in 1u32..) {
        let Ok(scale) = RangeScale::new(U16F16::from_bits(width), I24F8::ZERO) else {
            return Ok(());
        };
        let distance = U24F8::from_bits(distance);
        let bins: f64 = distance.to_num::<f64>()
            / (f64::from(width) / 65536.0 * 0.149_896_229) * 256.0;
        let found = scale.bins_of(distance) as f64;
        // A bin is known to half of 1/65536 mm.
        let error = 0.5 + bins / (f64::from(width) * 0.149_896_229) * 0.51;
        prop_assert!((found - bins).abs() <= error, "{found} {bins} {error}");
        // And back, as far as the format goes.
        if let Ok(steps) = i32::try_from(scale.bins_of(distance)) {
            let back = scale.distance(steps).to_num::<f64>();
            let step = f64::from(width) / 65536.0 * 0.149_896_229 / 256.0;
            let error = step / 2.0 + 1.0 / 256.0 + distance.to_num::<f64>() * 1e-9;
            prop_assert!((back - distance.to_num::<f64>()).abs() <= error + step, "{back} {distance}");
            let opposite = scale.distance(-steps).to_num::<f64>();
            prop_assert!((back + opposite).abs() <= 1.0 / 256.0);
        }
    }
}
