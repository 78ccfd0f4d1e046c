//! Counters of 8 bits beside those of 10: the same until one of them has lost a photon.

use dtof_core::binning::Block;
use dtof_core::fixed::types::U4F12;
use dtof_core::{
    AnyRule, AsyncPixel, Count, Count8, DepthEvent, Flags, LaserCycle, Look, PixelAddress,
    PixelConfig, PixelPlace, RangeGate, Statistics, WindowRule,
};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::echoes::{random_settings, settings};
use super::model::{Cycle, cycle, random_cycles};

type Config<const BINS: usize> = PixelConfig<BINS, AnyRule>;

/// What came of some runs.
#[derive(Debug, Default)]
struct Seen {
    events: u32,
    /// Events whose highest counter is full.
    full_peaks: u32,
    deferred: u32,
    expired: u32,
    tracked_or_echoes: u32,
    /// Runs in which a counter lost a photon, and exposures that ended there.
    lost: u32,
    ended_full: u64,
}

/// Runs both until a counter of 8 bits has lost a photon, and sees that this ends the exposure.
fn compare<const BINS: usize>(config: &Config<BINS>, cycles: &[Cycle], seen: &mut Seen) {
    let mut narrow = AsyncPixel::<BINS, Count8>::new(PixelAddress::new(77));
    let mut wide = AsyncPixel::<BINS>::new(PixelAddress::new(77));
    let [mut of_narrow, mut of_wide] = [Statistics::new(); 2];
    for (number, cycle) in (0..).zip(cycles) {
        for &(code, times) in &cycle.photons {
            let photons = vec![code; times.into()];
            narrow.count_batch(config, &photons);
            wide.count_batch(config, &photons);
        }
        let had_event = narrow.has_event();
        let has_lost = narrow.histogram().saturated() > 0;
        let cycle_number = LaserCycle::new(number);
        let look = narrow.end_laser_cycle(config, &mut of_narrow, cycle_number);
        if has_lost {
            // No event from it, and what is left of the exposure is until the next look.
            assert_ne!(look, Look::Event);
            assert!(!had_event || look != Look::NoPeak);
            if matches!(look, Look::Expired | Look::Ended) {
                assert_eq!((narrow.exposure(), narrow.histogram().total()), (0, 0));
                seen.lost += 1;
                seen.ended_full += of_narrow.ended_full;
                return;
            }
        } else {
            let other = wide.end_laser_cycle(config, &mut of_wide, cycle_number);
            assert_eq!(look, other, "laser cycle {number}");
            assert_eq!(of_narrow, of_wide, "laser cycle {number}");
            assert_eq!(narrow.exposure(), wide.exposure());
        }
        seen.deferred += u32::from(look == Look::Deferred);
        seen.expired += u32::from(look == Look::Expired);
        if cycle.acknowledge && !has_lost {
            let event = narrow.take_event();
            assert_eq!(event, wide.take_event(), "laser cycle {number}");
            if let Some(event) = event {
                seen.events += 1;
                seen.full_peaks += u32::from(event.peak_count.raw() == 255);
                seen.tracked_or_echoes += u32::from(event.echo.raw() > 1);
            }
        }
    }
}

/// Floods of so many photons that counters fill, are exactly full, and overflow.
fn flooded(mut cycles: Vec<Cycle>, rng: &mut Pcg32) -> Vec<Cycle> {
    for photons in cycles.iter_mut().flat_map(|cycle| &mut cycle.photons) {
        if photons.1 > 100 {
            photons.1 = [30, 90, 253, 254, 255, 256][rng.next_u32() as usize % 6];
        }
    }
    cycles
}

#[test]
fn eight_bits_decide_as_ten_until_a_counter_overflows() {
    let mut rng = Pcg32::seed_from_u64(1);
    let mut seen = Seen::default();
    for round in 0..3000 {
        let patience = 1 + rng.next_u32() % 30;
        if round % 2 == 0 {
            let config = random_settings(&mut rng, 16).config::<16>();
            let cycles = flooded(random_cycles(16, 800, patience, &mut rng), &mut rng);
            compare(&config, &cycles, &mut seen);
        } else {
            let config = random_settings(&mut rng, 64).config::<64>();
            let cycles = flooded(random_cycles(64, 800, patience, &mut rng), &mut rng);
            compare(&config, &cycles, &mut seen);
        }
    }
    println!("{seen:?}");
    assert!(seen.events > 10_000 && seen.full_peaks > 20, "{seen:?}");
    assert!(seen.deferred > 1000 && seen.expired > 1000, "{seen:?}");
    assert!(seen.tracked_or_echoes > 1000 && seen.lost > 100, "{seen:?}");
    assert!(seen.ended_full > 50, "{seen:?}");
}

