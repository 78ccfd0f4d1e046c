//! Bins into millimetres.

use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{BinIndex, BinPosition, RangeScale, RangeScaleError, SubBinOffset};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// The formula, `position` in 1/256 bins, in millimetres.
fn real_range(position: i32, width: U16F16, offset: I24F8) -> f64 {
    f64::from(position) / 256.0 * width.to_num::<f64>() * 0.149_896_229 + offset.to_num::<f64>()
}

/// Positions there are: -2 bins to 1024 bins and 255/256.
const POSITIONS: core::ops::RangeInclusive<i32> = -512..=1023 * 256 + 511;

fn position(raw: i32) -> BinPosition {
    let bin = (raw >> 8).clamp(0, 1023);
    BinPosition::of(
        BinIndex::new(u16::try_from(bin).unwrap()).unwrap(),
        SubBinOffset::new(i16::try_from(raw - bin * 256).unwrap()).unwrap(),
    )
}

/// Nearer than the documented 0.01 mm at this position.
fn check_range(scale: &RangeScale, raw: i32, width: U16F16, offset: I24F8) {
    let range = scale.range(position(raw)).to_num::<f64>();
    let error = (range - real_range(raw, width, offset)).abs();
    assert!(
        error <= 0.01,
        "{raw}/256 · {width} ps + {offset}: off by {error}"
    );
}

#[test]
fn every_position_is_what_its_bin_and_offset_say() {
    for raw in POSITIONS {
        assert_eq!(position(raw).raw(), raw);
    }
    assert_eq!(BinPosition::MIN.raw(), *POSITIONS.start());
    assert_eq!(BinPosition::MAX.raw(), *POSITIONS.end());
}

#[test]
fn every_position_is_within_a_hundredth_of_a_millimetre() {
    // The smallest width, the paper's two, a worst case of rounding (half of
    // 1/65,536 mm a bin too few), a wide one.
    for (width, offset) in [
        ("0.00006103515625", "0"),
        ("1", "-8000000"),
        ("250", "-123.4375"),
        ("8750", "0.00390625"),
        ("39.0625", "0"),
        ("54000", "0"),
    ] {
        let (width, offset) = (width.parse().unwrap(), offset.parse().unwrap());
        let scale = RangeScale::new(width, offset).unwrap();
        for raw in POSITIONS {
            check_range(&scale, raw, width, offset);
        }
    }
}

#[test]
fn every_width_rounds_within_the_bound_at_both_ends() {
    let mut rng = Pcg32::seed_from_u64(4);
    for _ in 0..1_000_000 {
        // From 4/65,536 ps, the smallest that is not 0 mm a bin.
        let width = U16F16::from_bits(4 + rng.next_u32() % (54_000 << 16));
        let scale = RangeScale::new(width, I24F8::ZERO).unwrap();
        check_range(&scale, *POSITIONS.start(), width, I24F8::ZERO);
        check_range(&scale, *POSITIONS.end(), width, I24F8::ZERO);
    }
}

#[test]
fn a_bin_width_of_zero_is_refused() {
    for offset in [I24F8::MIN, I24F8::ZERO, I24F8::MAX] {
        let scale = RangeScale::new(U16F16::ZERO, offset);
        assert_eq!(scale, Err(RangeScaleError::ZeroBinWidth));
    }
}

/// Accepted if all ranges fit their format, and only then; never wrapped.
fn check_limits(width: U16F16, offset: I24F8) {
    let (start, end) = (*POSITIONS.start(), *POSITIONS.end());
    let (least, most) = (I24F8::MIN.to_num::<f64>(), I24F8::MAX.to_num::<f64>());
    let nearest = real_range(start, width, offset);
    let farthest = real_range(end, width, offset);
    match RangeScale::new(width, offset) {
        Ok(scale) => {
            assert!(nearest >= least - 0.01 && farthest <= most + 0.01);
            check_range(&scale, start, width, offset);
            check_range(&scale, end, width, offset);
        }
        Err(error) => {
            assert_eq!(error, RangeScaleError::OutOfRange);
            assert!(nearest < least + 0.01 || farthest > most - 0.01);
        }
    }
}

#[test]
fn ranges_that_do_not_fit_are_refused() {
    for (width, offset) in [
        (U16F16::MAX, I24F8::ZERO),
        (U16F16::MAX, I24F8::MAX),
        (U16F16::lit("250"), I24F8::MAX),
        (U16F16::lit("250"), I24F8::MIN),
        (U16F16::lit("55000"), I24F8::ZERO),
    ] {
        let scale = RangeScale::new(width, offset);
        assert_eq!(scale, Err(RangeScaleError::OutOfRange), "{width} {offset}");
        check_limits(width, offset);
    }
    // An offset can bring the widest bins back into the format.
    let offset = I24F8::lit("-2000000");
    assert!(RangeScale::new(U16F16::MAX, offset).is_ok());
    check_limits(U16F16::MAX, offset);
}

#[test]
fn the_limit_lies_where_the_formula_says() {
    let mut rng = Pcg32::seed_from_u64(5);
    let (mut refused, mut accepted) = (0, 0);
    for _ in 0..300_000 {
        let width = U16F16::from_bits(rng.next_u32().max(1));
        // Near the offset at which the farthest range is the largest there is.
        let farthest = real_range(*POSITIONS.end(), width, I24F8::ZERO);
        let near = 8_388_607.996 - farthest + f64::from(rng.next_u32() % 256) / 1000.0 - 0.128;
        let offset = I24F8::saturating_from_num(near);
        check_limits(width, offset);
        match RangeScale::new(width, offset) {
            Ok(_) => accepted += 1,
            Err(_) => refused += 1,
        }
        // And the nearest the smallest.
        let nearest = real_range(*POSITIONS.start(), width, I24F8::ZERO);
        let near = -8_388_608.0 - nearest + f64::from(rng.next_u32() % 256) / 1000.0 - 0.128;
        check_limits(width, I24F8::saturating_from_num(near));
    }
    assert!(refused > 1000 && accepted > 1000);
}

proptest! {
    #[test]
    fn any_width_offset_and_position(width in 1u32.., offset: i32, raw in POSITIONS) {
        let (width, offset) = (U16F16::from_bits(width), I24F8::from_bits(offset));
        check_limits(width, offset);
        if let Ok(scale) = RangeScale::new(width, offset) {
            check_range(&scale, raw, width, offset);
        }
    }
}
