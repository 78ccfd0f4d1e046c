//! Sub-bin depth against the real-valued formula, and bins into millimetres.

use dtof_core::fixed::types::{I24F8, U16F16, U24F8};
use dtof_core::{
    BinIndex, BinPosition, Count, Count10, Count16, Count24, CounterWidth, Depth, Flags, Histogram,
    Peak, RangeGate, RangeScale, RangeScaleError, SubBinOffset, centre_of_mass,
};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

fn peak_at(bin: u16, count: u32) -> Peak {
    Peak {
        bin: BinIndex::new(bin).unwrap(),
        count: Count::new(count).unwrap(),
    }
}

/// The depth of a pulse of three bins in the middle of a histogram.
fn depth<W: CounterWidth>([left, centre, right]: [u32; 3], background: u32) -> Depth {
    let gate = RangeGate::full();
    let mut histogram = Histogram::<8, W>::new();
    histogram.add_frame(&[0, 0, 0, left, centre, right, 0, 0], &gate);
    let background = U24F8::from_num(background);
    centre_of_mass(&histogram, &gate, peak_at(4, centre), background)
}

/// In bins from the start of the peak bin.
fn real_offset(counts: [u32; 3], background: u32) -> f64 {
    let [left, centre, right] = counts.map(|count| f64::from(count.saturating_sub(background)));
    let sum = left + centre + right;
    if sum == 0.0 {
        0.5
    } else {
        0.5 + (right - left) / sum
    }
}

fn check<W: CounterWidth>(counts: [u32; 3], background: u32, bound: f64) {
    let depth = depth::<W>(counts, background);
    let offset = f64::from(depth.offset.raw()) / 256.0;
    let error = (offset - real_offset(counts, background)).abs();
    assert!(
        error <= bound + 1e-9,
        "{counts:?} - {background}: off by {error}"
    );
    let saturated = counts[1] == W::MAX;
    assert_eq!(depth.flags.contains(Flags::SATURATED), saturated);
    assert!(!depth.flags.contains(Flags::CLIPPED));
    if counts[1] >= counts[0] && counts[1] >= counts[2] {
        assert!((0..=256).contains(&depth.offset.raw()), "{counts:?}");
    }
    // Seen in a mirror.
    let [left, centre, right] = counts;
    let mirrored = self::depth::<W>([right, centre, left], background);
    assert_eq!(mirrored.offset.raw(), 256 - depth.offset.raw());
}

/// A random count of any magnitude up to `max`.
fn any_count(rng: &mut Pcg32, max: u32) -> u32 {
    rng.next_u32() % ((max >> (rng.next_u32() % 24)) + 1)
}

fn random_pulses<W: CounterWidth>(bound: f64, seed: u64) {
    let mut rng = Pcg32::seed_from_u64(seed);
    for _ in 0..300_000 {
        let centre = any_count(&mut rng, W::MAX);
        let [left, right] = [0; 2].map(|_| any_count(&mut rng, centre));
        let background = any_count(&mut rng, centre);
        check::<W>([left, centre, right], background, bound);
    }
}

const NARROW: f64 = 1.0 / 512.0;
const WIDE: f64 = 1.0 / 256.0;

#[test]
fn all_small_pulses_whether_or_not_the_middle_is_highest() {
    for number in 0..14u32.pow(4) {
        let [left, centre, right, background] =
            [1, 14, 14 * 14, 14 * 14 * 14].map(|step| number / step % 14);
        check::<Count10>([left, centre, right], background, NARROW);
        check::<Count16>([left, centre, right], background, NARROW);
        check::<Count24>([left, centre, right], background, WIDE);
    }
}

#[test]
fn random_10_bit_pulses() {
    random_pulses::<Count10>(NARROW, 1);
}

#[test]
fn random_16_bit_pulses() {
    random_pulses::<Count16>(NARROW, 2);
}

#[test]
fn random_24_bit_pulses() {
    random_pulses::<Count24>(WIDE, 3);
}

#[test]
fn extreme_pulses() {
    fn all<W: CounterWidth>(bound: f64) {
        let counts = [0, 1, W::MAX / 2, W::MAX - 1, W::MAX];
        for left in counts {
            for centre in counts {
                for right in counts {
                    for background in counts {
                        check::<W>([left, centre, right], background, bound);
                    }
                }
            }
        }
    }
    all::<Count10>(NARROW);
    all::<Count16>(NARROW);
    all::<Count24>(WIDE);
}

