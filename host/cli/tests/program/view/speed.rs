//! 100,000 events a second: frames still come, and what is kept is bounded.

use std::time::{Duration, Instant};

use crate::common::Scratch;
use crate::view::http::{Stream, post};
use crate::view::{Live, device, fast};
use dtof_live::{MOST_EVENTS, MOST_PIXELS};

/// Runs two pages and a recording. Returns frames a second of each page and recorded events a second.
fn run(length: Duration, rate: Option<u64>) -> ([f64; 2], f64) {
    let scratch = Scratch::new();
    let feed = fast::feed(rate);
    let live = Live::of(feed, Some(&scratch.path("out")));
    Stream::open(live.port, 0).until("live", |frame| frame["connection"]["state"] == "live");
    assert_eq!(post(live.port, "/record", "{\"on\":true}").status, 200);
    let begun = Instant::now();
    let frames = std::thread::scope(|scope| {
        let pages = [0, 4095].map(|pixel| {
            let port = live.port;
            scope.spawn(move || {
                let mut page = Stream::open(port, pixel);
                let mut frames = 0;
                while begun.elapsed() < length {
                    let frame = page.frame();
                    frames += 1;
                    let drawn = frame["drawn"]["pixels"].as_u64().unwrap();
                    assert!(drawn <= MOST_PIXELS as u64);
                    assert!(frame["pixel"]["drawn"].as_u64() <= Some(MOST_EVENTS as u64));
                }
                f64::from(frames) / begun.elapsed().as_secs_f64()
            })
        });
        while begun.elapsed() < length {
            let [pixels, waiting, histograms] = live.hub.memory();
            assert_eq!(pixels, usize::from(fast::PIXELS));
            assert!(waiting <= 3 * MOST_EVENTS && histograms <= 3);
            std::thread::sleep(Duration::from_millis(50));
        }
        pages.map(|page| page.join().unwrap())
    });
    let answer = post(live.port, "/record", "{\"on\":false}").body;
    let seconds = begun.elapsed().as_secs_f64();
    let saved = answer
        .strip_prefix("Saved ")
        .and_then(|rest| rest.split_once(" events"));
    let saved: f64 = saved.unwrap().0.replace(',', "").parse().unwrap();
    (frames, saved / seconds)
}

#[test]
fn frames_come_and_memory_is_bounded_whatever_comes() {
    let (frames, rate) = run(Duration::from_secs(3), None);
    assert!(frames.iter().all(|frames| *frames > 1.0), "{frames:?}");
    assert!(rate > 1000.0, "{rate}");
}

/// Prints the figures of docs/view.md.
#[test]
#[ignore = "a minute, on a computer with nothing else to do"]
fn a_minute_at_100_000_events_a_second() {
    let (frames, rate) = run(Duration::from_secs(60), Some(100_000));
    println!("view: {rate:.0} events/s recorded, frames/s of two pages {frames:.1?}");
    let (frames, rate) = run(Duration::from_secs(10), None);
    println!("view: unpaced {rate:.0} events/s, frames/s of two pages {frames:.1?}");
}

/// Serves pages for a browser: of the fast device, of a sensor, and of no device.
#[test]
#[ignore = "for looking at, as long as DTOF_VIEW_SECONDS says"]
fn pages_to_look_at() {
    let seconds = std::env::var("DTOF_VIEW_SECONDS").map_or(60, |text| text.parse().unwrap());
    let scratch = Scratch::new();
    let plugged = device::plugged();
    let feeds = [
        fast::feed(Some(100_000)),
        device::feed(&plugged.name, ""),
        device::feed("tcp:127.0.0.1:1", ""),
    ];
    let out = scratch.path("out");
    let pages = feeds.map(|feed| Live::of(feed, Some(&out)));
    for page in &pages {
        println!("http://127.0.0.1:{}/", page.port);
    }
    std::thread::sleep(Duration::from_secs(seconds));
}
