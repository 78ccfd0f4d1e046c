//! `dtof export --format evt2` and `mcap`: order, slices, damaged files. What is in them
//! is checked with other projects' readers by the test `readers` of `dtof-host-tests`.

use crate::common::Scratch;
use crate::common::aer::{HEADER, below, depth, depth_event, dynamic, exported, file};
use dtof_core::events::Reference;
use dtof_core::fixed::types::U24F8;
use dtof_core::{Array, Flags};
use dtof_events::aer_file::Event;
use dtof_events::clock::LaserClock;
use dtof_export::{ExportSummary, Format, Options};

/// Time, column, row and whether it is ON, of each event.
pub fn evt2(bytes: &[u8]) -> Vec<(u64, u32, u32, bool)> {
    let words = below(bytes, "% end\n");
    assert!(words.len().is_multiple_of(4));
    let mut high = None;
    let mut events = Vec::new();
    for word in words.chunks(4) {
        let word = u32::from_le_bytes(word.try_into().unwrap());
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

/// Points, messages of points and messages of statistics.
pub fn mcap(bytes: &[u8]) -> (u64, usize, usize) {
    let summary = mcap::Summary::read(bytes).unwrap().expect("a summary");
    let (clouds, statistics) = (messages(bytes, "/events"), statistics(bytes));
    let message_count = summary.stats.unwrap().message_count;
    assert_eq!(message_count, (clouds.len() + statistics.len()) as u64);
    let last = statistics.last();
    let last = last.map_or(0, |last| last["events_so_far"].as_u64().unwrap());
    (last, clouds.len(), statistics.len())
}

/// The log times and data of the messages of a topic.
fn messages(bytes: &[u8], topic: &str) -> Vec<(u64, Vec<u8>)> {
    let all = mcap::MessageStream::new(bytes).unwrap().map(Result::unwrap);
    all.filter(|message| message.channel.topic == topic)
        .map(|message| (message.log_time, message.data.to_vec()))
        .collect()
}

fn times(bytes: &[u8], topic: &str) -> Vec<u64> {
    let messages = messages(bytes, topic).into_iter();
    messages.map(|message| message.0).collect()
}

/// The messages of statistics.
fn statistics(bytes: &[u8]) -> Vec<serde_json::Value> {
    let parse = |(_, data): &(u64, Vec<u8>)| serde_json::from_slice(data).unwrap();
    messages(bytes, "/statistics").iter().map(parse).collect()
}

/// Ten changes, far apart.
pub fn changes() -> Vec<Event> {
    let near = (0..9).map(|index| dynamic(index * 200, u64::from(index) * 50_000, 40, 1));
    near.chain([dynamic(2047, 1 << 20, 60, -1)]).collect()
}

/// The export of these events without an option.
fn plain(events: &[Event], format: Format) -> (ExportSummary, Vec<u8>) {
    exported(&file(&HEADER, events), format, &Options::default())
}

/// Slices of so many nanoseconds.
fn sliced(slice_ns: Option<u64>) -> Options {
    Options {
        slice_ns,
        ..Options::default()
    }
}

#[test]
fn changes_are_found_as_the_paper_has_them_and_taken_where_they_are() {
    // Three at bin 40, then four at bin 28, 450 mm nearer: the mean goes down by 150 mm
    // three times, then stays.
    let bins = [40, 40, 40, 28, 28, 28, 28];
    let events: Vec<Event> = (0..)
        .zip(bins)
        .map(|(index, bin)| depth(130, index * 1000 + 9, bin))
        .collect();
    let bytes = file(&HEADER, &events);
    let found = |threshold: &str, reference| {
        let mut options = Options::default();
        options.dynamic_depth.threshold_mm = U24F8::lit(threshold);
        options.dynamic_depth.reference = reference;
        let (exported, out) = exported(&bytes, Format::Evt2, &options);
        let events = evt2(&out);
        assert_eq!(exported.written, events.len() as u64);
        events
    };
    let off = |cycle: u64| (cycle * 100, 2, 2, false);
    assert_eq!(found("100", Reference::Previous), [off(3), off(4), off(5)]);
    assert_eq!(found("160", Reference::Previous), []);
    assert_eq!(found("160", Reference::Reported), [off(4)]);

    let (_, out) = plain(&changes(), Format::Evt2);
    let events = evt2(&out);
    assert_eq!(events.len(), 10);
    assert_eq!(events[1], (5000, 8, 3, true));
    assert_eq!(events[9], (104_857, 63, 31, false));
}

#[test]
fn changes_out_of_order_are_put_in_order() {
    let times = [5u64, 3, 9, 1, 9, 7];
    let events: Vec<Event> = (0..)
        .zip(times)
        .map(|(pixel, time)| dynamic(pixel, time * 10, 40, 1))
        .collect();
    let (exported, out) = plain(&events, Format::Evt2);
    let events = evt2(&out).into_iter();
    let order: Vec<_> = events.map(|(time, column, ..)| (time, column)).collect();
    assert_eq!(order, [(1, 3), (3, 1), (5, 0), (7, 5), (9, 2), (9, 4)]);
    assert_eq!(exported.late, 0);
}

#[test]
fn changes_that_are_too_late_are_left_out_and_said() {
    // More events than the buffer holds, then an earlier one.
    let mut events: Vec<Event> = (0..65_600)
        .map(|index| dynamic(1, 1000 + index * 10, 40, 1))
        .collect();
    events.push(dynamic(2, 0, 40, 1));
    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &events));
    for (format, out) in [("evt2", "x.raw"), ("mcap", "x.mcap")] {
        let output = scratch.run(&format!(
            "export events.aer --format {format} --out {out} --laser-hz 10000000"
        ));
        assert!(output.status.success());
        let message = String::from_utf8(output.stderr).unwrap();
        let late = "more than 65,536 later events came before them";
        let expected = format!("events.aer: 1 events were left out of {out}: {late}\n");
        assert_eq!(message, expected);
    }
    let found = evt2(&std::fs::read(scratch.path("x.raw")).unwrap());
    assert!(found.len() == 65_600 && found.is_sorted_by_key(|event| event.0));
    let found = mcap(&std::fs::read(scratch.path("x.mcap")).unwrap());
    assert_eq!(found.0, 65_600);
}