#[test]
fn a_symmetric_pulse_lies_exactly_in_the_middle() {
    for centre in 0..1024 {
        for side in 0..=centre {
            let offset = depth::<Count10>([side, centre, side], side / 2).offset;
            assert_eq!(offset, SubBinOffset::CENTRE);
        }
    }
}

#[test]
fn nothing_above_the_background_lies_in_the_middle() {
    for background in [0, 1, 30, 1023] {
        for left in [0, background / 2, background] {
            let offset = depth::<Count10>([left, background, background], background).offset;
            assert_eq!(offset, SubBinOffset::CENTRE);
        }
    }
}

#[test]
fn a_pulse_on_the_edge_between_two_bins_lies_on_the_edge() {
    assert_eq!(depth::<Count10>([0, 9, 9], 0).offset.raw(), 256);
    assert_eq!(depth::<Count10>([9, 9, 0], 0).offset.raw(), 0);
}

#[test]
fn a_window_past_the_gate_is_clipped_and_empty_there() {
    // Every count is different, so that a wrong neighbour shows.
    let counts: [u32; 16] = core::array::from_fn(|bin| 40 + u32::try_from(bin).unwrap());
    let mut histogram = Histogram::<16>::new();
    histogram.add_frame(&counts, &RangeGate::full());
    for (first, last) in [(0, 15), (0, 7), (3, 12), (8, 15), (1, 14)] {
        let gate = RangeGate::new(first, last).unwrap();
        for bin in first..=last {
            let count = |bin: u16| counts[usize::from(bin)];
            let left = if bin == first { 0 } else { count(bin - 1) };
            let right = if bin == last { 0 } else { count(bin + 1) };
            let peak = peak_at(bin, count(bin));
            let depth = centre_of_mass(&histogram, &gate, peak, U24F8::ZERO);
            let clipped = bin == first || bin == last;
            assert_eq!(depth.flags.contains(Flags::CLIPPED), clipped, "{bin}");
            let offset = f64::from(depth.offset.raw()) / 256.0;
            let expected = real_offset([left, count(bin), right], 0);
            assert!((offset - expected).abs() <= NARROW);
        }
    }
}

#[test]
fn a_full_counter_is_flagged() {
    assert_eq!(depth::<Count10>([5, 1022, 5], 0).flags, Flags::NONE);
    assert_eq!(depth::<Count10>([5, 1023, 5], 0).flags, Flags::SATURATED);
    assert_eq!(depth::<Count16>([5, 1023, 5], 0).flags, Flags::NONE);
    assert_eq!(depth::<Count16>([5, 65_535, 5], 0).flags, Flags::SATURATED);
    assert_eq!(depth::<Count24>([5, 65_535, 5], 0).flags, Flags::NONE);
    let full = depth::<Count24>([5, 0x00ff_ffff, 5], 0);
    assert_eq!(full.flags, Flags::SATURATED);
}

#[test]
fn both_flags_at_once() {
    let gate = RangeGate::full();
    let mut histogram = Histogram::<8>::new();
    histogram.add_frame(&[2000u16, 0, 0, 0, 0, 0, 0, 0], &gate);
    let depth = centre_of_mass(&histogram, &gate, histogram.peak(), U24F8::ZERO);
    assert_eq!(depth.flags, Flags::SATURATED | Flags::CLIPPED);
    assert_eq!(depth.offset, SubBinOffset::CENTRE);
}

// Bins into millimetres.

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
    fn any_10_bit_pulse(counts in prop::array::uniform3(0u32..1024), background in 0u32..1024) {
        check::<Count10>(counts, background, NARROW);
    }

    #[test]
    fn any_24_bit_pulse(
        counts in prop::array::uniform3(0u32..0x0100_0000),
        background in 0u32..0x0100_0000,
    ) {
        check::<Count24>(counts, background, WIDE);
    }

    #[test]
    fn any_width_offset_and_position(width in 1u32.., offset: i32, raw in POSITIONS) {
        let (width, offset) = (U16F16::from_bits(width), I24F8::from_bits(offset));
        check_limits(width, offset);
        if let Ok(scale) = RangeScale::new(width, offset) {
            check_range(&scale, raw, width, offset);
        }
    }
}