/// The window rule, which weighs bins by their live laser cycles. Photons before the gate are few.
#[test]
fn with_a_dead_time_as_well() {
    let mut rng = Pcg32::seed_from_u64(2);
    let mut seen = Seen::default();
    let rule = WindowRule::new(3, U4F12::lit("4.2"), Count::saturating(5)).unwrap();
    for _ in 0..1000 {
        let config = PixelConfig::with_rule(rule.into())
            .gate(RangeGate::new(rng.next_u32() as u16 % 4, 60).unwrap())
            .l1(8)
            .l2(300)
            .dead_time(1 + rng.next_u32() as u16 % 20)
            .build()
            .unwrap();
        // At most one photon a laser cycle and bin, and floods that lose.
        let mut cycles = random_cycles(64, 1000, 3, &mut rng);
        for photons in cycles.iter_mut().flat_map(|cycle| &mut cycle.photons) {
            photons.1 = if photons.1 > 100 && photons.0 >= 4 {
                256
            } else {
                1
            };
        }
        compare::<64>(&config, &cycles, &mut seen);
    }
    println!("{seen:?}");
    assert!(seen.events > 1000 && seen.ended_full > 100, "{seen:?}");
}

proptest! {
    #[test]
    fn any_photons_decide_alike_until_a_counter_overflows(
        settings in settings(),
        cycles in prop::collection::vec(cycle(), 0..300),
    ) {
        compare(&settings.config::<32>(), &cycles, &mut Seen::default());
    }
}

/// All photons in one bin.
#[test]
fn a_counter_that_is_exactly_full_decides_and_one_that_overflows_ends_the_exposure() {
    let config = PixelConfig::<128>::paper().x(1).l1(3).build().unwrap();
    for (photons, expected) in [
        (255, Look::Event),
        (256, Look::Expired),
        (1000, Look::Expired),
    ] {
        let mut pixel = AsyncPixel::<128, Count8>::new(PixelAddress::new(1));
        let mut statistics = Statistics::new();
        pixel.count_batch(&config, &vec![60; photons]);
        let look = pixel.end_laser_cycles(&config, &mut statistics, LaserCycle::new(3), 4);
        assert_eq!(look, expected);
        let is_full = u64::from(photons > 255);
        assert_eq!(
            (statistics.ended_full, statistics.expired),
            (is_full, is_full)
        );
        assert_eq!(statistics.photons(), photons as u64);
        assert_eq!(statistics.saturated, photons.saturating_sub(255) as u64);
        assert_eq!((pixel.exposure(), pixel.histogram().total()), (0, 0));
        let event = pixel.take_event();
        assert_eq!(
            event.map(|event| event.flags),
            (photons == 255).then_some(Flags::NONE)
        );
    }
}

/// An event that waits is not lost, and the exposure goes on as it does for any deferred decision.
#[test]
fn a_full_exposure_is_deferred_while_an_event_waits() {
    let config = PixelConfig::<128>::paper()
        .x(1)
        .l1(3)
        .l2(40)
        .build()
        .unwrap();
    let mut pixel = AsyncPixel::<128, Count8>::new(PixelAddress::new(1));
    let mut statistics = Statistics::new();
    let mut look = |pixel: &mut AsyncPixel<128, Count8>, photons: usize| {
        pixel.count_batch(&config, &vec![60; photons]);
        pixel.end_laser_cycles(&config, &mut statistics, LaserCycle::new(3), 4)
    };
    assert_eq!(look(&mut pixel, 100), Look::Event);
    assert_eq!(look(&mut pixel, 300), Look::Deferred);
    assert_eq!(look(&mut pixel, 1), Look::Deferred);
    assert_eq!(
        pixel.take_event().map(|event| event.peak_count.raw()),
        Some(100)
    );
    assert_eq!(look(&mut pixel, 1), Look::Expired);
    assert_eq!(look(&mut pixel, 9), Look::Event);
    assert_eq!(
        (
            statistics.ended_full,
            statistics.expired,
            statistics.expired_deferred
        ),
        (1, 1, 1)
    );
    assert_eq!((statistics.events, statistics.deferred), (2, 2));
}

/// Counters of 10 bits saturate, decide all the same, and say so.
#[test]
fn wider_counters_stay_as_they_are() {
    let config = PixelConfig::<128>::paper().x(1).l1(3).build().unwrap();
    let mut pixel = AsyncPixel::<128>::new(PixelAddress::new(1));
    let mut statistics = Statistics::new();
    pixel.count_batch(&config, &[60; 1100]);
    let look = pixel.end_laser_cycles(&config, &mut statistics, LaserCycle::new(3), 4);
    assert_eq!((look, statistics.ended_full), (Look::Event, 0));
    let flags = pixel.take_event().map(|event| event.flags);
    assert_eq!(flags, Some(Flags::SATURATED));
}

#[test]
fn a_macropixel_of_128_bins_takes_192_bytes() {
    assert_eq!(size_of::<AsyncPixel<128, Count8>>(), 128 + 64);
    assert_eq!(size_of::<AsyncPixel<1024, Count8>>(), 1024 + 64);
    assert_eq!(size_of::<AsyncPixel<128>>(), 256 + 64);
    let statement = "macropixel of 128 bins takes 320 bytes, with 8-bit counters 192.";
    assert!(include_str!("../../../README.md").contains(statement));
    assert!(include_str!("../../README.md").contains(statement));
    // In an array that is driven, and for a block of pixels.
    assert_eq!(size_of::<PixelPlace<128>>(), 320 + 12);
    assert!(include_str!("../../README.md").contains("In an array it takes 12 more."));
    assert_eq!(size_of::<Block<128>>(), 320 + 4);
    assert_eq!(size_of::<DepthEvent>(), 28);
}
