//! Words against the tables and golden vectors of `docs/aer-format.md`, which
//! are read from the document itself.

#![allow(
    clippy::cast_possible_truncation,
    reason = "fields as wide as their types"
)]

use std::collections::BTreeMap;

use dtof_core::{
    AER_VERSION, AerDecoder, AerEncoder, AerError, AerRecord, AerWord, BinIndex, BinPosition,
    Count, DepthEvent, DynamicDepthEvent, Flags, LaserCycle, PixelAddress, SubBinOffset,
};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

const DOCUMENT: &str = include_str!("../../docs/aer-format.md");

// The document.

/// The lines from a heading up to the next.
fn section(heading: &str) -> Vec<&'static str> {
    let mut lines = DOCUMENT.lines();
    assert!(lines.any(|line| line == heading), "no {heading}");
    lines.take_while(|line| !line.starts_with('#')).collect()
}

/// The cells of the rows of the tables among these lines, without the heads.
fn rows(lines: &[&'static str]) -> Vec<Vec<&'static str>> {
    let cells = |line: &'static str| -> Vec<&'static str> {
        line.trim_matches('|').split('|').map(str::trim).collect()
    };
    let is_rule = |line: &&str| line.starts_with("|---");
    let mut rows = Vec::new();
    for (line, next) in lines.iter().zip(lines.iter().skip(1).chain(&[""])) {
        if line.starts_with('|') && !is_rule(line) && !is_rule(next) {
            rows.push(cells(line));
        }
    }
    rows
}

/// One row of a bit table.
struct Field {
    first: u32,
    last: u32,
    name: &'static str,
    /// What always stands there.
    constant: Option<u128>,
}

fn bit_table(heading: &str) -> Vec<Field> {
    let table: Vec<Field> = rows(&section(heading))
        .into_iter()
        .map(|row| {
            let (first, last) = row[0].split_once('-').unwrap();
            Field {
                first: first.parse().unwrap(),
                last: last.parse().unwrap(),
                name: row[1],
                constant: row[2].parse().ok(),
            }
        })
        .collect();
    // All bits are spoken for, and none twice.
    let mut next = 0;
    for field in &table {
        assert_eq!(field.first, next, "{heading}: {}", field.name);
        assert!(field.last >= field.first);
        next = field.last + 1;
    }
    assert_eq!(next, 128, "{heading}");
    table
}

/// Puts values where a table of the document says.
fn pack(table: &[Field], values: &BTreeMap<&str, u128>) -> [u8; 16] {
    let mut word = 0u128;
    for field in table {
        let value = field.constant.unwrap_or_else(|| values[field.name]);
        let bits = field.last - field.first + 1;
        assert!(value < 1 << bits, "{} = {value}", field.name);
        word |= value << field.first;
    }
    word.to_le_bytes()
}

fn pack_event(table: &[Field], event: &DepthEvent) -> [u8; 16] {
    let offset = i128::from(event.offset.raw());
    let values = BTreeMap::from([
        ("pixel", event.pixel.0.into()),
        ("exposure", event.exposure.into()),
        ("cycle_low", u128::from(event.cycle.0 % (1 << 20))),
        ("peak_bin", event.peak_bin.raw().into()),
        ("peak_count", event.peak_count.raw().into()),
        ("background", event.background.raw().into()),
        // Two's complement of ten bits.
        ("offset", offset.rem_euclid(1024).unsigned_abs()),
        ("flags", event.flags.bits().into()),
    ]);
    pack(table, &values)
}

fn pack_time(table: &[Field], cycle: LaserCycle) -> [u8; 16] {
    pack(
        table,
        &BTreeMap::from([("cycle_high", u128::from(cycle.0 / (1 << 20)))]),
    )
}

/// `a=1 b=2` in backquotes.
fn named_values(text: &'static str) -> BTreeMap<&'static str, i128> {
    let pairs = text.trim_matches('`').split(' ');
    pairs
        .map(|pair| {
            let (name, value) = pair.split_once('=').unwrap();
            (name, value.parse().unwrap())
        })
        .collect()
}

fn event_of(values: &BTreeMap<&str, i128>) -> DepthEvent {
    assert_eq!(values.len(), 8);
    let count = |name| Count::new(values[name].try_into().unwrap()).unwrap();
    DepthEvent {
        pixel: PixelAddress(values["pixel"].try_into().unwrap()),
        cycle: LaserCycle(values["cycle"].try_into().unwrap()),
        exposure: values["exposure"].try_into().unwrap(),
        peak_bin: BinIndex::new(values["peak_bin"].try_into().unwrap()).unwrap(),
        offset: SubBinOffset::new(values["offset"].try_into().unwrap()).unwrap(),
        peak_count: count("peak_count"),
        background: count("background"),
        flags: Flags::from_bits(values["flags"].try_into().unwrap()).unwrap(),
    }
}

fn change_of(values: &BTreeMap<&str, i128>) -> DynamicDepthEvent {
    assert_eq!(values.len(), 5);
    DynamicDepthEvent::new(
        PixelAddress(values["pixel"].try_into().unwrap()),
        LaserCycle(values["cycle"].try_into().unwrap()),
        BinPosition::new(values["position"].try_into().unwrap()).unwrap(),
        values["change"].try_into().unwrap(),
        Flags::from_bits(values["flags"].try_into().unwrap()).unwrap(),
    )
    .unwrap()
}

fn hex(text: &str) -> Vec<u8> {
    let bytes = text.trim_matches('`').split_whitespace();
    bytes
        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
        .collect()
}

fn word_of(text: &str) -> [u8; 16] {
    hex(text).try_into().unwrap()
}

/// CRC-32/ISO-HDLC, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for &byte in bytes {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 {
                crc >> 1 ^ 0xedb8_8320
            } else {
                crc >> 1
            };
        }
    }
    !crc
}

