//! The tables of `docs/aer-format.md`, read from the document itself, and words packed
//! as they say.

use std::collections::BTreeMap;

use dtof_core::events::DynamicDepthEvent;
use dtof_core::{
    BinIndex, BinPosition, BlockLevel, Count, DepthEvent, EchoNumber, Flags, LaserCycle,
    PixelAddress, SubBinOffset,
};

pub const DOCUMENT: &str = include_str!("../../../docs/aer-format.md");

/// The lines from a heading up to the next.
pub fn section(heading: &str) -> Vec<&'static str> {
    let mut lines = DOCUMENT.lines();
    assert!(lines.any(|line| line == heading), "no {heading}");
    lines.take_while(|line| !line.starts_with('#')).collect()
}

/// The cells of the rows of the tables among these lines, without the heads.
pub fn rows(lines: &[&'static str]) -> Vec<Vec<&'static str>> {
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
pub struct Field {
    first: u32,
    last: u32,
    name: &'static str,
    /// What always stands there.
    constant: Option<u128>,
}

pub fn bit_table(heading: &str) -> Vec<Field> {
    let table: Vec<Field> = rows(&section(heading))
        .into_iter()
        .map(|row| {
            let (first, last) = row[0].split_once('-').unwrap_or((row[0], row[0]));
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
pub fn pack(table: &[Field], values: &BTreeMap<&str, u128>) -> [u8; 16] {
    let mut word = 0u128;
    for field in table {
        let value = field.constant.unwrap_or_else(|| values[field.name]);
        let bits = field.last - field.first + 1;
        assert!(value < 1 << bits, "{} = {value}", field.name);
        word |= value << field.first;
    }
    word.to_le_bytes()
}

pub fn pack_event(table: &[Field], event: &DepthEvent) -> [u8; 16] {
    let offset = i128::from(event.offset.raw());
    let values = BTreeMap::from([
        ("pixel", event.pixel.raw().into()),
        ("exposure", event.exposure.into()),
        ("cycle_low", u128::from(event.cycle.raw() % (1 << 16))),
        ("level", event.level.raw().into()),
        ("echo", u128::from(event.echo.raw()) - 1),
        ("peak_bin", event.peak_bin.raw().into()),
        ("peak_count", event.peak_count.raw().into()),
        ("background", event.background.raw().into()),
        // Two's complement of ten bits.
        ("offset", offset.rem_euclid(1024).unsigned_abs()),
        ("flags", event.flags.bits().into()),
    ]);
    pack(table, &values)
}

pub fn pack_time(table: &[Field], cycle: LaserCycle) -> [u8; 16] {
    pack(
        table,
        &BTreeMap::from([("cycle_high", u128::from(cycle.raw() / (1 << 16)))]),
    )
}

/// `a=1 b=2` in backquotes.
pub fn named_values(text: &'static str) -> BTreeMap<&'static str, i128> {
    let pairs = text.trim_matches('`').split(' ');
    let pairs = pairs.map(|pair| pair.split_once('=').unwrap());
    pairs
        .map(|(name, value)| (name, value.parse().unwrap()))
        .collect()
}

pub fn event_of(values: &BTreeMap<&str, i128>) -> DepthEvent {
    assert_eq!(values.len(), 10);
    let count = |name| Count::new(values[name].try_into().unwrap()).unwrap();
    DepthEvent {
        pixel: PixelAddress::new(values["pixel"].try_into().unwrap()),
        level: level_of(values),
        echo: EchoNumber::new(values["echo"].try_into().unwrap()).unwrap(),
        cycle: LaserCycle::new(values["cycle"].try_into().unwrap()),
        exposure: values["exposure"].try_into().unwrap(),
        peak_bin: BinIndex::new(values["peak_bin"].try_into().unwrap()).unwrap(),
        offset: SubBinOffset::new(values["offset"].try_into().unwrap()).unwrap(),
        peak_count: count("peak_count"),
        background: count("background"),
        flags: Flags::from_bits(values["flags"].try_into().unwrap()).unwrap(),
    }
}

fn level_of(values: &BTreeMap<&str, i128>) -> BlockLevel {
    BlockLevel::new(values["level"].try_into().unwrap()).unwrap()
}

pub fn change_of(values: &BTreeMap<&str, i128>) -> DynamicDepthEvent {
    assert_eq!(values.len(), 6);
    DynamicDepthEvent::new(
        PixelAddress::new(values["pixel"].try_into().unwrap()),
        level_of(values),
        LaserCycle::new(values["cycle"].try_into().unwrap()),
        BinPosition::new(values["position"].try_into().unwrap()).unwrap(),
        values["change"].try_into().unwrap(),
        Flags::from_bits(values["flags"].try_into().unwrap()).unwrap(),
    )
    .unwrap()
}

pub fn hex(text: &str) -> Vec<u8> {
    let bytes = text.trim_matches('`').split_whitespace();
    bytes
        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
        .collect()
}

pub fn word_of(text: &str) -> [u8; 16] {
    hex(text).try_into().unwrap()
}

/// CRC-32/ISO-HDLC, bit by bit.
pub fn crc32(bytes: &[u8]) -> u32 {
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

/// An event of any numbers, in the order of its fields.
pub fn event(numbers: [u64; 10]) -> DepthEvent {
    let mut numbers = numbers.into_iter();
    let mut next = || numbers.next().unwrap();
    DepthEvent {
        pixel: PixelAddress::new(next() as u16),
        level: BlockLevel::new(next() as u8 % 4).unwrap(),
        echo: EchoNumber::new(next() as u8 % 4 + 1).unwrap(),
        cycle: LaserCycle::new(next()),
        exposure: next() as u16,
        peak_bin: BinIndex::new(next() as u16 % 1024).unwrap(),
        offset: SubBinOffset::new((next() % 1024) as i16 - 512).unwrap(),
        peak_count: Count::new(next() as u32 % (1 << 24)).unwrap(),
        background: Count::new(next() as u32 % (1 << 24)).unwrap(),
        flags: Flags::from_bits(next() as u8 % 64).unwrap(),
    }
}

pub fn tables() -> [Vec<Field>; 2] {
    ["### Depth event", "### Time word"].map(bit_table)
}
