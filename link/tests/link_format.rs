//! The golden frames of `docs/link-format.md`, and what a receiver makes of
//! bytes that are no frames.

use std::fmt::Display;

use dtof_link::FaultRecord;
use dtof_link::endpoint::Endpoint;
use dtof_link::frame::{Deframer, FrameError, PAYLOAD_BYTES, WIRE_BYTES, encode};
use dtof_link::message::greeting;
use dtof_link::message::{CONFIGURE, PHOTONS};
use dtof_link::{Configuration, Refusal, Report, Token};
use proptest::prelude::*;

/// The golden frame whose line in the document begins so.
fn golden(begins: &str) -> Vec<u8> {
    let document = include_str!("../../docs/link-format.md");
    let line = document
        .lines()
        .find(|line| line.starts_with(&format!("| {begins}")))
        .unwrap();
    let hex = line.split('`').nth(1).unwrap();
    hex.split(' ')
        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
        .collect()
}

fn hex(bytes: &[u8]) -> String {
    bytes
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect::<Vec<_>>()
        .join(" ")
}

fn next(end: &mut Endpoint, now: u32) -> Vec<u8> {
    let mut wire = [0; WIRE_BYTES];
    let length = end.transmit(now, &mut wire);
    wire[..length].to_vec()
}

fn give(end: &mut Endpoint, wire: &[u8]) {
    let mut deframer = Deframer::new();
    for &byte in wire {
        if let Some(frame) = deframer.push(byte) {
            end.receive(frame, 0);
        }
    }
}

#[test]
fn both_ends_send_the_golden_frames() {
    let mut host = Endpoint::host(0x1234, greeting(0, 0), 0);
    let mut device = Endpoint::device(greeting(128, 64));
    let hello = next(&mut host, 0);
    assert_eq!(hex(&hello), hex(&golden("hello")));
    give(&mut device, &hello);
    let welcome = next(&mut device, 0);
    assert_eq!(hex(&welcome), hex(&golden("welcome")));
    give(&mut host, &welcome);
    assert!(host.is_open() && device.is_open());
    assert_eq!(host.peer_greeting(), &greeting(128, 64));

    let mut body = Vec::new();
    for token in [
        Token::Advance { pixels: 3 },
        Token::Photon { code: 60 },
        Token::Photon { code: 300 },
        Token::EndOfCycles { cycles: 1 },
    ] {
        body.extend(token.to_bytes());
    }
    host.offer(PHOTONS, &body).unwrap();
    let photons = next(&mut host, 0);
    assert_eq!(hex(&photons), hex(&golden("photons 0")));
    give(&mut device, &photons);
    assert_eq!(device.take().unwrap().body, body[..]);
    assert_eq!(hex(&next(&mut device, 0)), hex(&golden("keep-alive")));
}

#[test]
fn a_host_configures_with_the_golden_frame() {
    let mut host = Endpoint::host(0x1234, greeting(0, 0), 0);
    next(&mut host, 0);
    give(&mut host, &golden("welcome"));
    let configuration = Configuration {
        alpha: 0,
        minimum_count: 5,
        x: 4,
        l1: 40,
        l2: 2000,
        gate_first: 10,
        gate_last: 119,
        pixels: 64,
        bin_width: 250 << 16,
        offset: -(359 << 7),
        source: 0,
        rule: 1,
        window: 3,
        z: 9 << 11,
        estimator: 1,
        half_width: 5 << 7,
        output: 1,
        reference: 1,
        threshold: 100 << 8,
        one_hit: 1,
    };
    host.offer(CONFIGURE, &configuration.to_le_bytes()).unwrap();
    assert_eq!(hex(&next(&mut host, 0)), hex(&golden("configure 0")));
}