/// The rows of the golden file, and of the words to refuse.
fn golden_rows() -> (Vec<Vec<&'static str>>, Vec<Vec<&'static str>>) {
    let rows = rows(&section("## Golden vectors"));
    rows.into_iter().partition(|row| row[1].contains('='))
}

#[test]
fn the_golden_file_is_what_encoder_and_decoder_make_of_it() {
    let (_, header) = DOCUMENT.split_once("```header\n").unwrap();
    let (header, _) = header.split_once("```").unwrap();
    let mut bytes = hex(header);
    assert_eq!(bytes.len(), 64);
    assert_eq!(&bytes[..8], b"DTOF-AER");
    assert_eq!(bytes[8..12], [AER_VERSION as u8, 0, 64, 0]);
    assert_eq!(crc32(b"123456789"), 0xcbf4_3926);

    let in_header = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let bin_width_ps = f64::from(in_header(24)) / 65_536.0;
    let offset_mm = f64::from(in_header(28)) / 256.0;

    let mut encoder = AerEncoder::new();
    let mut decoder = AerDecoder::new();
    let (mut time_due, mut events) = (None, 0);
    let (golden, _) = golden_rows();
    for row in &golden {
        let sent = word_of(row[0]);
        let (kind, values) = row[1].split_once(": ").unwrap();
        let values = named_values(values);
        let decoded = decoder.decode(AerWord::from_le_bytes(sent)).unwrap();
        match kind {
            "time" => {
                assert_eq!(time_due, None);
                let cycle = LaserCycle(values["cycle"].try_into().unwrap());
                assert_eq!(decoded, AerRecord::Time(cycle));
                time_due = Some(sent);
            }
            "event" => {
                let event = event_of(&values);
                assert_eq!(decoded, AerRecord::Event(event));
                let (time, word) = encoder.encode(&event);
                assert_eq!(time.map(AerWord::to_le_bytes), time_due.take());
                assert_eq!(word.to_le_bytes(), sent);
                events += 1;
                if events == 2 {
                    // The example below the header.
                    let position = f64::from(event.position().raw()) / 256.0;
                    let range = position * bin_width_ps * 0.149_896_229 + offset_mm;
                    let example = format!("{position} bins and {range:.3} mm");
                    assert!(DOCUMENT.contains(&example), "{example}");
                }
            }
            "dynamic" => {
                let event = change_of(&values);
                assert_eq!(decoded, AerRecord::DynamicDepth(event));
                let (time, word) = encoder.encode_dynamic_depth(&event);
                assert_eq!(time.map(AerWord::to_le_bytes), time_due.take());
                assert_eq!(word.to_le_bytes(), sent);
                events += 1;
            }
            "end" => {
                let checksum = crc32(&bytes);
                assert_eq!(values["events"], events);
                assert_eq!(values["checksum"], i128::from(checksum));
                let events = events.try_into().unwrap();
                assert_eq!(decoded, AerRecord::End { events, checksum });
                assert_eq!(AerWord::end(events, checksum).to_le_bytes(), sent);
            }
            _ => panic!("{kind}"),
        }
        bytes.extend(sent);
    }
    assert!(events >= 12);
    assert!(golden.last().unwrap()[1].starts_with("end"));
    assert!(DOCUMENT.contains(&format!("{} bytes", bytes.len())));
    assert!(DOCUMENT.contains(&format!("version {AER_VERSION}")));
}

