//! The tables of `docs/link-format.md`: every byte of the records, every refusal and every
//! fault of a sensor. And the figures of the README.

use std::fmt::Display;

use dtof_core::{GateError, PixelConfigError, Statistics};
use dtof_link::endpoint::{BODY_BYTES, LinkCounters, WINDOW};
use dtof_link::frame::WIRE_BYTES;
use dtof_link::{
    Configuration, FaultRecord, NoHistogram, Refusal, Report, SensorRecord, StopReason,
};

/// The table of the document under this heading describes each of so many bytes once, in
/// order.
#[track_caller]
fn describes_all_bytes(heading: &str, bytes: usize) {
    let document = include_str!("../../docs/link-format.md");
    let (_, rest) = document.split_once(&format!("\n### {heading}\n")).unwrap();
    let (_, rest) = rest.split_once("\n|---|").unwrap();
    let (table, _) = rest.split_once("\n\n").unwrap();
    let mut next = 0;
    for line in table.lines().skip(1) {
        let field = line.split('|').nth(1).unwrap().trim();
        let (first, last) = field.split_once('-').unwrap_or((field, field));
        assert_eq!(first.parse(), Ok(next), "{line}");
        next = last.parse::<usize>().unwrap() + 1;
    }
    assert_eq!(next, bytes, "{heading}");
}

#[test]
fn the_tables_describe_every_byte_of_the_records() {
    describes_all_bytes("Configuration", Configuration::BYTES);
    describes_all_bytes("Sensor", SensorRecord::BYTES);
    describes_all_bytes("Report", Report::BYTES);
}

#[test]
fn the_readme_says_what_a_message_takes() {
    let more = WIRE_BYTES - BODY_BYTES;
    let said = format!("A message has up to {BODY_BYTES} bytes, a frame on the wire {more} more.");
    let readme = include_str!("../README.md");
    assert!(readme.contains(&said), "{said}");
    assert_eq!(WINDOW, 4);
    assert!(readme.contains("at most eight messages: four that"));
}

#[test]
fn a_report_lies_as_the_document_says() {
    let statistics = |first| {
        let mut statistics = Statistics::new();
        statistics.counted = first;
        statistics.excluded = first + 1;
        statistics.saturated = first + 2;
        statistics.rejected = first + 3;
        statistics.gated_out = first + 4;
        statistics.events = first + 5;
        statistics.deferred = first + 6;
        statistics.expired = first + 7;
        statistics.expired_deferred = first + 8;
        statistics
    };
    let mut report = Report {
        cycles: 1,
        unaddressed: 2,
        statistics: statistics(3),
        blocks: statistics(12),
        overrun: 21,
        unknown: 22,
        sensor_errors: 23,
        sensor_starts: 24,
        sensor_stops: 25,
        link: LinkCounters {
            frames: 26,
            corrupt: 27,
            oversized: 28,
            foreign: 29,
            out_of_order: 30,
            duplicate: 31,
            retransmitted: 32,
        },
        last_sensor_error: 33,
        stop_reason: 34,
    };
    report.statistics.ended_full = 35;
    report.statistics.blind_looks = 36;
    report.statistics.repeated = 37;
    let wide = (1u64..=20).flat_map(u64::to_le_bytes);
    let narrow = (21u32..=32).flat_map(u32::to_le_bytes);
    let last = (35u64..=37).flat_map(u64::to_le_bytes);
    let expected: Vec<u8> = wide.chain(narrow).chain([33, 34]).chain(last).collect();
    assert_eq!(report.to_le_bytes(), expected[..]);
}

/// Each of them has a number from 1 on, a line in the document's table that begins
/// so, and words of its own.
#[track_caller]
fn are_documented<T: Display>(all: &[T], number: impl Fn(&T) -> u8, table: &str) {
    let document = include_str!("../../docs/link-format.md");
    let (_, rest) = document.split_once(table).unwrap();
    let (table, _) = rest.split_once("\n\n").unwrap();
    for (expected, item) in (1..).zip(all) {
        assert_eq!(number(item), expected);
        assert!(table.contains(&format!("\n| {expected} | ")), "{expected}");
    }
    assert!(!table.contains(&format!("\n| {} | ", all.len() + 1)));
    let mut words: Vec<String> = all.iter().map(ToString::to_string).collect();
    words.sort();
    words.dedup();
    assert_eq!(words.len(), all.len());
}

#[test]
fn every_refusal_has_its_own_number_and_reason() {
    let all: Vec<Refusal> = (0..=255).filter_map(Refusal::from_number).collect();
    assert_eq!(all.len(), 24);
    are_documented(&all, |&refusal| refusal as u8, "\n| reason | |\n");
}

/// Core's errors and the device's refusals have the same words.
#[test]
fn the_errors_of_core_have_the_refusals_of_their_words() {
    let pixel = [
        PixelConfigError::ZeroX,
        PixelConfigError::XAboveL1,
        PixelConfigError::L2NotAboveL1,
        PixelConfigError::NoLook,
    ];
    let pixel = pixel.map(|error| (Refusal::from(error), error.text()));
    let gate = [GateError::PastLastBin, GateError::TooNarrow];
    let gate = gate.map(|error| (Refusal::from(error), error.text()));
    for (refusal, text) in pixel.into_iter().chain(gate) {
        assert_eq!(refusal.to_string(), text);
    }
}

#[test]
fn every_sensor_fault_has_its_own_number_and_words() {
    let all: Vec<FaultRecord> = (0..=255).filter_map(FaultRecord::from_number).collect();
    assert_eq!(all.len(), 9);
    are_documented(&all, |&fault| fault as u8, "\n| last sensor error | |\n");
}

#[test]
fn every_reason_of_a_stop_has_its_own_number_and_words() {
    let all: Vec<StopReason> = (0..=255).filter_map(StopReason::from_number).collect();
    assert_eq!(all.len(), 11);
    are_documented(
        &all,
        |&reason| reason as u8,
        "\n| reason of the last stop | |\n",
    );
}

#[test]
fn the_document_tells_the_limits_of_the_host_timeout() {
    let (least, most) = Configuration::HOST_TIMEOUTS_MS.into_inner();
    let row = format!("| 50-51 | host timeout, {least} to {most}; 0 ");
    assert!(
        include_str!("../../docs/link-format.md").contains(&row),
        "{row}"
    );
}

#[test]
fn every_reason_for_no_histogram_has_its_own_number_and_words() {
    let all: Vec<NoHistogram> = (0..=255).filter_map(NoHistogram::from_number).collect();
    assert_eq!(all.len(), 4);
    are_documented(&all, |&reason| reason as u8, "\n| no histogram | |\n");
}
