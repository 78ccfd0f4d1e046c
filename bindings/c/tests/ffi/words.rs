//! Words and checksums match `docs/aer-format.md`.

use dtof_c::dtof_status_t::*;
use dtof_c::*;

use crate::{OK, zeroed};

/// The bytes in the first cell of each row of a table of the page.
fn rows(page: &str, title: &str) -> Vec<[u8; 16]> {
    let (_, table) = page.split_once(title).unwrap();
    let rows = table.lines().skip(2);
    let rows = rows.take_while(|line| line.starts_with("| `"));
    let bytes = rows.map(|row| row.trim_start_matches("| `").split('`').next().unwrap());
    let bytes = bytes.map(|bytes| bytes.split(' ').map(|byte| u8::from_str_radix(byte, 16)));
    bytes
        .map(|bytes| bytes.map(Result::unwrap).collect::<Vec<_>>())
        .map(|bytes| bytes.try_into().unwrap())
        .collect()
}

const PAGE: &str = include_str!("../../../../docs/aer-format.md");

#[test]
fn golden_words_are_read_and_events_written_again() {
    let words = rows(PAGE, "| bytes as sent | meaning |");
    assert_eq!(words.len(), 21);
    let (mut encoder, mut decoder) = (zeroed(), zeroed());
    let (mut kinds, mut file) = ([0; 5], Vec::new());
    // SAFETY: each pointer leads to an object of its type.
    unsafe {
        assert_eq!(dtof_aer_encoder_init(&mut encoder), OK);
        assert_eq!(dtof_aer_decoder_init(&mut decoder), OK);
        for word in &words {
            let mut record = dtof_record_t::default();
            assert_eq!(
                dtof_aer_decode(&mut decoder, word.as_ptr(), &mut record),
                OK
            );
            kinds[usize::from(record.kind)] += 1;
            let (mut bytes, mut length) = ([0; DTOF_EVENT_BYTES], 0);
            let (first, end) = (bytes.as_mut_ptr(), &mut length);
            match record.kind {
                DTOF_RECORD_EVENT => {
                    assert_eq!(dtof_aer_encode(&mut encoder, &record.event, first, end), OK);
                    assert_eq!(&bytes[length - 16..length], word);
                }
                DTOF_RECORD_DYNAMIC_DEPTH => {
                    assert_eq!(
                        record.event.position_q8.cast_unsigned().to_le_bytes(),
                        word[8..12]
                    );
                    assert_eq!(record.change_q8.cast_unsigned().to_le_bytes(), word[12..]);
                }
                DTOF_RECORD_TIME => assert_eq!(record.event.cycle & 0xffff, 0),
                _ => {
                    assert_eq!(dtof_aer_end(record.events, record.checksum, first), OK);
                    assert_eq!(&bytes[..16], word);
                    let (mut checksum, (_, header)) = (0, PAGE.split_once("```header\n").unwrap());
                    let header = header.split("```").next().unwrap().split_whitespace();
                    let mut all: Vec<u8> = header
                        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
                        .collect();
                    all.extend(&file);
                    // In two pieces.
                    let (one, other) = all.split_at(77);
                    assert_eq!(dtof_crc32(&mut checksum, one.as_ptr(), one.len()), OK);
                    assert_eq!(dtof_crc32(&mut checksum, other.as_ptr(), other.len()), OK);
                    assert_eq!(checksum, record.checksum);
                }
            }
            file.extend(word);
        }
    }
    assert_eq!(kinds, [0, 10, 4, 6, 1]);
}

#[test]
fn invalid_words_have_their_own_errors() {
    let words = rows(PAGE, "| bytes as sent | why |");
    assert_eq!(words.len(), 10);
    let expected = [
        [DTOF_ERROR_AER_KIND; 2].as_slice(),
        &[DTOF_ERROR_AER_CONTROL; 3],
        &[DTOF_ERROR_AER_RESERVED; 3],
        &[DTOF_ERROR_AER_MISSING_TIME; 2],
    ];
    for (word, expected) in words.iter().zip(expected.concat()) {
        let (mut decoder, mut record) = (zeroed(), dtof_record_t::default());
        // SAFETY: each pointer leads to an object of its type.
        unsafe {
            assert_eq!(dtof_aer_decoder_init(&mut decoder), OK);
            let status = dtof_aer_decode(&mut decoder, word.as_ptr(), &mut record);
            assert_eq!(status, expected);
        }
    }
}

#[test]
fn an_event_that_does_not_fit_a_word_is_refused() {
    type Change = fn(&mut dtof_event_t);
    let wrong: [Change; 8] = [
        |event| event.level = 4,
        |event| event.echo = 0,
        |event| event.echo = 5,
        |event| event.peak_bin = 1024,
        |event| event.offset_q8 = 512,
        |event| event.peak_count = 1 << 24,
        |event| event.background = 1 << 24,
        |event| event.flags = 64,
    ];
    let good = dtof_event_t {
        echo: 1,
        ..dtof_event_t::default()
    };
    let none: Change = |_| {};
    for (change, expected) in wrong
        .into_iter()
        .map(|change| (change, DTOF_ERROR_EVENT))
        .chain([(none, OK)])
    {
        let (mut encoder, mut event) = (zeroed(), good);
        change(&mut event);
        let (mut bytes, mut length) = ([0; DTOF_EVENT_BYTES], 0);
        // SAFETY: each pointer leads to an object of its type.
        let status = unsafe {
            assert_eq!(dtof_aer_encoder_init(&mut encoder), OK);
            dtof_aer_encode(&mut encoder, &event, bytes.as_mut_ptr(), &mut length)
        };
        assert_eq!(status, expected);
    }
}