#[test]
fn the_words_to_refuse_are_refused_for_the_reason_given() {
    let (_, refused) = golden_rows();
    assert!(refused.len() >= 17);
    for row in refused {
        let word = AerWord::from_le_bytes(word_of(row[0]));
        let mut decoder = AerDecoder::new();
        if row[1] != AerError::MissingTime.to_string() {
            decoder.decode(AerWord::time(LaserCycle(0))).unwrap();
        }
        let error = decoder.decode(word).unwrap_err();
        assert_eq!(error.to_string(), row[1], "{}", row[0]);
    }
}

#[test]
fn the_flags_are_those_of_the_document() {
    for (name, flag) in [
        ("saturated", Flags::SATURATED),
        ("clipped", Flags::CLIPPED),
        ("deferred", Flags::DEFERRED),
        ("pile-up", Flags::PILE_UP),
    ] {
        let rows = rows(&section("### Flags"));
        let row = rows.iter().find(|row| row[1] == name).unwrap();
        assert_eq!(flag.bits(), 1 << row[0].parse::<u32>().unwrap());
    }
    for bits in 0..=u8::MAX {
        assert_eq!(
            Flags::from_bits(bits).map(Flags::bits),
            (bits < 64).then_some(bits)
        );
    }
}

// Words against the bit tables.

fn event(numbers: [u64; 8]) -> DepthEvent {
    let [
        pixel,
        cycle,
        exposure,
        peak_bin,
        offset,
        peak_count,
        background,
        flags,
    ] = numbers;
    DepthEvent {
        pixel: PixelAddress(pixel as u16),
        cycle: LaserCycle(cycle),
        exposure: exposure as u16,
        peak_bin: BinIndex::new(peak_bin as u16 % 1024).unwrap(),
        offset: SubBinOffset::new((offset % 1024) as i16 - 512).unwrap(),
        peak_count: Count::new(peak_count as u32 % (1 << 24)).unwrap(),
        background: Count::new(background as u32 % (1 << 24)).unwrap(),
        flags: Flags::from_bits(flags as u8 % 64).unwrap(),
    }
}

/// There and back, from nothing, and the bytes the document wants.
fn check_event(tables: &[Vec<Field>; 2], event: &DepthEvent) {
    let (time, word) = AerEncoder::new().encode(event);
    let time = time.unwrap().to_le_bytes();
    let bytes = word.to_le_bytes();
    assert_eq!(time, pack_time(&tables[1], event.cycle));
    assert_eq!(bytes, pack_event(&tables[0], event), "{event:?}");

    let mut decoder = AerDecoder::new();
    let start = LaserCycle(event.cycle.0 / (1 << 20) * (1 << 20));
    assert_eq!(
        decoder.decode(AerWord::from_le_bytes(time)),
        Ok(AerRecord::Time(start))
    );
    let decoded = decoder.decode(AerWord::from_le_bytes(bytes));
    assert_eq!(decoded, Ok(AerRecord::Event(*event)));
}

fn tables() -> [Vec<Field>; 2] {
    ["### Depth event", "### Time word"].map(bit_table)
}

