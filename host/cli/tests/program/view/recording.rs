//! A recording holds every event, also while what is drawn is thinned.

use std::fs::{self, File};
use std::io::BufReader;
use std::time::{SystemTime, UNIX_EPOCH};

use crate::common::{Scratch, assert_contains, names};
use crate::view::http::{Stream, post};
use crate::view::{Live, fast};
use dtof_data::events::aer_file::Reader;
use dtof_data::options::rows::grouped;

fn now_us() -> i64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    i64::try_from(now.as_micros()).unwrap()
}

#[test]
fn a_recording_holds_all_events_while_drawing_is_thinned() {
    let scratch = Scratch::new();
    let out = scratch.path("out");
    fs::create_dir(&out).unwrap();
    fs::write(out.join("events.aer"), "older").unwrap();
    let feed = fast::feed(None);
    let live = Live::of(feed, Some(&out));
    let mut page = Stream::open(live.port, 0);
    page.until("live", |frame| frame["connection"]["state"] == "live");
    // Recording goes on with new settings in another file, from laser cycle 0.
    assert_contains(
        &post(live.port, "/record", "{\"on\":true}").body,
        "events-2.aer",
    );
    let before = now_us();
    assert_eq!(
        post(live.port, "/settings", "[detection]\nl1 = 44").status,
        200
    );
    let after = now_us();
    let frame = page.until("another file", |frame| {
        frame["recorded"]["file"]
            .as_str()
            .unwrap()
            .ends_with("events-3.aer")
    });
    assert_eq!(frame["recorded"]["files"], 1);
    let (mut drawn, mut arrived) = (0, 0);
    let last = page.until("many events", |frame| {
        frame["recorded"]["events"].as_u64() > Some(100_000)
    });
    for _ in 0..5 {
        let frame = page.frame();
        drawn += frame["drawn"]["pixels"].as_u64().unwrap();
        arrived += frame["drawn"]["events"].as_u64().unwrap();
        assert!(frame["pixel"]["drawn"].as_u64() <= frame["pixel"]["arrived"].as_u64());
    }
    assert!(drawn < arrived, "{drawn} of {arrived} drawn");
    assert_eq!(last["recorded"]["error"], "");
    // The device has sent every event up to the last one that is in the file.
    let answer = post(live.port, "/record", "{\"on\":false}").body;
    live.end();
    let mut reader = Reader::new(BufReader::new(
        File::open(out.join("events-3.aer")).unwrap(),
    ))
    .unwrap();
    // Laser cycle 0 is that of the new settings.
    assert!((before..=after).contains(&reader.header().start_us));
    let mut events = 0;
    while let Some(event) = reader.next_event().unwrap() {
        events += 1;
        assert_eq!(event.cycle().raw(), 10 * events, "an event is missing");
    }
    assert_contains(&answer, &format!("Saved {} events as ", grouped(events)));
    assert_eq!(names(&out), ["events-2.aer", "events-3.aer", "events.aer"]);
    assert_eq!(fs::read(out.join("events.aer")).unwrap(), b"older");
}

#[test]
fn a_recording_that_goes_on_at_the_end_is_whole() {
    let scratch = Scratch::new();
    let out = scratch.path("out");
    let feed = fast::feed(Some(10_000));
    let live = Live::of(feed, Some(&out));
    let mut page = Stream::open(live.port, 0);
    page.until("live", |frame| frame["connection"]["state"] == "live");
    post(live.port, "/record", "{\"on\":true}");
    page.until("recorded", |frame| {
        frame["recorded"]["events"].as_u64() > Some(100)
    });
    let hub = std::sync::Arc::clone(&live.hub);
    live.end();
    let mut reader =
        Reader::new(BufReader::new(File::open(out.join("events.aer")).unwrap())).unwrap();
    let (mut first, mut events) = (None, 0);
    while let Some(event) = reader.next_event().unwrap() {
        first.get_or_insert(event.cycle().raw() / 10);
        events += 1;
    }
    // From the first to the last event.
    assert_eq!(first.unwrap() - 1 + events, hub.arrived());
}
