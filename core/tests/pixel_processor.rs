//! The settings of the pixel processor, and what its events mean.

use dtof_core::fixed::types::{U8F8, U24F8};
use dtof_core::paper::centroid;
use dtof_core::pixel_processor::{ProcessorError, ProcessorEvent, ProcessorSettings};
use dtof_core::rule::Tracking;
use dtof_core::{
    AerEncoder, AerWord, BinIndex, BlockLevel, Count, DepthEstimator, DepthEvent, EchoNumber,
    Flags, Histogram, LaserCycle, PaperRule, PixelAddress, PixelConfig, RangeGate,
};
use proptest::prelude::*;

#[test]
fn settings_are_where_the_registers_have_them() {
    let rule = PaperRule::new(U8F8::lit("2.5"), Count::saturating(1023));
    let config = PixelConfig::with_rule(rule)
        .x(3)
        .l1(0x1234)
        .l2(0xfedc)
        .gate(RangeGate::new(10, 125).unwrap())
        .dead_time(u16::MAX)
        .build()
        .unwrap();
    let registers = ProcessorSettings::of(&config).unwrap().registers();
    // 116 bins from 10 on: quadrants of 29.
    let gate = 97 << 24 | 68 << 16 | 39 << 8 | 10;
    assert_eq!(
        registers,
        [0x1234_0003, 0x0001_fedc, 0x03ff_0280, gate, 126]
    );
    let whole = PixelConfig::paper().build().unwrap();
    let registers = ProcessorSettings::of(&whole).unwrap().registers();
    // As `docs/softcore.md` has them.
    let told = [0x0028_0004, 0x07d0, 0x0005_0400, 0x6040_2000, 0x80];
    assert_eq!(registers, told);
}

#[test]
fn what_the_hardware_cannot_do_is_refused() {
    let refused = |config: PixelConfig<128>| ProcessorSettings::of(&config).unwrap_err();
    let paper = PixelConfig::<128>::paper;
    let echoes = paper().echoes(EchoNumber::LAST, 2).build().unwrap();
    assert_eq!(refused(echoes), ProcessorError::Echoes);
    let estimator = DepthEstimator::for_pulse(U8F8::lit("1"));
    let window = paper().estimator(estimator).build().unwrap();
    assert_eq!(refused(window), ProcessorError::Estimator);
    let rule = *paper().build().unwrap().rule();
    let tracking = Tracking::new(rule, rule, 1);
    let tracks = paper().tracking(Some(tracking)).build().unwrap();
    assert_eq!(refused(tracks), ProcessorError::Tracking);
    let rule = PaperRule::new(U8F8::ONE, Count::saturating(1024));
    let high = PixelConfig::with_rule(rule).build().unwrap();
    assert_eq!(refused(high), ProcessorError::MinimumCount);
    assert!(ProcessorError::MinimumCount.to_string().contains("1023"));
}

/// The seven registers of an event, from the bits of the register table.
fn registers(event: &DepthEvent, left: u32, right: u32) -> [u32; 7] {
    let low = |number: u64| u32::try_from(number & 0xffff_ffff).unwrap();
    let cycle = event.cycle.raw();
    let background = event.background.raw();
    [
        u32::from(event.exposure) << 16 | u32::from(event.pixel.raw()),
        1 << 30 | u32::from(event.peak_bin.raw()) << 20 | low(cycle & 0xffff),
        (background & 0xff) << 24 | event.peak_count.raw(),
        u32::from(event.flags.bits()) << 26 | background >> 8,
        right << 16 | left,
        low(cycle >> 16),
        low(cycle >> 48),
    ]
}

proptest! {
    #[test]
    fn an_event_is_what_the_centroid_makes_of_its_bins(
        (peak, left, right) in (1u32..1024).prop_flat_map(|peak| (Just(peak), 0..=peak, 0..=peak)),
        background in 0u32..1024,
        bin in 1u16..127,
        (pixel, exposure, cycle) in (any::<u16>(), any::<u16>(), any::<u64>()),
        flags in 0u8..32,
    ) {
        let mut counts = [0u32; 128];
        counts[usize::from(bin) - 1] = left;
        counts[usize::from(bin)] = peak;
        counts[usize::from(bin) + 1] = right;
        let gate = RangeGate::full();
        let mut histogram = Histogram::<128>::new();
        histogram.add_frame(&counts, &gate);
        let highest = dtof_core::Peak {
            bin: BinIndex::saturating(bin),
            count: Count::saturating(peak),
        };
        let depth = centroid(&histogram, &gate, highest, U24F8::from_bits(background << 8));
        let event = DepthEvent {
            pixel: PixelAddress::new(pixel),
            level: BlockLevel::PIXEL,
            echo: EchoNumber::FIRST,
            cycle: LaserCycle::new(cycle),
            exposure,
            peak_bin: highest.bin,
            offset: depth.offset,
            peak_count: highest.count,
            background: Count::saturating(background),
            flags: Flags::from_bits(flags).unwrap(),
        };
        let read = ProcessorEvent::from_registers(registers(&event, left, right));
        prop_assert_eq!(read.depth_event(), Ok(event));
        prop_assert_eq!(read.word(), AerWord::depth_event(&event));
        let (mut one, mut other) = (AerEncoder::new(), AerEncoder::new());
        prop_assert_eq!(read.encode(&mut one), other.encode(&event));
        prop_assert_eq!(read.encode(&mut one), other.encode(&event));
    }
}
