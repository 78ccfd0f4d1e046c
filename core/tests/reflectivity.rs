//! Reflectivity against exact sums.

use dtof_core::fixed::types::I24F8;
use dtof_core::{
    BinIndex, Count, DepthEvent, Flags, LaserCycle, PixelAddress, Reflectivity, SubBinOffset,
};
use proptest::prelude::*;

fn event(peak: u32, background: u32, exposure: u16) -> DepthEvent {
    DepthEvent {
        pixel: PixelAddress(0),
        cycle: LaserCycle(0),
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
    let mut pixel = Reflectivity::new();
    assert_eq!(
        (
            pixel.of_events(I24F8::MAX),
            pixel.of_signal(I24F8::MAX).to_bits()
        ),
        (0, 0)
    );
    pixel.add(&event(9, 1, 0));
    assert_eq!((pixel.events(), pixel.signal().to_bits()), (1, 0));
}

#[test]
fn it_takes_the_memory_it_says() {
    assert_eq!(size_of::<Reflectivity>(), 24);
}

proptest! {
    #[test]
    fn both_are_what_they_are_defined_to_be(
        events in prop::collection::vec((0u32..=0xff_ffff, 0u32..=0xff_ffff, 0u16..), 0..50),
        range: i32,
    ) {
        let range = I24F8::from_bits(range);
        let mut pixel = Reflectivity::new();
        let (mut signal, mut exposure) = (0u128, 0u128);
        for &(peak, background, cycles) in &events {
            pixel.add(&event(peak, background, cycles));
            signal += u128::from(peak.saturating_sub(background));
            exposure += u128::from(cycles);
        }
        let rate = (signal << 16).checked_div(exposure).unwrap_or(0);
        prop_assert_eq!(u128::from(pixel.signal().to_bits()), rate);
        let millimetres = (u128::from(range.unsigned_abs().to_bits()) + 128) / 256;
        let limited = |value: u128| u64::try_from(value).unwrap_or(u64::MAX);
        let square = millimetres * millimetres;
        prop_assert_eq!(pixel.of_events(range), limited(events.len() as u128 * square));
        prop_assert_eq!(pixel.of_signal(range).to_bits(), limited(rate * square));
    }
}
