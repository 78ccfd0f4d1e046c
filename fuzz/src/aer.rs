//! AER words: what is decoded is encoded as it was, and time words are always enough.

use dtof_core::{AerDecoder, AerEncoder, AerRecord, AerWord};

/// Any bytes are words; what one means is sent on as the same bytes.
pub fn aer(data: &[u8]) {
    let (mut decoder, mut encoder) = (AerDecoder::new(), AerEncoder::new());
    let mut again = AerDecoder::new();
    let mut began = None;
    for bytes in data.as_chunks::<{ AerWord::BYTES }>().0 {
        let word = AerWord::from_le_bytes(*bytes);
        assert_eq!(word.to_le_bytes(), *bytes);
        let Ok(record) = decoder.decode(word) else {
            continue;
        };
        let (time, word) = match &record {
            AerRecord::Event(event) => encoder.encode(event),
            AerRecord::DynamicDepth(event) => encoder.encode_dynamic_depth(event),
            AerRecord::Time(cycle) => {
                began = Some(*cycle);
                assert_eq!(AerWord::time(*cycle).to_le_bytes(), *bytes);
                continue;
            }
            AerRecord::End { events, checksum } => {
                assert_eq!(AerWord::end(*events, *checksum).to_le_bytes(), *bytes);
                continue;
            }
            other => panic!("no test for {other:?}"),
        };
        assert!(began.is_some(), "an event without a time");
        assert_eq!(word.to_le_bytes(), *bytes);
        if let Some(time) = time {
            assert!(again.decode(time).is_ok());
        }
        assert_eq!(again.decode(word), Ok(record));
    }
}
