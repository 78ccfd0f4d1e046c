//! Reflectivity against exact sums.

use dtof_core::events::Reflectivity;
use dtof_core::fixed::types::{I24F8, U4F12, U8F8};
use dtof_core::{
    AsyncPixel, BinIndex, BlockLevel, Count, DepthEvent, DetectionRule, EchoNumber, Flags,
    LaserCycle, PaperRule, PixelAddress, PixelConfig, Statistics, SubBinOffset, WindowRule,
};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

fn event(peak: u32, background: u32, exposure: u16) -> DepthEvent {
    DepthEvent {
        pixel: PixelAddress::new(0),
        level: BlockLevel::PIXEL,
        echo: EchoNumber::FIRST,
        cycle: LaserCycle::new(0),
        exposure,
        peak_bin: BinIndex::saturating(4),
        offset: SubBinOffset::CENTRE,
        peak_count: Count::saturating(peak),
        background: Count::saturating(background),
        flags: Flags::NONE,
    }
}

#[test]
fn no_event_and_events_without_exposure_are_dark() {
    let mut reflectivity = Reflectivity::new();
    assert_eq!(reflectivity.of_events(I24F8::MAX), 0);
    assert_eq!(reflectivity.of_signal(I24F8::MAX).to_bits(), 0);
    reflectivity.add(&event(9, 1, 0));
    assert_eq!(
        (reflectivity.events(), reflectivity.signal().to_bits()),
        (1, 0)
    );
}

#[test]
fn the_size_is_as_documented() {
    assert_eq!(size_of::<Reflectivity>(), 24);
}

proptest! {
    #[test]
    fn both_measures_follow_their_definitions(
        events in prop::collection::vec((0u32..=0xff_ffff, 0u32..=0xff_ffff, 0u16..), 0..50),
        range: i32,
    ) {
        let range = I24F8::from_bits(range);
        let mut reflectivity = Reflectivity::new();
        let (mut signal, mut exposure) = (0u128, 0u128);
        for &(peak, background, cycles) in &events {
            reflectivity.add(&event(peak, background, cycles));
            signal += u128::from(peak.saturating_sub(background));
            exposure += u128::from(cycles);
        }
        let rate = (signal << 16).checked_div(exposure).unwrap_or(0);
        prop_assert_eq!(u128::from(reflectivity.signal().to_bits()), rate);
        let millimetres = (u128::from(range.unsigned_abs().to_bits()) + 128) / 256;
        let limited = |value: u128| u64::try_from(value).unwrap_or(u64::MAX);
        let square = millimetres * millimetres;
        prop_assert_eq!(reflectivity.of_events(range), limited(events.len() as u128 * square));
        prop_assert_eq!(reflectivity.of_signal(range).to_bits(), limited(rate * square));
    }
}

/// A Poisson number of this mean, by Knuth's algorithm: products of uniform numbers.
fn photons(rng: &mut Pcg32, mean: f64) -> u32 {
    let (limit, mut product, mut count) = (libm::exp(-mean), 1.0, 0);
    loop {
        product *= f64::from(rng.next_u32()) / 4_294_967_296.0;
        if product < limit {
            return count;
        }
        count += 1;
    }
}

/// The measured signal divided by the simulated one, which lies in one bin.
fn measured_share<R: DetectionRule>(rule: R, signal: f64) -> f64 {
    let config = PixelConfig::with_rule(rule).build().unwrap();
    let mut rng = Pcg32::seed_from_u64(1);
    let mut pixel = AsyncPixel::<128>::new(PixelAddress::new(0));
    let mut statistics = Statistics::default();
    let mut reflectivity = Reflectivity::new();
    for cycle in 0..1_000_000 {
        for _ in 0..photons(&mut rng, 128.0 * 0.05) {
            pixel.count(&config, (rng.next_u32() % 128) as u16);
        }
        for _ in 0..photons(&mut rng, signal) {
            pixel.count(&config, 60);
        }
        pixel.end_laser_cycle(&config, &mut statistics, LaserCycle::new(cycle));
        if let Some(event) = pixel.take_event() {
            reflectivity.add(&event);
        }
    }
    assert!(reflectivity.events() > 200, "{}", reflectivity.events());
    reflectivity.signal().to_num::<f64>() / signal
}

#[test]
fn the_papers_background_makes_dim_pixels_dimmer_and_the_mean_does_not() {
    let paper = PaperRule::new(U8F8::lit("4"), Count::saturating(5));
    let window = WindowRule::new(3, U4F12::lit("4.5"), Count::saturating(5)).unwrap();
    for (signal, low, high) in [(0.05, 0.66, 0.76), (0.5, 0.84, 0.9), (2.0, 0.95, 0.99)] {
        let maximum = measured_share(paper, signal);
        assert!((low..=high).contains(&maximum), "{signal}: {maximum}");
        let mean = measured_share(window, signal);
        assert!((0.97..=1.05).contains(&mean), "{signal}: {mean}");
    }
}

#[test]
fn the_ratio_stays_at_the_limit() {
    let mut reflectivity = Reflectivity::new();
    for _ in 0..1 << 25 {
        reflectivity.add(&event(0xff_ffff, 0, 1));
    }
    assert_eq!(reflectivity.signal(), 0xff_ffff);
    // The sum of photons ends at 2^48 - 1.
    reflectivity.add(&event(1, 0, 1));
    assert_eq!(reflectivity.signal(), 0xff_ffff);
}
