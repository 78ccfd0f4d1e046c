//! Depth events, end words and time words: there and back, and the bytes the document
//! wants.

use std::collections::BTreeMap;

use dtof_core::events::DynamicDepthEvent;
use dtof_core::{AerDecoder, AerEncoder, AerError, AerRecord, AerWord, DepthEvent, LaserCycle};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::document::{Field, bit_table, event, pack, pack_event, pack_time, tables};
use crate::common::parallel;

/// There and back, from nothing, and the bytes the document wants.
fn check_event(tables: &[Vec<Field>; 2], event: &DepthEvent) {
    let (time, word) = AerEncoder::new().encode(event);
    let time = time.unwrap().to_le_bytes();
    let bytes = word.to_le_bytes();
    assert_eq!(time, pack_time(&tables[1], event.cycle));
    assert_eq!(bytes, pack_event(&tables[0], event), "{event:?}");

    let mut decoder = AerDecoder::new();
    let start = LaserCycle::new(event.cycle.raw() / (1 << 16) * (1 << 16));
    let decoded = decoder.decode(AerWord::from_le_bytes(time));
    assert_eq!(decoded, Ok(AerRecord::Time(start)));
    let decoded = decoder.decode(AerWord::from_le_bytes(bytes));
    assert_eq!(decoded, Ok(AerRecord::Event(*event)));
}

#[test]
#[cfg_attr(miri, ignore = "millions of words: hours under Miri")]
fn all_combinations_of_field_boundaries_round_trip() {
    // Four boundaries a field; eight of the laser cycle, five of the offset.
    let bits = |bits: u32| {
        let max = u64::MAX >> (64 - bits);
        [0, 1, max - 1, max]
    };
    let cycles = [bits(16), bits(64)].concat();
    let fields: [&[u64]; 10] = [
        &bits(16),
        &[0, 3],
        &[0, 1, 3],
        &cycles,
        &bits(16),
        &bits(10),
        &[0, 511, 512, 513, 1023],
        &bits(24),
        &bits(24),
        &bits(5),
    ];
    let tables = tables();
    let combinations = fields.iter().map(|values| values.len()).product();
    for number in 0..combinations {
        // Each field takes a digit of the number.
        let mut rest = number;
        let event = event(fields.map(|values| {
            let value = values[rest % values.len()];
            rest /= values.len();
            value
        }));
        let (time, word) = AerEncoder::new().encode(&event);
        let mut decoder = AerDecoder::new();
        decoder.decode(time.unwrap()).unwrap();
        assert_eq!(decoder.decode(word), Ok(AerRecord::Event(event)));
        if number % 61 == 0 {
            check_event(&tables, &event);
        }
    }
}

#[test]
#[cfg_attr(miri, ignore = "takes minutes under Miri")]
fn each_field_alone_at_each_of_its_bits() {
    let tables = tables();
    let widths = [16, 2, 2, 64, 16, 10, 10, 24, 24, 5];
    for (field, width) in widths.into_iter().enumerate() {
        for bit in 0..width {
            let mut numbers = [0; 10];
            numbers[field] = 1 << bit;
            check_event(&tables, &event(numbers));
            let mut numbers = numbers.map(|number: u64| !number);
            check_event(&tables, &event(numbers));
            numbers[6] = 512; // offset 0
            check_event(&tables, &event(numbers));
        }
    }
}

/// Each field at every value, the others at all zeros and all ones; a laser cycle at every value of
/// each 16 bits. That fields do not touch each other is what their bits alone show above.
#[test]
#[ignore = "takes a minute: `.ci/long proofs`"]
fn each_field_at_every_value() {
    let widths = [
        (0, 16),
        (1, 2),
        (2, 2),
        (4, 16),
        (5, 10),
        (6, 10),
        (7, 24),
        (8, 24),
        (9, 5),
    ];
    let cycles = [0, 16, 32, 48].map(|shift| (3, 16, shift));
    let fields = widths.map(|(field, bits)| (field, bits, 0));
    for (field, bits, shift) in fields.into_iter().chain(cycles) {
        parallel::for_each(1 << (bits - 2), |upper| {
            for value in 4 * upper..4 * upper + 4 {
                for others in [0, u64::MAX] {
                    let mut numbers = [others; 10];
                    numbers[6] = 512; // offset 0
                    numbers[field] = value << shift | others & !(((1 << bits) - 1) << shift);
                    let event = event(numbers);
                    let (time, word) = AerEncoder::new().encode(&event);
                    let mut decoder = AerDecoder::new();
                    decoder.decode(time.unwrap()).unwrap();
                    assert_eq!(decoder.decode(word), Ok(AerRecord::Event(event)));
                    let again = AerWord::from_le_bytes(word.to_le_bytes());
                    assert_eq!(again, word);
                }
            }
        });
    }
}

fn random_event(rng: &mut Pcg32) -> DepthEvent {
    event([0; 10].map(|_| rng.next_u64()))
}