#[test]
fn all_combinations_of_field_boundaries_round_trip() {
    // Four boundaries a field; eight of the laser cycle, five of the offset.
    let bits = |bits: u32| {
        let max = u64::MAX >> (64 - bits);
        [0, 1, max - 1, max]
    };
    let tables = tables();
    let mut events = 0;
    for pixel in bits(16) {
        for cycle in bits(20).into_iter().chain(bits(64)) {
            for exposure in bits(16) {
                for peak_bin in bits(10) {
                    for offset in [0, 511, 512, 513, 1023] {
                        for count in bits(24) {
                            for background in bits(24) {
                                for flags in bits(6) {
                                    let numbers = [
                                        pixel, cycle, exposure, peak_bin, offset, count,
                                        background, flags,
                                    ];
                                    let (time, word) = AerEncoder::new().encode(&event(numbers));
                                    let mut decoder = AerDecoder::new();
                                    decoder.decode(time.unwrap()).unwrap();
                                    let decoded = decoder.decode(word);
                                    assert_eq!(decoded, Ok(AerRecord::Event(event(numbers))));
                                    events += 1;
                                    if events % 64 == 0 {
                                        check_event(&tables, &event(numbers));
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn each_field_alone_at_each_of_its_bits() {
    let tables = tables();
    let widths = [16, 64, 16, 10, 10, 24, 24, 6];
    for (field, width) in widths.into_iter().enumerate() {
        for bit in 0..width {
            let mut numbers = [0; 8];
            numbers[field] = 1 << bit;
            check_event(&tables, &event(numbers));
            let mut numbers = numbers.map(|number: u64| !number);
            check_event(&tables, &event(numbers));
            numbers[4] = 512; // offset 0
            check_event(&tables, &event(numbers));
        }
    }
}

fn random_event(rng: &mut Pcg32) -> DepthEvent {
    event([0; 8].map(|_| rng.next_u64()))
}

#[test]
fn a_million_random_events_round_trip() {
    let mut rng = Pcg32::seed_from_u64(1);
    let tables = tables();
    let mut encoder = AerEncoder::new();
    let mut decoder = AerDecoder::new();
    for number in 0..1_000_000 {
        let mut event = random_event(&mut rng);
        if number % 2 == 0 {
            event.cycle.0 %= 1 << 22; // few time words
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

// Time.

#[test]
fn time_words_come_before_the_first_event_and_at_every_change_of_the_upper_bits() {
    const TURN: u64 = 1 << 20;
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
        let event = event([3, cycle, 1, 2, 600, 9, 4, 0]);
        let (time, word) = encoder.encode(&event);
        assert_eq!(time.is_some(), due, "{cycle}");
        if let Some(time) = time {
            let start = LaserCycle(cycle - cycle % TURN);
            assert_eq!(decoder.decode(time), Ok(AerRecord::Time(start)));
        }
        assert_eq!(decoder.decode(word), Ok(AerRecord::Event(event)));
    }
}

#[test]
fn a_late_receiver_is_right_from_the_first_time_word_on() {
    let mut encoder = AerEncoder::new();
    let mut late = AerDecoder::new();
    for (cycle, expected) in [(70, false), (80, false), (1 << 20, true), (90, true)] {
        let event = event([0, cycle, 0, 0, 0, 0, 0, 0]);
        let (time, word) = encoder.encode(&event);
        // The first time word is missed.
        if let Some(time) = time.filter(|_| cycle != 70) {
            late.decode(time).unwrap();
        }
        let wanted = if expected {
            Ok(AerRecord::Event(event))
        } else {
            Err(AerError::MissingTime)
        };
        assert_eq!(late.decode(word), wanted);
    }
}

#[test]
fn an_error_leaves_the_decoder_as_it_was() {
    let mut decoder = AerDecoder::new();
    let event = event([1, 12_345_678, 1, 1, 1, 1, 1, 1]);
    let (time, word) = AerEncoder::new().encode(&event);
    decoder.decode(time.unwrap()).unwrap();
    for (byte, bit, error) in [
        (0, 0x01, AerError::ReservedBits),   // of a time word
        (6, 0x20, AerError::UnknownControl), // 1 becomes 3
        (7, 0xc0, AerError::UnknownKind),    // 0 becomes 3
        (15, 0x80, AerError::ReservedBits),
    ] {
        let mut bytes = AerWord::time(LaserCycle(0)).to_le_bytes();
        bytes[byte] |= bit;
        assert_eq!(decoder.decode(AerWord::from_le_bytes(bytes)), Err(error));
        assert_eq!(decoder.decode(word), Ok(AerRecord::Event(event)));
    }
}

// Words nobody made.

/// Decodes any bytes as the document says, without the code.
fn check_any_bytes(bytes: [u8; 16]) {
    let number = u128::from_le_bytes(bytes);
    let mut decoder = AerDecoder::new();
    decoder.decode(AerWord::time(LaserCycle(3 << 20))).unwrap();
    let word = AerWord::from_le_bytes(bytes);
    assert_eq!(word.to_le_bytes(), bytes);
    let decoded = decoder.decode(word);
    let (kind, control) = (number >> 62 & 3, number >> 52 & 0x3ff);
    match (kind, control) {
        (1, _) => {
            let Ok(AerRecord::Event(event)) = decoded else {
                panic!("{decoded:?}");
            };
            assert_eq!(event.cycle.0 >> 20, 3);
            // Sent on, it is the same.
            assert_eq!(AerWord::depth_event(&event).to_le_bytes(), bytes);
        }
        (0, 1) => {
            let valid = number << 76 == 0 && number >> 108 == 0;
            let expected = if valid {
                Ok(AerRecord::Time(LaserCycle(((number >> 64) << 20) as u64)))
            } else {
                Err(AerError::ReservedBits)
            };
            assert_eq!(decoded, expected);
        }
        (0, 2) => {
            let valid = number >> 32 & 0xf_ffff == 0;
            let expected = if valid {
                let (events, checksum) = ((number >> 64) as u64, number as u32);
                Ok(AerRecord::End { events, checksum })
            } else {
                Err(AerError::ReservedBits)
            };
            assert_eq!(decoded, expected);
        }
        (0, _) => assert_eq!(decoded, Err(AerError::UnknownControl)),
        (2, _) => {
            let position = ((number >> 64) as u32).cast_signed();
            let change = ((number >> 96) as u32).cast_signed();
            let in_range = (-512..=262_399).contains(&position)
                && (-262_911..=262_911).contains(&change)
                && change != 0;
            let reserved = number >> 16 & 0xffff | number >> 58 & 0xf;
            match decoded {
                Ok(AerRecord::DynamicDepth(event)) => {
                    assert!(in_range && reserved == 0);
                    assert_eq!(event.cycle.0 >> 20, 3);
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
            let word = u128::from_le_bytes(bytes) & !(0xf << 58 | 0xffff << 16);
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
fn all_combinations_of_the_boundaries_of_a_dynamic_depth_event() {
    let tables = ["### Dynamic depth event", "### Time word"].map(bit_table);
    let two = |number: i32| u128::from(number.cast_unsigned());
    for pixel in [0, 1, u16::MAX] {
        for cycle in [0, 1, (1 << 20) - 1, 1 << 20, u64::MAX] {
            for position in [-512, -1, 0, 1, 262_399] {
                for change in [-262_911, -1, 1, 262_911] {
                    for flags in 0..64 {
                        let event = DynamicDepthEvent::new(
                            PixelAddress(pixel),
                            LaserCycle(cycle),
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
                            ("cycle_low", u128::from(cycle % (1 << 20))),
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
        let (pixel, cycle) = (PixelAddress(0), LaserCycle(0));
        assert!(DynamicDepthEvent::new(pixel, cycle, position, change, Flags::NONE).is_none());
    }
}

#[test]
fn every_kind_and_control_code() {
    for top in 0..=0xfffu128 {
        check_any_bytes((top << 52).to_le_bytes());
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

proptest! {
    #[test]
    fn any_bytes(bytes: [u8; 16]) {
        check_any_bytes(bytes);
    }

    #[test]
    fn any_stream(numbers in prop::collection::vec(any::<([u64; 8], u32)>(), 0..50)) {
        let mut encoder = AerEncoder::new();
        let mut decoder = AerDecoder::new();
        let mut high = None;
        for (mut numbers, shift) in numbers {
            numbers[1] >>= 20 + shift % 44; // often the same upper bits
            let event = event(numbers);
            let change = DynamicDepthEvent::new(
                event.pixel,
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
            prop_assert_eq!(time.is_some(), high != Some(event.cycle.0 >> 20));
            high = Some(event.cycle.0 >> 20);
            if let Some(time) = time {
                decoder.decode(time).unwrap();
            }
            prop_assert_eq!(decoder.decode(word), Ok(record));
        }
    }
}
