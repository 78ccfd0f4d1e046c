//! The files of `docs/aer-format.md`, read from the document itself.

use std::collections::BTreeMap;

use dtof_core::Array;
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_data::events::aer_file::{Event, EventKind, Header, Reader};
use dtof_data::events::fixtures::aer_file;

const DOCUMENT: &str = include_str!("../../../docs/aer-format.md");

/// The bytes of a text of hexadecimal numbers.
fn bytes(text: &str) -> Vec<u8> {
    let bytes = text.split_whitespace();
    let bytes = bytes.map(|byte| u8::from_str_radix(byte, 16).unwrap());
    bytes.collect()
}

/// The bytes of a block of the document.
fn block(name: &str) -> Vec<u8> {
    let (_, block) = DOCUMENT.split_once(&format!("```{name}\n")).unwrap();
    bytes(block.split_once("```").unwrap().0)
}

/// The words of the golden file: bytes, kind and values.
fn golden_words() -> Vec<(Vec<u8>, &'static str, BTreeMap<&'static str, i128>)> {
    let rows = DOCUMENT.lines().filter_map(|line| {
        let (word, meaning) = line.strip_prefix("| `")?.split_once("` | ")?;
        let (kind, values) = meaning.strip_suffix("` |")?.split_once(": `")?;
        let values = values.split(' ').map(|pair| {
            let (name, value) = pair.split_once('=').unwrap();
            (name, value.parse().unwrap())
        });
        Some((bytes(word), kind, values.collect()))
    });
    rows.collect()
}

/// Settings and events of a file.
fn read(bytes: &[u8]) -> (Header, String, Vec<Event>) {
    let mut reader = Reader::new(bytes).unwrap();
    let events = std::iter::from_fn(|| reader.next_event().unwrap()).collect();
    assert_eq!(reader.offset(), bytes.len() as u64);
    (
        reader.header().clone(),
        reader.settings().to_owned(),
        events,
    )
}

#[test]
fn the_golden_file_is_read_as_its_table_says_and_written_again() {
    let words = golden_words();
    let all = words.iter().map(|(word, ..)| word.as_slice());
    let file = [block("header"), all.collect::<Vec<_>>().concat()].concat();
    let (header, settings, events) = read(&file);
    let expected = Header {
        bins: 1024,
        array: Array::new(256, 256).unwrap(),
        bin_width_ps: U16F16::lit("250"),
        offset_mm: I24F8::lit("-12.5"),
        offsets_mm: Vec::new(),
        laser_millihertz: 10_000_000_000,
        start_us: 1_790_000_000_000_000,
    };
    assert_eq!((&header, settings.as_str()), (&expected, "z = 4.47"));

    let mut events_left = events.iter();
    for (_, kind, values) in &words {
        let (kind, echo, position) = match *kind {
            "event" => (
                EventKind::Depth,
                values["echo"],
                256 * values["peak_bin"] + values["offset"],
            ),
            "dynamic" => (EventKind::DynamicDepth, 1, values["position"]),
            _ => continue,
        };
        let event = events_left.next().unwrap();
        assert_eq!(event.kind(), kind);
        let values = ["pixel", "level", "cycle", "flags"].map(|name| values[name]);
        let same: [i128; 4] = [
            event.pixel().raw().into(),
            event.level().raw().into(),
            event.cycle().raw().into(),
            event.flags().bits().into(),
        ];
        assert_eq!(same, values);
        let place: [i128; 2] = [event.echo().raw().into(), event.position().raw().into()];
        assert_eq!(place, [echo, position]);
    }
    assert_eq!(events_left.next(), None);
    assert_eq!(aer_file(&header, &settings, &events), file);
}

#[test]
fn the_file_with_offsets_has_those_of_the_document_and_is_written_again() {
    let file = block("offsets");
    let (header, settings, events) = read(&file);
    let offsets = [
        Some(1.5),
        Some(-78.25),
        None,
        Some(0.0),
        Some(2.0),
        Some(30.75),
    ];
    let header_without = Header {
        bins: 128,
        array: Array::new(3, 2).unwrap(),
        bin_width_ps: U16F16::lit("250"),
        offset_mm: I24F8::lit("-12.5"),
        offsets_mm: Vec::new(),
        laser_millihertz: 0,
        start_us: 0,
    };
    let expected = Header {
        offsets_mm: offsets.map(|mm| mm.map(I24F8::from_num::<f64>)).to_vec(),
        ..header_without.clone()
    };
    assert_eq!((&header, settings.as_str()), (&expected, ""));
    assert_eq!(aer_file(&header, "", &events), file);

    // Both events lie at 60.5 bins. Without offsets the same words have other ranges.
    let ranges_mm = |header: &Header| {
        let ranges = header.ranges().unwrap();
        let range = |event: &Event| ranges.of(event.pixel(), event.level(), event.position());
        let range = |event: &Event| format!("{:.3}", range(event).to_num::<f64>());
        events.iter().map(range).collect::<Vec<_>>()
    };
    assert_eq!(ranges_mm(&header), ["2176.430", "2285.430"]);
    let old = read(&aer_file(&header_without, "", &events));
    assert_eq!(old, (header_without, String::new(), events.clone()));
    assert_eq!(ranges_mm(&old.0), ["2254.680", "2254.680"]);
}
