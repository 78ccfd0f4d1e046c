use std::collections::BTreeMap;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use dtof_core::Array;
use dtof_core::events::DynamicDepthEvent;
use dtof_core::fixed::types::{I24F8, U16F16};
use proptest::prelude::*;
use serde_json::Value;

use super::*;
use dtof_data::events::fixtures;

const PIXELS: u16 = 10_000;

fn hub() -> Hub {
    let hub = Hub::new("a test".to_owned(), Kind::Recording);
    hub.begin_recording(Header {
        bins: 128,
        array: Array::new(100, 100).unwrap(),
        bin_width_ps: U16F16::lit("250"),
        offset_mm: I24F8::ZERO,
        offsets_mm: Vec::new(),
        laser_millihertz: 0,
        start_us: 0,
    });
    hub
}

fn event(pixel: u16, cycle: u64) -> Event {
    Event::Depth(fixtures::event(pixel, cycle, 3))
}

/// Pixels of a frame with their numbers of events, and the number of pixels that are left.
fn frame(hub: &Hub, page: &mut Page) -> (Vec<(u16, u32)>, u64, Value) {
    let frame: Value = serde_json::from_str(&hub.frame(page)).unwrap();
    let bytes = BASE64.decode(frame["pixels"].as_str().unwrap()).unwrap();
    let pixels = bytes.chunks_exact(20).map(|record| {
        let number = u16::from_le_bytes(record[..2].try_into().unwrap());
        (number, u32::from_le_bytes(record[4..8].try_into().unwrap()))
    });
    let left = frame["drawn"]["left"].as_u64().unwrap();
    (pixels.collect(), left, frame)
}

#[test]
fn all_pixels_are_sent_even_if_some_change_all_the_time() {
    let hub = hub();
    let all: Vec<Event> = (0..PIXELS).map(|pixel| event(pixel, 9)).collect();
    hub.add_events(&all);
    let mut page = hub.join(0).unwrap();
    let mut seen = BTreeMap::new();
    for number in 0..3 {
        let (pixels, left, _) = frame(&hub, &mut page);
        assert!(pixels.len() <= MOST_PIXELS);
        assert_eq!(left > 0, number < 2, "{number}: {left}");
        seen.extend(pixels);
        hub.add_events(&all[..2000]);
    }
    assert_eq!(seen.len(), usize::from(PIXELS));
    // Afterwards only changed pixels are sent.
    let (pixels, _, _) = frame(&hub, &mut page);
    assert_eq!(pixels.len(), 2000);
    assert_eq!(frame(&hub, &mut page).0, []);
}

#[test]
fn the_state_is_cleared_when_laser_cycles_begin_again() {
    let hub = hub();
    hub.add_events(&[event(7, 9)]);
    let mut old = hub.join(0).unwrap();
    assert_eq!(frame(&hub, &mut old).0, [(7, 1)]);
    let header = hub.state().header.clone().unwrap();
    hub.begin_recording(header);
    let mut new = hub.join(0).unwrap();
    for page in [&mut old, &mut new] {
        assert_eq!(frame(&hub, page).0, []);
    }
    hub.add_events(&[event(8, 9)]);
    for page in [&mut old, &mut new] {
        assert_eq!(frame(&hub, page).0, [(8, 1)]);
    }
}

#[test]
fn the_newest_events_of_a_pixel_wait_and_the_others_are_counted() {
    let hub = hub();
    let mut page = hub.join(7).unwrap();
    let all: Vec<Event> = (1..=1000).map(|cycle| event(7, cycle)).collect();
    hub.add_masked(3);
    hub.add_events(&all);
    assert_eq!(hub.memory(), [PIXELS.into(), MOST_EVENTS, 0]);
    let (_, _, sent) = frame(&hub, &mut page);
    assert_eq!(sent["pixel"]["arrived"], 1000);
    assert_eq!(sent["pixel"]["drawn"], MOST_EVENTS);
    assert_eq!(
        (&sent["events"], &sent["masked"]),
        (&1000.into(), &3.into())
    );
    let bytes = BASE64
        .decode(sent["pixel"]["events"].as_str().unwrap())
        .unwrap();
    let cycles = bytes
        .chunks_exact(24)
        .map(|record| u64::from_le_bytes(record[..8].try_into().unwrap()));
    assert!(cycles.eq(1001 - MOST_EVENTS as u64..=1000));
    // Events that wait are dropped when laser cycles begin again.
    hub.add_events(&all);
    let header = hub.state().header.clone().unwrap();
    hub.begin_recording(header);
    assert_eq!(frame(&hub, &mut page).2["pixel"]["drawn"], 0);
    hub.leave(&page);
    assert_eq!((hub.pages(), hub.watched()), (0, Vec::new()));
}

