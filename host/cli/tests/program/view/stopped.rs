//! A sensor that has stopped stays off until settings are applied on the page.

use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

use crate::common::{Scratch, assert_contains, names};
use crate::view::device::{Plugged, feed, feed_that_may_be_mute, plugged};
use crate::view::http::{Stream, post};
use crate::view::{Live, until};

/// Waits until the page says that the sensor has stopped, and gives the reason.
#[track_caller]
fn stopped(page: &mut Stream) -> String {
    let frame = page.until("stopped", |frame| frame["connection"]["state"] == "stopped");
    let reason = frame["connection"]["reason"].as_str().unwrap();
    let stripped = reason.strip_suffix("; the button \"Apply\" starts it again");
    stripped.unwrap_or_else(|| panic!("{reason}")).to_owned()
}

/// The sensor stays off, and starts when settings are applied.
#[track_caller]
fn stays_off_until_settings_are_put_in_force(live: &Live, page: &mut Stream, device: &Plugged) {
    let starts = device.starts.load(Ordering::Relaxed);
    thread::sleep(Duration::from_millis(1_500));
    let arrived = live.hub.arrived();
    thread::sleep(Duration::from_millis(200));
    assert_eq!(live.hub.arrived(), arrived);
    assert_eq!(device.starts.load(Ordering::Relaxed), starts);
    // Other commands do not start it, nor do settings that are refused.
    let _ = post(live.port, "/save", "{}");
    let reason = page.frame()["connection"]["reason"].clone();
    for settings in ["l1 = 0\n", "l1 = 60\nl2 = 3\n", "estimator = \"window\"\n"] {
        let refused = post(live.port, "/settings", &format!("[detection]\n{settings}"));
        assert_eq!(refused.status, 422, "{refused:?}");
    }
    thread::sleep(Duration::from_millis(1_200));
    assert_eq!(device.starts.load(Ordering::Relaxed), starts);
    // Only the page that has sent them was told why.
    let other = Stream::open(live.port, 2).frame();
    assert_eq!(other["connection"]["reason"], reason);

    let answer = post(live.port, "/settings", "[detection]\nl1 = 60\n");
    assert_eq!(answer.status, 200, "{answer:?}");
    page.until("live", |frame| {
        frame["connection"]["state"] == "live" && frame["connection"]["reason"] == ""
    });
    page.until("events", |frame| {
        frame["drawn"]["events"].as_u64() > Some(0)
    });
    assert_eq!(device.starts.load(Ordering::Relaxed), starts + 1);
}

#[test]
fn after_a_silence_of_the_host() {
    let (scratch, device) = (Scratch::new(), plugged());
    let out = scratch.path("out");
    let (feed, is_mute) = feed_that_may_be_mute(&device.name);
    let live = Live::of(feed, Some(&out));
    let mut page = Stream::open(live.port, 2);
    page.until("live", |frame| frame["connection"]["state"] == "live");
    assert_eq!(post(live.port, "/record", "{\"on\":true}").status, 200);
    page.until("recorded", |frame| {
        frame["recorded"]["events"].as_u64() > Some(20)
    });
    is_mute.store(true, Ordering::Relaxed);
    thread::sleep(Duration::from_millis(700));
    is_mute.store(false, Ordering::Relaxed);
    assert_eq!(
        stopped(&mut page),
        "the sensor has stopped: the host was silent for 0.2 s"
    );
    stays_off_until_settings_are_put_in_force(&live, &mut page, &device);
    live.end();
    // The earlier recording is complete, and another has begun.
    let names = names(&out);
    assert!(
        names.contains(&"events.aer".to_owned()) && names.contains(&"events-2.aer".to_owned()),
        "{names:?}"
    );
}

#[test]
fn after_a_panic_of_the_firmware() {
    let device = plugged();
    let live = Live::of(feed(&device.name, ""), None);
    let mut page = Stream::open(live.port, 2);
    page.until("events", |frame| {
        frame["drawn"]["events"].as_u64() > Some(0)
    });
    device.panics.store(true, Ordering::Relaxed);
    assert_eq!(
        stopped(&mut page),
        "the device has been restarted (the firmware panicked) and has forgotten this session"
    );
    stays_off_until_settings_are_put_in_force(&live, &mut page, &device);
    live.end();
}

/// A person may have pulled the cable to reach the laser.
#[test]
fn after_its_cable_was_pulled() {
    let device = plugged();
    let live = Live::of(feed(&device.name, ""), None);
    let mut page = Stream::open(live.port, 2);
    page.until("events", |frame| {
        frame["drawn"]["events"].as_u64() > Some(0)
    });
    device.pull.store(true, Ordering::Relaxed);
    let frame = page.until("gone", |frame| frame["connection"]["state"] == "gone");
    assert_contains(
        frame["connection"]["reason"].as_str().unwrap(),
        "the button \"Apply\" starts it again",
    );
    stays_off_until_settings_are_put_in_force(&live, &mut page, &device);
    live.end();
}

#[test]
fn a_page_that_ends_stops_the_sensor() {
    let device = plugged();
    let live = Live::of(feed(&device.name, ""), None);
    Stream::open(live.port, 0).until("live", |frame| frame["connection"]["state"] == "live");
    assert!(device.runs.load(Ordering::Relaxed));
    live.end();
    until("off", || !device.runs.load(Ordering::Relaxed));
    assert_eq!(device.starts.load(Ordering::Relaxed), 1);
}
