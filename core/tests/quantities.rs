//! Quantities, flags, errors and statistics: their limits, their text, and how they add up.

use dtof_core::events::ZeroThresholdError;
use dtof_core::fixed::types::{I24F8, U8F8, U16F16};
use dtof_core::{
    ArrayError, AsyncPixel, BinIndex, BinPosition, BlockLevel, CentredWindow, DepthEstimator,
    EchoNumber, Flags, GateError, Histogram, LaserCycle, Look, PixelAddress, PixelConfig,
    PixelConfigError, RangeGate, RangeScale, RangeScaleError, Statistics, SubBinOffset,
    WindowWidthError, checked,
};

#[test]
fn flags_have_six_bits_and_read_as_their_number() {
    for bits in 0..=u8::MAX {
        let flags = Flags::from_bits(bits);
        assert_eq!(flags.map(Flags::bits), (bits < 64).then_some(bits));
        if let Some(flags) = flags {
            assert_eq!(flags.to_string(), bits.to_string());
        }
    }
}

#[test]
fn every_error_names_what_is_wrong() {
    let texts = [
        (
            GateError::PastLastBin.text(),
            GateError::PastLastBin.to_string(),
            "past the last bin",
        ),
        (
            GateError::TooNarrow.text(),
            GateError::TooNarrow.to_string(),
            "fewer than 8 bins",
        ),
        (
            RangeScaleError::ZeroBinWidth.text(),
            RangeScaleError::ZeroBinWidth.to_string(),
            "the bin width is zero",
        ),
        (
            RangeScaleError::OutOfRange.text(),
            RangeScaleError::OutOfRange.to_string(),
            "reach beyond 8388 m",
        ),
        (
            WindowWidthError.text(),
            WindowWidthError.to_string(),
            "1 to 7 bins wide",
        ),
        (
            ZeroThresholdError.text(),
            ZeroThresholdError.to_string(),
            "less than 1/512 bin",
        ),
        (
            PixelConfigError::ZeroX.text(),
            PixelConfigError::ZeroX.to_string(),
            "X must be at least 1",
        ),
        (
            PixelConfigError::XAboveL1.text(),
            PixelConfigError::XAboveL1.to_string(),
            "X must not be greater than L1",
        ),
        (
            PixelConfigError::L2NotAboveL1.text(),
            PixelConfigError::L2NotAboveL1.to_string(),
            "L2 must be greater than L1",
        ),
        (
            PixelConfigError::NoLook.text(),
            PixelConfigError::NoLook.to_string(),
            "no multiple of X lies strictly between L1 and L2",
        ),
    ];
    let of_arrays = [
        (ArrayError::Pixels, "no room for so many pixels"),
        (ArrayError::Layout, "the layout has fewer pixels"),
        (ArrayError::Blocks, "no room for so many blocks"),
        (ArrayError::NoLevel, "at least level 1"),
        (ArrayError::OtherLooks, "X of the blocks"),
        (ArrayError::BlocksAndNeighbours, "blocks or neighbours"),
        (ArrayError::NeighboursAndDeadTime, "weigh a dead time"),
        (ArrayError::OtherRoom, "another size"),
    ];
    let of_arrays = of_arrays.map(|(error, part)| (error.text(), error.to_string(), part));
    for (text, display, part) in texts.into_iter().chain(of_arrays) {
        assert!(text.contains(part), "{text}");
        assert_eq!(text, display);
    }
}

#[test]
fn echoes_and_levels_have_four_values_each() {
    for raw in 0..=u8::MAX {
        let echo = EchoNumber::new(raw);
        assert_eq!(
            echo.map(EchoNumber::raw),
            (1..=4).contains(&raw).then_some(raw)
        );
        if let Some(echo) = echo {
            assert_eq!(echo.to_string(), raw.to_string());
        }
        let pixels = BlockLevel::new(raw).map(BlockLevel::pixels);
        assert_eq!(pixels, [1, 4, 16, 64].get(usize::from(raw)).copied());
    }
}

#[test]
fn every_position_is_its_bin_and_its_offset() {
    for bin in 0..1024 {
        let bin = BinIndex::new(bin).unwrap();
        for offset in (-512..=511).filter_map(SubBinOffset::new) {
            let position = BinPosition::of(bin, offset);
            let expected = 256 * i32::from(bin.raw()) + i32::from(offset.raw());
            assert_eq!(position.raw(), expected);
        }
    }
}

