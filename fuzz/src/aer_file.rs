//! AER files: one that is read whole is written as it was, and exported.

use std::fs;
use std::io::Cursor;

use dtof_data::events::aer_file::{Reader, Writer};
use dtof_data::options::Named;
use dtof_run::export::{Format, Options, export};

use crate::{folder, is_one_line};

/// Any bytes are a file, or an error.
pub fn aer_file(data: &[u8]) {
    let mut reader = match Reader::new(Cursor::new(data)) {
        Ok(reader) => reader,
        Err(error) => return is_one_line(&error),
    };
    let header = reader.header().clone();
    let mut writer = Writer::new(Vec::new(), &header).expect("memory");
    let mut events = 0;
    let damage = loop {
        match reader.next_event() {
            Ok(Some(event)) => {
                events += 1;
                assert!(events <= data.len() / 16, "more events than words");
                writer.write(&event).expect("memory");
            }
            Ok(None) => break false,
            Err(error) => {
                is_one_line(&error);
                break true;
            }
        }
    };
    exported(data, events, damage);
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

/// In each format what came before the damage is there, and the damage is said.
fn exported(data: &[u8], events: usize, damage: bool) {
    let folder = folder();
    let input = folder.path().join("a.aer");
    fs::write(&input, data).expect("a file");
    for &(name, format, _) in Format::NAMES {
        let out = folder.path().join(name);
        match export(&input, &out, format, &Options::default(), &mut ()) {
            Ok(exported) => {
                assert_eq!(exported.damage.is_some(), damage);
                // An event camera sends a change as several.
                let most = if format == Format::Evt2 { 1 << 16 } else { 1 };
                assert!(exported.written + exported.late <= most * events as u64);
                assert!(out.exists());
            }
            Err(error) => {
                is_one_line(&error);
                assert!(!out.exists());
            }
        }
    }
    assert_eq!(fs::read(&input).expect("the input"), data);
}
