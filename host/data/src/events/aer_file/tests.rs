use std::io::BufWriter;

use dtof_core::Array;
use dtof_core::fixed::types::{I24F8, U16F16};

use super::*;
use crate::events::fixtures;

/// 128 bins of 250 ps.
fn header(columns: u32, rows: u32) -> Header {
    Header {
        bins: 128,
        array: Array::new(columns, rows).unwrap(),
        bin_width_ps: U16F16::lit("250"),
        offset_mm: I24F8::lit("-12.5"),
        offsets_mm: Vec::new(),
        laser_millihertz: 7,
        start_us: 9,
    }
}

fn depth(pixel: u16, cycle: u64, bin: u16) -> Event {
    Event::Depth(fixtures::event(pixel, cycle, bin))
}

/// How many events come before the end or an error, and the error.
fn read(bytes: &[u8]) -> (usize, Option<String>) {
    let mut reader = match Reader::new(bytes) {
        Ok(reader) => reader,
        Err(error) => return (0, Some(format!("{error:#}"))),
    };
    let mut events = 0;
    loop {
        match reader.next_event() {
            Ok(Some(_)) => events += 1,
            Ok(None) => return (events, None),
            Err(error) => return (events, Some(format!("{error:#}"))),
        }
    }
}

#[test]
fn offsets_of_pixels_are_under_the_checksum_and_their_padding_is_0() {
    let header = Header {
        offsets_mm: vec![Some(I24F8::lit("-78.25")), None, Some(I24F8::ZERO)],
        ..header(3, 1)
    };
    let bytes = fixtures::aer_file(&header, "", &[depth(2, 100, 60)]);
    assert_eq!((bytes[8], bytes.len()), (6, 64 + 16 + 3 * 16));
    assert_eq!(read(&bytes), (1, None));
    let checksum = "byte 112: the checksum does not match: a word before this one is damaged";
    for at in 64..80 {
        let mut damaged = bytes.clone();
        damaged[at] ^= 1;
        let expected = match at {
            ..76 => (1, Some(checksum.to_owned())),
            _ => (0, Some("the header is damaged".to_owned())),
        };
        assert_eq!(read(&damaged), expected, "{at}");
    }
}

#[test]
fn a_file_without_offsets_is_of_version_5_and_offsets_of_other_pixels_are_refused() {
    let bytes = fixtures::aer_file(&header(3, 1), "", &[]);
    assert_eq!((bytes[8], bytes.len()), (5, 64 + 16));
    for number in [1, 2, 4] {
        let header = Header {
            offsets_mm: vec![None; number],
            ..header(3, 1)
        };
        let error = Writer::new(Vec::new(), &header).err().unwrap();
        let expected = format!("{number} offsets for 3 pixels");
        assert_eq!(error.to_string(), expected);
    }
}

#[test]
fn settings_in_a_header_are_read_back_unless_they_are_too_long() {
    let header = header(2, 2);
    let event = depth(1, 9, 3);
    for (length, kept) in [(0, 0), (1, 1), (16, 16), (65_456, 65_456), (65_457, 0)] {
        let settings = "x".repeat(length);
        let bytes = fixtures::aer_file(&header, &settings, &[event]);
        let mut reader = Reader::new(&bytes[..]).unwrap();
        assert_eq!(reader.settings(), &settings[..kept]);
        assert_eq!(reader.header(), &header);
        // They end with a whole word.
        assert_eq!(reader.offset(), 64 + kept.next_multiple_of(16) as u64);
        assert_eq!(reader.next_event().unwrap(), Some(event));
        assert_eq!(reader.next_event().unwrap(), None);
        assert_eq!(reader.offset(), bytes.len() as u64);
    }
}

#[test]
fn what_was_written_is_flushed() {
    let out = BufWriter::new(Vec::new());
    let mut writer = Writer::new(out, &header(3, 1)).unwrap();
    assert_eq!(writer.out.get_ref().len(), 0);
    writer.flush().unwrap();
    assert_eq!(writer.out.get_ref().len(), 64);
}

#[test]
fn a_cut_file_is_read_up_to_the_word_that_is_cut() {
    // Two time words, three events, the end word.
    let events = [depth(0, 1, 60), depth(1, 2, 60), depth(2, 1 << 16, 60)];
    let bytes = fixtures::aer_file(&header(3, 1), "x = 1", &events);
    assert_eq!((bytes.len(), read(&bytes)), (80 + 6 * 16, (3, None)));
    for length in 0..bytes.len() {
        let words = length.saturating_sub(80) / 16;
        let part = match (length, length % 16) {
            (..64, _) => "not an AER file: shorter than its header",
            (..80, _) => "the file ends inside its header",
            (_, 0) => "the file ends without an end word",
            _ => "the file ends inside a word",
        };
        let expected = match length {
            ..80 => (0, part.to_owned()),
            _ => {
                let byte = 80 + words * 16;
                ([0, 0, 1, 2, 2, 3][words], format!("byte {byte}: {part}"))
            }
        };
        let (events, error) = read(&bytes[..length]);
        assert_eq!((events, error.unwrap()), expected, "{length}");
    }
}

#[test]
fn what_is_wrong_is_named_with_its_byte() {
    // The words begin at bytes 64 (time), 80, 96 and 112 (end).
    let bytes = fixtures::aer_file(&header(3, 1), "", &[depth(0, 1, 60), depth(1, 2, 60)]);
    let longer = [&bytes[..], &[0]].concat();
    assert_eq!(
        read(&longer),
        (2, Some("byte 128: bytes follow the end word".to_owned()))
    );
    for (at, to, events, expected) in [
        (64 + 6, 0x30, 0, "byte 64: unknown control word"),
        (80 + 7, 0xc0, 0, "byte 80: unknown kind of word"),
        (64 + 7, 0x40, 0, "byte 64: an event before any time word"),
        (96, 3, 1, "byte 96: pixel 3 of 3"),
        // The peak bin has bits 52 to 61, its upper six in this byte: 0x48 is kind 1 and 8 × 16.
        (96 + 7, 0x48, 1, "byte 96: bin 140 of 128"),
        // One photon more.
        (
            96 + 8,
            10,
            2,
            "byte 112: the checksum does not match: a word before this one is damaged",
        ),
        (
            112 + 8,
            3,
            2,
            "byte 112: the end word counts 3 events, the file holds 2",
        ),
    ] {
        let mut damaged = bytes.clone();
        damaged[at] = to;
        assert_eq!(read(&damaged), (events, Some(expected.to_owned())), "{at}");
    }
}

/// A disk that fails is not a file that ends.
#[test]
fn an_error_of_the_input_is_that_of_the_reader() {
    struct Broken;

    impl Read for Broken {
        fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
            Err(io::Error::other("broken"))
        }
    }

    let bytes = fixtures::aer_file(&header(3, 1), "x = 1", &[]);
    for (length, expected) in [(0, "broken"), (70, "broken"), (80, "byte 80: broken")] {
        let mut reader = Reader::new((&bytes[..length]).chain(Broken));
        let error = match &mut reader {
            Ok(reader) => reader.next_event().unwrap_err(),
            Err(_) => reader.err().unwrap(),
        };
        assert_eq!(format!("{error:#}"), expected);
    }
}

#[test]
fn what_is_no_file_is_not_opened() {
    let error = open(Path::new(".")).err().unwrap();
    assert_eq!(error.to_string(), "is a folder; name a file in it");
}