#[test]
fn statistics_add_up_field_by_field() {
    let of = |first: u64, step: u64| {
        let number = |field: u64| first + step * field;
        let mut statistics = Statistics::new();
        statistics.counted = number(0);
        statistics.excluded = number(1);
        statistics.saturated = number(2);
        statistics.rejected = number(3);
        statistics.gated_out = number(4);
        statistics.events = number(5);
        statistics.deferred = number(6);
        statistics.expired = number(7);
        statistics.expired_deferred = number(8);
        statistics.repeated = number(9);
        statistics.ended_full = number(10);
        statistics.blind_looks = number(11);
        statistics
    };
    let mut sum = of(3, 10);
    sum += of(7, 1000);
    assert_eq!(sum, of(10, 1010));
    assert_eq!(sum.photons(), 6 * 10 + (1 + 2 + 3 + 4 + 9) * 1010);
}

#[test]
fn a_pixel_has_reported_while_its_event_waits_or_its_exposure_goes_on() {
    const ONE: PixelConfig<64> = checked!(PixelConfig::paper().build());
    let two = PixelConfig::<64>::paper().echoes(EchoNumber::LAST, 4);
    for (config, goes_on) in [(ONE, false), (two.build().unwrap(), true)] {
        let mut pixel = AsyncPixel::<64>::new(PixelAddress::new(0));
        let mut statistics = Statistics::default();
        assert!(!pixel.has_reported());
        (0..50).for_each(|_| pixel.count(&config, 20));
        assert!(!pixel.has_reported());
        let look = pixel.end_laser_cycles(&config, &mut statistics, LaserCycle::new(43), 44);
        assert_eq!(look, Look::Event);
        assert!(pixel.has_reported(), "its event waits");
        assert!(pixel.take_event().is_some());
        assert_eq!(pixel.has_reported(), goes_on);
    }
}

/// Losses of the same number do not hide each other.
#[test]
fn every_kind_of_loss_is_counted_beside_the_others() {
    let gate = RangeGate::new(8, 63).unwrap();
    let config = PixelConfig::<64>::paper().gate(gate).build().unwrap();
    for losses in 0..27 {
        let [saturated, rejected, gated_out] = [losses % 3, losses / 3 % 3, losses / 9];
        let mut pixel = AsyncPixel::<64>::new(PixelAddress::new(0));
        let mut statistics = Statistics::default();
        for (code, photons) in [(20, 1023 + saturated), (64, rejected), (7, gated_out)] {
            (0..photons).for_each(|_| pixel.count(&config, code));
        }
        pixel.add_photons_to(&mut statistics);
        let mut expected = Statistics::new();
        expected.counted = 1023;
        expected.saturated = saturated;
        expected.rejected = rejected;
        expected.gated_out = gated_out;
        assert_eq!(statistics, expected);
    }
}

/// A frame with more photons in a bin than it holds, alone and on top of others.
#[test]
fn a_frame_fills_counters_and_counts_what_they_do_not_hold() {
    for before in [0u32, 1, 1000] {
        for photons in [1022u32, 1023, 1024, 1025, 70_000] {
            let mut histogram = Histogram::<16>::new();
            let full = RangeGate::full();
            let mut frame = [2; 16];
            frame[9] = before;
            histogram.add_frame(&frame, &full);
            frame[9] = photons;
            histogram.add_frame(&frame, &full);
            let held = (before + photons).min(1023);
            assert_eq!(histogram.count(9), Some(held));
            assert_eq!(histogram.saturated(), before + photons - held);
            assert_eq!(histogram.total(), 15 * 4 + held);

            let mut histogram = Histogram::<16>::new();
            histogram.add_frame(&frame, &full);
            assert_eq!(histogram.count(9), Some(photons.min(1023)));
            assert_eq!(histogram.saturated(), photons - photons.min(1023));
        }
    }
}

#[test]
fn an_estimator_reaches_as_far_as_its_wider_side() {
    assert_eq!(DepthEstimator::Centroid3.reach(), 1);
    for before in (256..=1024u16).step_by(64) {
        for after in (256..=1024u16).step_by(64) {
            let [half, other] = [before, after].map(U8F8::from_bits);
            let window = CentredWindow::with_sides(half, other).unwrap();
            let reach = DepthEstimator::CentredWindow(window).reach();
            assert_eq!(
                f64::from(reach),
                (f64::from(before.max(after)) / 256.0).ceil()
            );
        }
    }
}

/// To the nearest 1/256 mm, half of it up, for bins of every fraction.
#[test]
fn distances_are_rounded_to_the_nearest() {
    for picoseconds in [0x1_0000u32, 0x1_2345, 0x64_8000, 0xfa_0001] {
        let scale = RangeScale::new(U16F16::from_bits(picoseconds), I24F8::ZERO).unwrap();
        // A bin in 1/65536 of 1/256 mm, from a distance so long that its rounding does not count.
        let bin = scale.distance(1 << 24).to_bits() << 16 >> 24;
        for bins in -2000..2000i32 {
            let exact = i64::from(bins) * bin;
            let nearest = (exact + (1 << 15)) >> 16;
            assert_eq!(
                scale.distance(bins).to_bits(),
                nearest,
                "{bins} of {picoseconds}"
            );
        }
    }
}
