//! EVT2: changes of depth as ON and OFF.

use dtof_core::events::Reference;
use dtof_core::fixed::types::U24F8;

use super::*;

const HEADER: &[u8] = b"% evt 2.0\n% format EVT2;height=2;width=3\n% geometry 3x2\n% end\n";

/// Microseconds, column, row and whether it is ON, of each event of an array of 3×2 pixels.
fn evt2(bytes: &[u8]) -> Vec<(u64, u32, u32, bool)> {
    let (words, rest) = bytes.strip_prefix(HEADER).unwrap().as_chunks();
    assert!(rest.is_empty());
    let mut high = None;
    let mut events = Vec::new();
    for word in words {
        let word = u32::from_le_bytes(*word);
        match word >> 28 {
            8 => high = Some(u64::from(word & 0x0fff_ffff) << 6),
            kind @ (0 | 1) => events.push((
                high.unwrap() | u64::from(word >> 22 & 0x3f),
                word >> 11 & 0x7ff,
                word & 0x7ff,
                kind == 1,
            )),
            kind => panic!("word of kind {kind}"),
        }
    }
    events
}

#[test]
fn changes_are_written_in_order_of_time_and_blocks_for_each_pixel() {
    // 10 laser cycles a microsecond. Those of one microsecond stay in the order of the file.
    let events = [
        dynamic(4, 0, 12_349, 60, 1),
        dynamic(2, 1, 12_340, 60, -1),
        dynamic(0, 0, 5, 60, 7),
    ];
    let (summary, out) = exported(&file(&events), Format::Evt2, &options());
    let expected = [
        (0, 0, 0, true),
        (1234, 1, 1, true),
        (1234, 2, 0, false),
        (1234, 2, 1, false),
    ];
    assert_eq!(evt2(&out), expected);
    assert_eq!((summary.written, summary.late), (4, 0));
    // Without events it is the header alone.
    let (summary, out) = exported(&file(&[]), Format::Evt2, &options());
    assert_eq!((summary.written, &out[..]), (0, HEADER));
}

#[test]
fn changes_are_found_in_depth_events_as_the_paper_has_it() {
    // The mean of three goes from bin 50 down by 4 bins three times, 160 mm each, and stays.
    let bins = [50, 50, 50, 38, 38, 38, 38];
    let events = (0..).zip(bins).map(|(at, bin)| depth(5, at * 10, bin));
    let bytes = file(&events.collect::<Vec<_>>());
    for (threshold_mm, reference, microseconds) in [
        (100, Reference::Previous, &[3, 4, 5][..]),
        (170, Reference::Previous, &[]),
        (170, Reference::Reported, &[4]),
    ] {
        let mut options = options();
        options.dynamic_depth.threshold_mm = U24F8::from_num(threshold_mm);
        options.dynamic_depth.reference = reference;
        let (summary, out) = exported(&bytes, Format::Evt2, &options);
        let expected: Vec<_> = microseconds
            .iter()
            .map(|&time| (time, 2, 1, false))
            .collect();
        assert_eq!(evt2(&out), expected, "{threshold_mm} {reference:?}");
        assert_eq!(summary.written, expected.len() as u64);
    }
}

#[test]
fn an_array_that_is_too_large_and_a_threshold_of_nothing_are_refused() {
    for (columns, rows, is_held) in [
        (2048, 1, true),
        (1, 2048, true),
        (2049, 1, false),
        (1, 2049, false),
    ] {
        let header = Header {
            array: Array::new(columns, rows).unwrap(),
            ..header()
        };
        let result = try_export(&file_with(&header, &[]), Format::Evt2, &Options::default());
        let expected = match is_held {
            true => Ok(()),
            false => Err(format!(
                "out: an array of {columns}x{rows}: EVT2 holds at most 2048x2048"
            )),
        };
        assert_eq!(result.map(|_| ()), expected);
    }
    let expected = "threshold_mm 0.05: the threshold of dynamic depth is less than 1/512 bin";
    let mut options = options();
    // A third of 1/256 bin.
    options.dynamic_depth.threshold_mm = U24F8::lit("0.05");
    assert_eq!(refused(&file(&[]), Format::Evt2, &options), expected);
}