#[test]
fn what_evt2_cannot_hold_is_refused() {
    let scratch = Scratch::new();
    let mut wide = HEADER;
    wide.array = Array::new(2049, 1).unwrap();
    scratch.file("wide.aer", file(&wide, &[]));
    let one = |cycle| file(&HEADER, &[dynamic(0, cycle, 40, 1)]);
    scratch.file("last.aer", one((1 << 34) * 10 - 1));
    scratch.file("late.aer", one((1 << 34) * 10));
    scratch.all_refused(
        "export --format evt2 --out x.raw",
        "
            wide.aer | an array of 2049x1: EVT2 holds at most 2048x2048
            late.aer | late.aer: laser cycle 171798691840 lies beyond, 17179 s after the start: EVT2 holds
            last.aer --threshold-mm 0.004 | --threshold-mm 0.004: the threshold of dynamic
            last.aer --threshold-mm -1 | --threshold-mm
            last.aer --reference next | --reference
        ",
    );
    assert!(!scratch.path("x.raw").exists());
    scratch.printed("export last.aer --format evt2 --out x.raw");
    let last = evt2(&std::fs::read(scratch.path("x.raw")).unwrap());
    assert_eq!(last, [((1 << 34) - 1, 0, 0, true)]);
}

#[test]
fn slices_have_a_cloud_and_statistics_each() {
    let bytes = file(&HEADER, &changes());
    // The run lasts 105 ms.
    for (slice_ns, messages) in [
        (Some(10_000_000), 6),
        (Some(5_000_000), 10),
        (Some(1_000_000_000), 1),
        (None, 10),
    ] {
        let (exported, out) = exported(&bytes, Format::Mcap, &sliced(slice_ns));
        assert_eq!(exported.written, 10);
        assert_eq!(mcap(&out), (10, messages, messages), "{slice_ns:?}");
    }
    // A message holds 65,536 points at most.
    let events: Vec<Event> = (0..70_000).map(|index| depth(7, index, 40)).collect();
    let mut options = sliced(Some(10_000_000));
    options.clock = Some(LaserClock::new(1_000_000_000).unwrap());
    let (_, out) = exported(&file(&HEADER, &events), Format::Mcap, &options);
    assert_eq!(mcap(&out), (70_000, 2, 1));
    // Each has its own time: the start of the slice, or its first point.
    assert_eq!(times(&out, "/events"), [0, 65_536]);
    assert_eq!(times(&out, "/statistics"), [0]);
}

#[test]
fn the_last_slice_ends_with_the_last_event() {
    // One event every 2 µs for 15 ms.
    let events: Vec<Event> = (0..7500)
        .map(|index| depth(7, index * 20 + 19, 40))
        .collect();
    let options = sliced(Some(10_000_000));
    let (_, out) = exported(&file(&HEADER, &events), Format::Mcap, &options);
    let [whole, half] = &statistics(&out)[..] else {
        panic!("not two slices");
    };
    assert_eq!(
        [&whole["events_per_s"], &half["events_per_s"]],
        [500_000.0; 2]
    );
    assert_eq!([&whole["duration_s"], &half["duration_s"]], [0.01, 0.005]);
    // A slice is 1/100 of that by default.
    let (_, out) = plain(&events, Format::Mcap);
    let starts = (0..100).map(|slice| slice * 150_000);
    assert!(times(&out, "/events").into_iter().eq(starts));
}

#[test]
fn flags_are_counted_each() {
    let events = (0..16u8).map(|bits| {
        let mut event = depth_event(bits.into(), bits.into(), 40);
        event.flags = Flags::from_bits(bits).unwrap();
        Event::Depth(event)
    });
    let events: Vec<Event> = events.collect();
    let (_, out) = plain(&events, Format::Mcap);
    let slice = &statistics(&out)[0];
    for name in ["saturated", "clipped", "deferred", "pile_up"] {
        assert_eq!(slice[name], 8, "{name}");
    }
    assert_eq!(slice["flagged"], 15);
}

#[test]
fn files_without_events_are_whole() {
    for format in [Format::Evt2, Format::Mcap] {
        let (exported, out) = plain(&[], format);
        assert_eq!((exported.written, exported.damage), (0, None));
        match format {
            Format::Evt2 => assert_eq!(evt2(&out), []),
            _ => assert_eq!(mcap(&out), (0, 0, 0)),
        }
    }
}