/// A float in a record.
fn float(record: &[u8], at: usize) -> f32 {
    f32::from_le_bytes(record[at..at + 4].try_into().unwrap())
}

#[test]
fn light_that_was_not_measured_is_nan() {
    let hub = hub();
    let mut page = hub.join(7).unwrap();
    let mut sent = |event| {
        hub.add_events(&[event]);
        let sent = frame(&hub, &mut page).2;
        let bytes = |text: &Value| BASE64.decode(text.as_str().unwrap()).unwrap();
        let (pixel, event) = (bytes(&sent["pixels"]), bytes(&sent["pixel"]["events"]));
        let of_pixel = [8, 12, 16].map(|at| float(&pixel, at));
        (of_pixel, [8, 12, 20].map(|at| float(&event, at)))
    };
    let of_change = |cycle| {
        let depth = fixtures::event(7, cycle, 3);
        let (pixel, level, position) = (depth.pixel, depth.level, depth.position());
        let change = DynamicDepthEvent::new(pixel, level, depth.cycle, position, 256, depth.flags);
        Event::DynamicDepth(change.unwrap())
    };
    let ([range, reflectivity, peak], [same, of_event, background]) = sent(of_change(9));
    assert!(range > 0.0 && range == same);
    for light in [reflectivity, peak, of_event, background] {
        assert!(light.is_nan(), "{light}");
    }
    // A depth event has these values. They stay when a change follows.
    let ([_, reflectivity, peak], [_, of_event, background]) = sent(event(7, 99));
    assert_eq!((peak, of_event, background), (9.0, 9.0, 1.0));
    assert!(reflectivity > 0.0);
    let ([_, kept, peak], [_, of_event, _]) = sent(of_change(199));
    assert_eq!((kept, peak), (reflectivity, 9.0));
    assert!(of_event.is_nan());
}

proptest! {
    /// However events and frames are interleaved, a page ends with the counts of all events.
    #[test]
    fn a_page_ends_with_the_counts_of_all_events(
        batches in prop::collection::vec(prop::collection::vec(0..PIXELS, 0..600), 1..12),
    ) {
        let hub = hub();
        let mut page = hub.join(0).unwrap();
        let (mut counts, mut seen) = (BTreeMap::new(), BTreeMap::new());
        for (cycle, batch) in batches.iter().enumerate() {
            let events: Vec<Event> = batch.iter().map(|&pixel| event(pixel, cycle as u64 + 9)).collect();
            hub.add_events(&events);
            for pixel in batch {
                *counts.entry(*pixel).or_insert(0_u32) += 1;
            }
            seen.extend(frame(&hub, &mut page).0);
        }
        while !frame(&hub, &mut page).0.is_empty() {}
        prop_assert_eq!(seen, counts);
    }
}

#[cfg(feature = "foxglove")]
#[test]
fn the_newest_events_wait_for_subscribers_and_all_are_counted() {
    let hub = hub();
    let all: Vec<Event> = (0..3).map(|pixel| event(pixel, 9)).collect();
    hub.add_events(&all);
    // Earlier events were not requested.
    assert!(hub.snapshot(true, None).events.is_empty());
    hub.add_masked(7);
    hub.add_events(&all);
    let snapshot = hub.snapshot(true, None);
    assert_eq!((snapshot.events.len(), snapshot.dropped), (3, 0));
    assert_eq!((snapshot.arrived, snapshot.masked), (6, 7));
    let most = dtof_run::export::foxglove::MOST_POINTS;
    let many: Vec<Event> = (0..most as u64 + 5).map(|cycle| event(1, cycle)).collect();
    hub.add_events(&many);
    assert_eq!(hub.memory()[1], most);
    let snapshot = hub.snapshot(true, None);
    assert_eq!((snapshot.events.len(), snapshot.dropped), (most, 5));
    assert_eq!(snapshot.events[0].cycle().raw(), 5);
    let statistics = snapshot.statistics.over(0, 1, 0);
    let statistics = serde_json::to_value(statistics).unwrap();
    assert_eq!(statistics["events"], most + 5);
    assert_eq!(statistics["pixels"], 1);
    // Events that wait when laser cycles begin again are dropped, and so are events of no pixel.
    hub.add_events(&all);
    hub.begin_recording(Header {
        bins: 128,
        array: Array::new(2, 1).unwrap(),
        bin_width_ps: U16F16::lit("250"),
        offset_mm: I24F8::ZERO,
        offsets_mm: Vec::new(),
        laser_millihertz: 0,
        start_us: 0,
    });
    hub.add_events(&all);
    let snapshot = hub.snapshot(false, None);
    assert_eq!((snapshot.events.len(), snapshot.dropped), (2, 4));
    hub.add_events(&all);
    assert_eq!(hub.memory()[1], 0);
}