#[test]
fn a_receiver_is_in_step_again_after_the_next_zero_byte() {
    let good = golden("photons 0");
    for damaged in [
        good[3..].to_vec(),                      // its head is missing
        [&good[..5], &[0], &good[5..]].concat(), // cut in two
        [&[7; 300][..], &[0]].concat(),          // too long
        good.iter()
            .map(|&byte| if byte == 0x3c { 0x3d } else { byte })
            .collect(),
    ] {
        let mut deframer = Deframer::new();
        let errors = damaged
            .iter()
            .filter_map(|&byte| deframer.push(byte)?.err())
            .count();
        assert!(errors > 0, "{damaged:x?}");
        let mut found = good
            .iter()
            .filter_map(|&byte| deframer.push(byte).map(|frame| frame.map(<[u8]>::len)));
        assert_eq!(found.next(), Some(Ok(6 + 8)));
    }
}

#[test]
fn what_is_too_long_is_named_so() {
    let mut deframer = Deframer::new();
    let found = [1; 300]
        .iter()
        .chain(&[0])
        .filter_map(|&byte| deframer.push(byte).map(|frame| frame.err()))
        .last();
    assert_eq!(found, Some(Some(FrameError::Oversized)));
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
    assert_eq!(all.len(), 15);
    are_documented(&all, |&refusal| refusal as u8, "\n| reason | |\n");
}

#[test]
fn every_sensor_fault_has_its_own_number_and_words() {
    let all: Vec<FaultRecord> = (0..=255).filter_map(FaultRecord::from_number).collect();
    assert_eq!(all.len(), 9);
    are_documented(&all, |&fault| fault as u8, "\n| last sensor error | |\n");
}

proptest! {
    #[test]
    fn any_payload_comes_back(payload in prop::collection::vec(any::<u8>(), 0..=PAYLOAD_BYTES)) {
        let mut wire = [0; WIRE_BYTES];
        let (head, tail) = payload.split_at(payload.len() / 3);
        let length = encode([head, tail], &mut wire);
        prop_assert!(wire[..length - 1].iter().all(|&byte| byte != 0) && wire[length - 1] == 0);
        let mut deframer = Deframer::new();
        for &byte in &wire[..length - 1] {
            prop_assert!(deframer.push(byte).is_none());
        }
        prop_assert_eq!(deframer.push(0), Some(Ok(&payload[..])));
    }

    #[test]
    fn any_bytes_leave_an_endpoint_alive(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
        let mut device = Endpoint::device(greeting(128, 64));
        give(&mut device, &bytes);
        prop_assert!(!device.is_open());
        give(&mut device, &[0]);
        give(&mut device, &golden("hello"));
        prop_assert!(device.is_open());
    }

    #[test]
    fn configurations_come_back(
        words in any::<[u16; 10]>(), bin_width: u32, offset: i32, bytes in any::<[u8; 7]>(),
        threshold: u32,
    ) {
        let [alpha, minimum_count, x, l1, l2, gate_first, gate_last, pixels, z, half_width] = words;
        let [source, rule, window, estimator, output, reference, one_hit] = bytes;
        let configuration = Configuration {
            alpha, minimum_count, x, l1, l2, gate_first, gate_last, pixels, bin_width, offset,
            source, rule, window, z, estimator, half_width, output, reference, threshold, one_hit,
        };
        let bytes = configuration.to_le_bytes();
        prop_assert_eq!(Configuration::from_le_bytes(&bytes), Some(configuration));
        prop_assert_eq!(Configuration::from_le_bytes(&bytes[1..]), None);
    }

    #[test]
    fn reports_come_back(bytes in prop::collection::vec(any::<u8>(), Report::BYTES)) {
        let report = Report::from_le_bytes(&bytes).unwrap();
        prop_assert_eq!(&report.to_le_bytes()[..], &bytes[..]);
        prop_assert_eq!(Report::from_le_bytes(&bytes[1..]), None);
    }

    #[test]
    fn tokens_come_back(code: u16, pixels in 1u8..=64, cycles: u16) {
        let tokens =
            [Token::Photon { code }, Token::Advance { pixels }, Token::EndOfCycles { cycles }];
        let bytes: Vec<u8> = tokens.iter().flat_map(|token| token.to_bytes()).collect();
        let mut left = &bytes[..];
        for token in tokens {
            let (first, rest) = Token::split_first(left).unwrap();
            prop_assert_eq!(first, token);
            left = rest;
        }
        prop_assert_eq!(Token::split_first(left), None);
    }
}
