//! AER files: one that is read whole is written as it was.

use std::io::Cursor;

use dtof::events::aer_file::{Reader, Writer};

/// Any bytes are a file, or an error.
pub fn aer_file(data: &[u8]) {
    let Ok(mut reader) = Reader::new(Cursor::new(data)) else {
        return;
    };
    let header = reader.header().clone();
    let mut writer = Writer::new(Vec::new(), &header).expect("memory");
    let mut events = 0;
    loop {
        match reader.next_event() {
            Ok(Some(event)) => {
                events += 1;
                assert!(events <= data.len() / 16, "more events than words");
                writer.write(&event).expect("memory");
            }
            Ok(None) => break,
            Err(error) => {
                let line = format!("{error:#}");
                assert!(!line.is_empty() && !line.contains('\n'), "{line:?}");
                return;
            }
        }
    }
    // Time words that nothing needs may be there; nothing else may.
    let written = writer.finish().expect("memory");
    let mut again = Reader::new(Cursor::new(&written)).expect("what was written");
    let mut first = Reader::new(Cursor::new(data)).expect("as before");
    for _ in 0..events {
        let (event, same) = (first.next_event(), again.next_event());
        assert_eq!(event.expect("as before"), same.expect("what was written"));
    }
    assert!(again.next_event().expect("what was written").is_none());
}
