//! Words nobody made: any bytes mean what the document says, or nothing.

use std::collections::BTreeMap;

use dtof_core::events::DynamicDepthEvent;
use dtof_core::{
    AerDecoder, AerEncoder, AerError, AerRecord, AerWord, BinPosition, BlockLevel, Flags,
    LaserCycle, PixelAddress,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::document::{bit_table, pack, pack_time};
use crate::common::parallel;

/// Decodes any bytes as the document says, without the code.
fn check_any_bytes(bytes: [u8; 16]) {
    let number = u128::from_le_bytes(bytes);
    let mut decoder = AerDecoder::new();
    decoder
        .decode(AerWord::time(LaserCycle::new(3 << 16)))
        .unwrap();
    let word = AerWord::from_le_bytes(bytes);
    assert_eq!(word.to_le_bytes(), bytes);
    let decoded = decoder.decode(word);
    let (kind, control) = (number >> 62 & 3, number >> 52 & 0x3ff);
    match (kind, control) {
        (1, _) => {
            let Ok(AerRecord::Event(event)) = decoded else {
                panic!("{decoded:?}");
            };
            assert_eq!(event.cycle.raw() >> 16, 3);
            // Sent on, it is the same.
            assert_eq!(AerWord::depth_event(&event).to_le_bytes(), bytes);
        }
        (0, 1) => {
            let valid = number << 76 == 0 && number >> 112 == 0;
            let time = AerRecord::Time(LaserCycle::new(((number >> 64) << 16) as u64));
            assert_eq!(decoded, valid.then_some(time).ok_or(AerError::ReservedBits));
        }
        (0, 2) => {
            let valid = number >> 32 & 0xf_ffff == 0;
            let (events, checksum) = ((number >> 64) as u64, number as u32);
            let end = AerRecord::End { events, checksum };
            assert_eq!(decoded, valid.then_some(end).ok_or(AerError::ReservedBits));
        }
        (0, _) => assert_eq!(decoded, Err(AerError::UnknownControl)),
        (2, _) => {
            let position = ((number >> 64) as u32).cast_signed();
            let change = ((number >> 96) as u32).cast_signed();
            let in_range = (-512..=262_399).contains(&position)
                && (-262_911..=262_911).contains(&change)
                && change != 0;
            let reserved = number >> 16 & 0xffff | number >> 50 & 3 | number >> 58 & 0xf;
            match decoded {
                Ok(AerRecord::DynamicDepth(event)) => {
                    assert!(in_range && reserved == 0);
                    assert_eq!(event.cycle.raw() >> 16, 3);
                    // Sent on, it is the same.
                    assert_eq!(AerWord::dynamic_depth(&event).to_le_bytes(), bytes);
                }
                Err(AerError::OutOfRange) => assert!(!in_range),
                Err(AerError::ReservedBits) => assert!(in_range && reserved != 0),
                _ => panic!("{decoded:?}"),
            }
        }
        _ => assert_eq!(decoded, Err(AerError::UnknownKind)),
    }
    if kind == 1 || kind == 2 {
        assert_eq!(AerDecoder::new().decode(word), Err(AerError::MissingTime));
    }
}

#[test]
#[cfg_attr(miri, ignore = "millions of words: hours under Miri")]
fn random_bytes_decode_as_documented_or_not_at_all() {
    let mut rng = Pcg32::seed_from_u64(2);
    for number in 0..2_000_000 {
        let mut bytes = [0; 16];
        rng.fill_bytes(&mut bytes);
        // Half of them time and end words, with few other bits or many.
        if number % 2 == 0 {
            let few = u128::from_le_bytes(bytes) >> (rng.next_u32() % 128);
            let few = few.rotate_left(rng.next_u32() % 128);
            let control = 1 + u128::from(rng.next_u32() % 2);
            bytes = (few & !(0xfff << 52) | control << 52).to_le_bytes();
        }
        // A tenth dynamic depth events, most of them with a position and a change that
        // can be.
        if number % 10 == 1 {
            let word = u128::from_le_bytes(bytes) & !(0xf << 58 | 3 << 50 | 0xffff << 16);
            let small = word >> 64 & 0x3_ffff | (word >> 96 & 0x3_ffff) << 32;
            let few = 1 << (rng.next_u32() % 128);
            let few = if rng.next_u32() % 4 == 0 { few } else { 0 };
            let low = word & u128::from(u64::MAX) & !(3 << 62) | 2 << 62;
            bytes = (small << 64 | low ^ few & !(3 << 62)).to_le_bytes();
        }
        check_any_bytes(bytes);
    }
}

#[test]
#[cfg_attr(miri, ignore = "millions of words: hours under Miri")]
fn all_combinations_of_the_boundaries_of_a_dynamic_depth_event() {
    let tables = ["### Dynamic depth event", "### Time word"].map(bit_table);
    let two = |number: i32| u128::from(number.cast_unsigned());
    for pixel in [0, 1, u16::MAX] {
        for (level, cycle) in [
            (0, 0),
            (1, 1),
            (2, (1 << 16) - 1),
            (3, 1 << 16),
            (0, u64::MAX),
        ] {
            for position in [-512, -1, 0, 1, 262_399] {
                for change in [-262_911, -1, 1, 262_911] {
                    for flags in 0..32 {
                        let event = DynamicDepthEvent::new(
                            PixelAddress::new(pixel),
                            BlockLevel::new(level).unwrap(),
                            LaserCycle::new(cycle),
                            BinPosition::new(position).unwrap(),
                            change,
                            Flags::from_bits(flags).unwrap(),
                        )
                        .unwrap();
                        let (time, word) = AerEncoder::new().encode_dynamic_depth(&event);
                        let time = time.unwrap();
                        assert_eq!(time.to_le_bytes(), pack_time(&tables[1], event.cycle));
                        let values = BTreeMap::from([
                            ("pixel", pixel.into()),
                            ("level", level.into()),
                            ("cycle_low", u128::from(cycle % (1 << 16))),
                            ("flags", flags.into()),
                            ("position", two(position)),
                            ("change", two(change)),
                        ]);
                        assert_eq!(word.to_le_bytes(), pack(&tables[0], &values));
                        let mut decoder = AerDecoder::new();
                        decoder.decode(time).unwrap();
                        let decoded = decoder.decode(word);
                        assert_eq!(decoded, Ok(AerRecord::DynamicDepth(event)));
                    }
                }
            }
        }
    }
    for (position, change) in [(0, 0), (0, 262_912), (0, -262_912)] {
        let position = BinPosition::new(position).unwrap();
        let (pixel, level) = (PixelAddress::new(0), BlockLevel::PIXEL);
        let event = DynamicDepthEvent::new(
            pixel,
            level,
            LaserCycle::new(0),
            position,
            change,
            Flags::NONE,
        );
        assert_eq!(event, None);
    }
}

/// Every position and every change there is, and the field of each at every value.
#[test]
#[ignore = "takes a minute: `.ci/long proofs`"]
fn every_position_and_change_of_a_dynamic_depth_event() {
    const LOW: u128 = 2 << 62;
    parallel::for_each(1 << 16, |upper| {
        for lower in 0..1 << 16 {
            let value = u128::from(upper << 16 | lower);
            // Beside a change of 1, and a position of 0.
            for word in [LOW | value << 64 | 1 << 96, LOW | value << 96] {
                check_any_bytes(word.to_le_bytes());
            }
        }
    });
}

#[test]
fn every_kind_and_control_code() {
    for top in 0..=0xfffu128 {
        check_any_bytes((top << 52).to_le_bytes());
    }
}

/// Those with the sixth bit are refused.
#[test]
fn every_value_of_the_flags_and_of_the_bit_above() {
    for flags in 0..64u128 {
        check_any_bytes((1 << 62 | flags << 122).to_le_bytes());
        check_any_bytes((2 << 62 | 1 << 96 | flags << 52).to_le_bytes());
    }
}

#[test]
fn every_single_bit_of_a_time_or_end_word() {
    for control in [1u128, 2] {
        for bit in 0..128 {
            check_any_bytes((control << 52 ^ 1 << bit).to_le_bytes());
        }
    }
}
