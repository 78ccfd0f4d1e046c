//! Windows whose half widths differ: against the formula, in a mirror, and on nothing but background.

use dtof_core::fixed::types::U24F8;
use dtof_core::{Count10, SubBinOffset};
use proptest::prelude::*;

use super::formula::{BINS, counts, depth, highest, is_near_limit, rest};

/// All pulses of four bins of up to 5 photons.
#[test]
fn all_small_pulses_are_as_written_with_two_half_widths() {
    for number in 0..6usize.pow(4) {
        let mut counts = [0; BINS];
        for (place, bin) in (14..18).enumerate() {
            counts[bin] = (number / 6usize.pow(place as u32) % 6) as u32;
        }
        for sides in [
            (256, 1024),
            (512, 1023),
            (511, 512),
            (700, 300),
            (1024, 256),
        ] {
            for bin in 14..18 {
                let depth = depth::<Count10>(&counts, bin, sides, U24F8::ZERO);
                let Some((expected, error)) = rest(&counts, bin, sides) else {
                    continue;
                };
                let off = (f64::from(depth.offset.raw()) - expected).abs();
                assert!(off <= error, "{counts:?} {sides:?}: off by {off}/256");
            }
        }
    }
}

/// Whatever it is taken for: the weights let both sides of it balance.
#[test]
fn an_even_background_moves_no_window() {
    for level in [1, 7, 100, 1023] {
        let counts = [level; BINS];
        for before in (256..=1024).step_by(59) {
            for after in (256..=1024).step_by(61) {
                for background in [0, level << 7, level << 8] {
                    let background = U24F8::from_bits(background);
                    let depth = depth::<Count10>(&counts, 16, (before, after), background);
                    assert_eq!(depth.offset, SubBinOffset::CENTRE, "{before} {after}");
                }
            }
        }
    }
}

proptest! {
    #[test]
    fn it_is_as_written_with_two_half_widths(
        counts in counts(1023),
        before in 256u16..=1024,
        after in 256u16..=1024,
        level in 0u32..2560,
    ) {
        let bin = highest(&counts);
        let found = depth::<Count10>(&counts, bin, (before, after), U24F8::from_bits(level));
        let expected = rest(&counts, bin, (before, after));
        prop_assume!(expected.is_some());
        let (expected, error) = expected.unwrap();
        prop_assert!((f64::from(found.offset.raw()) - expected).abs() <= error);
    }

    #[test]
    fn two_half_widths_in_a_mirror(
        counts in counts(1023),
        before in 256u16..=1024,
        after in 256u16..=1024,
        level in 0u32..9999,
    ) {
        let bin = highest(&counts);
        let level = U24F8::from_bits(level);
        let offset = depth::<Count10>(&counts, bin, (before, after), level).offset.raw();
        let mut mirrored = counts;
        mirrored.reverse();
        let seen = depth::<Count10>(&mirrored, BINS - 1 - bin, (after, before), level);
        let seen = seen.offset.raw();
        if is_near_limit(offset) {
            return Ok(());
        }
        prop_assert_eq!(seen, 256 - offset);
    }
}