#[test]
#[cfg_attr(miri, ignore = "millions of words: hours under Miri")]
fn a_million_random_events_round_trip() {
    let mut rng = Pcg32::seed_from_u64(1);
    let tables = tables();
    let mut encoder = AerEncoder::new();
    let mut decoder = AerDecoder::new();
    for number in 0..1_000_000 {
        let mut event = random_event(&mut rng);
        if number % 2 == 0 {
            event.cycle = LaserCycle::new(event.cycle.raw() % (1 << 18)); // few time words
        }
        let (time, word) = encoder.encode(&event);
        if let Some(time) = time {
            decoder.decode(time).unwrap();
        }
        assert_eq!(decoder.decode(word), Ok(AerRecord::Event(event)));
        if number % 20 == 0 {
            check_event(&tables, &event);
        }
    }
}

#[test]
fn end_words_are_those_of_the_document() {
    let table = bit_table("### End word");
    for events in [0, 1, 1 << 32, u64::MAX] {
        for checksum in [0, 1, 0x8000_0000, u32::MAX] {
            let word = AerWord::end(events, checksum);
            let values = BTreeMap::from([("events", events.into()), ("checksum", checksum.into())]);
            assert_eq!(word.to_le_bytes(), pack(&table, &values));
            let decoded = AerDecoder::new().decode(word);
            assert_eq!(decoded, Ok(AerRecord::End { events, checksum }));
        }
    }
}

#[test]
fn time_words_come_before_the_first_event_and_at_every_change_of_the_upper_bits() {
    const TURN: u64 = 1 << 16;
    const HALF: u64 = 1 << 63;
    let mut encoder = AerEncoder::new();
    let mut decoder = AerDecoder::new();
    for (cycle, due) in [
        (5, true), // the first
        (0, false),
        (TURN - 1, false),
        (TURN, true),
        (2 * TURN - 1, false),
        (TURN - 1, true), // back
        (TURN, true),
        (7 * TURN, true),
        (HALF - 1, true),
        (HALF, true),
        (HALF + TURN - 1, false),
        (HALF - 1, true),
        (u64::MAX - TURN, true),
        (u64::MAX, true),
        (u64::MAX - TURN + 1, false),
        (0, true),
    ] {
        let event = event([3, 1, 2, cycle, 1, 2, 600, 9, 4, 0]);
        let (time, word) = encoder.encode(&event);
        assert_eq!(time.is_some(), due, "{cycle}");
        if let Some(time) = time {
            let start = LaserCycle::new(cycle - cycle % TURN);
            assert_eq!(decoder.decode(time), Ok(AerRecord::Time(start)));
        }
        assert_eq!(decoder.decode(word), Ok(AerRecord::Event(event)));
    }
}

#[test]
fn a_late_receiver_is_right_from_the_first_time_word_on() {
    let mut encoder = AerEncoder::new();
    let mut late = AerDecoder::new();
    for (cycle, expected) in [(70, false), (80, false), (1 << 16, true), (90, true)] {
        let event = event([0, 0, 0, cycle, 0, 0, 0, 0, 0, 0]);
        let (time, word) = encoder.encode(&event);
        // The first time word is missed.
        if let Some(time) = time.filter(|_| cycle != 70) {
            late.decode(time).unwrap();
        }
        let wanted = expected.then_some(AerRecord::Event(event));
        assert_eq!(late.decode(word), wanted.ok_or(AerError::MissingTime));
    }
}

#[test]
fn an_error_leaves_the_decoder_as_it_was() {
    let mut decoder = AerDecoder::new();
    let event = event([1, 1, 1, 12_345_678, 1, 1, 1, 1, 1, 1]);
    let (time, word) = AerEncoder::new().encode(&event);
    decoder.decode(time.unwrap()).unwrap();
    for (byte, bit, error) in [
        (0, 0x01, AerError::ReservedBits),   // of a time word
        (6, 0x20, AerError::UnknownControl), // 1 becomes 3
        (7, 0xc0, AerError::UnknownKind),    // 0 becomes 3
        (15, 0x80, AerError::ReservedBits),
    ] {
        let mut bytes = AerWord::time(LaserCycle::new(0)).to_le_bytes();
        bytes[byte] |= bit;
        assert_eq!(decoder.decode(AerWord::from_le_bytes(bytes)), Err(error));
        assert_eq!(decoder.decode(word), Ok(AerRecord::Event(event)));
    }
}

proptest! {
    #[test]
    fn any_stream(numbers in prop::collection::vec(any::<([u64; 10], u32)>(), 0..50)) {
        let mut encoder = AerEncoder::new();
        let mut decoder = AerDecoder::new();
        let mut high = None;
        for (mut numbers, shift) in numbers {
            numbers[3] >>= 16 + shift % 48; // often the same upper bits
            let event = event(numbers);
            let change = DynamicDepthEvent::new(
                event.pixel,
                event.level,
                event.cycle,
                event.position(),
                1 + i32::from(event.offset.raw()).abs(),
                event.flags,
            );
            let change = change.filter(|_| shift % 3 == 0);
            let (time, word) = match &change {
                None => encoder.encode(&event),
                Some(change) => encoder.encode_dynamic_depth(change),
            };
            let record = match change {
                None => AerRecord::Event(event),
                Some(change) => AerRecord::DynamicDepth(change),
            };
            prop_assert_eq!(time.is_some(), high != Some(event.cycle.raw() >> 16));
            high = Some(event.cycle.raw() >> 16);
            if let Some(time) = time {
                decoder.decode(time).unwrap();
            }
            prop_assert_eq!(decoder.decode(word), Ok(record));
        }
    }
}
