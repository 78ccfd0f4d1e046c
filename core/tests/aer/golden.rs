//! The golden file, the words to refuse and the flags of the document.

use dtof_core::{
    AER_VERSION, AerDecoder, AerEncoder, AerError, AerRecord, AerWord, Flags, LaserCycle,
};

use super::document::{
    DOCUMENT, change_of, crc32, event_of, hex, named_values, rows, section, word_of,
};

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
    assert_eq!(bytes.len(), 80);
    assert_eq!(&bytes[..8], b"DTOF-AER");
    assert_eq!(bytes[8..12], [AER_VERSION as u8, 0, 80, 0]);
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
                let cycle = LaserCycle::new(values["cycle"].try_into().unwrap());
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
    assert!(refused.len() >= 19);
    for row in refused {
        let word = AerWord::from_le_bytes(word_of(row[0]));
        let mut decoder = AerDecoder::new();
        if row[1] != AerError::MissingTime.to_string() {
            decoder.decode(AerWord::time(LaserCycle::new(0))).unwrap();
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
        ("tail", Flags::TAIL),
        ("confirmed", Flags::CONFIRMED),
    ] {
        let rows = rows(&section("### Flags"));
        let row = rows.iter().find(|row| row[1] == name).unwrap();
        assert_eq!(flag.bits(), 1 << row[0].parse::<u32>().unwrap());
    }
    for bits in 0..=u8::MAX {
        let flags = Flags::from_bits(bits).map(Flags::bits);
        assert_eq!(flags, (bits < 64).then_some(bits));
    }
}
