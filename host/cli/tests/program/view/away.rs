//! A device that goes away and comes back.

use std::process::Stdio;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use crate::common::{Scratch, assert_contains, names};
use crate::view::device::{feed, plugged};
use crate::view::http::{Stream, post};
use crate::view::{Live, until};
use dtof_data::events::aer_file::Reader;

#[test]
fn a_device_that_is_unplugged_comes_back_and_so_does_the_recording() {
    let scratch = Scratch::new();
    let out = scratch.path("out");
    let device = plugged();
    let live = Live::of(feed(&device.name, ""), Some(&out));
    let mut page = Stream::open(live.port, 2);
    page.until("live", |frame| frame["connection"]["state"] == "live");
    let answer = post(live.port, "/record", "{\"on\":true}");
    assert_contains(&answer.body, "events.aer");
    page.until("recorded", |frame| {
        frame["recorded"]["events"].as_u64() > Some(20)
    });
    device.pull.store(true, Ordering::Relaxed);
    let frame = page.until("gone", |frame| frame["connection"]["state"] == "gone");
    assert_contains(
        frame["connection"]["reason"].as_str().unwrap(),
        "the device ",
    );
    // It does not start by itself.
    until("taken", || {
        post(live.port, "/settings", "[detection]\nl1 = 40\n").status == 200
    });
    let frame = page.until("back", |frame| frame["connection"]["returned"] == 1);
    assert_eq!(frame["connection"]["state"], "live");
    page.until("events again", |frame| {
        frame["recorded"]["file"]
            .as_str()
            .unwrap()
            .ends_with("events-2.aer")
            && frame["recorded"]["events"].as_u64() > Some(20)
    });
    assert_eq!(post(live.port, "/record", "{\"on\":false}").status, 200);
    let arrived = live.hub.arrived();
    live.end();
    assert_eq!(names(&out), ["events-2.aer", "events.aer"]);
    let mut recorded = 0;
    // Each device's own values.
    for (name, offset_mm) in [("events.aer", 0), ("events-2.aer", 100)] {
        let mut reader = Reader::new(std::fs::File::open(out.join(name)).unwrap()).unwrap();
        assert_eq!(reader.header().offset_mm, offset_mm, "{name}");
        while reader.next_event().unwrap().is_some() {
            recorded += 1;
        }
    }
    assert!(
        recorded > 40 && recorded <= arrived,
        "{recorded} of {arrived}"
    );
}

/// The command ends at once, instead of looking for the device.
#[test]
fn a_device_that_is_not_there_at_the_start_is_an_error() {
    let scratch = Scratch::new();
    for name in ["/dev/none", "tcp:127.0.0.1:1"] {
        let mut command = scratch.command(&format!("view --device {name}"));
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut program = command.spawn().unwrap();
        let begun = Instant::now();
        while program.try_wait().unwrap().is_none() && begun.elapsed().as_secs() < 10 {
            std::thread::sleep(Duration::from_millis(20));
        }
        // Does nothing to a program that has ended.
        program.kill().unwrap();
        let output = program.wait_with_output().unwrap();
        scratch.refused(&output, &[&format!("error: {name}: ")]);
        assert_eq!(output.status.code(), Some(1));
    }
}

#[test]
fn a_device_that_was_never_there_is_named() {
    let live = Live::of(feed("tcp:127.0.0.1:1", ""), None);
    let mut page = Stream::open(live.port, 0);
    let frame = page.until("gone", |frame| frame["connection"]["state"] == "gone");
    assert_contains(
        frame["connection"]["reason"].as_str().unwrap(),
        "tcp:127.0.0.1:1: ",
    );
    let answer = post(live.port, "/save", "{}");
    assert_eq!(answer.status, 422);
    assert_contains(&answer.body, "there is no device: tcp:127.0.0.1:1: ");
    // Settings are tried at once, and the reason is that of the device.
    let answer = post(live.port, "/settings", "[detection]\nl1 = 50\n");
    assert_eq!(answer.status, 422);
    assert_contains(&answer.body, "tcp:127.0.0.1:1: ");
    // Wrong settings are named to the page that has sent them. The others still say why there is no
    // device.
    let answer = post(live.port, "/settings", "[detection]\nalpha = 999\n");
    assert_eq!(answer.status, 422);
    assert_contains(&answer.body, "alpha 999: must be a number from 0");
    for _ in 0..15 {
        let frame = page.frame();
        let reason = frame["connection"]["reason"].as_str().unwrap();
        assert!(reason.starts_with("tcp:127.0.0.1:1: "), "{reason}");
    }
    let begun = Instant::now();
    live.end();
    assert!(begun.elapsed() < Duration::from_secs(5));
}

/// Settings that the device refuses at the start can be corrected on the page.
#[test]
fn settings_are_mended_while_the_device_refuses_them() {
    let live = Live::of(feed(&plugged().name, "[detection]\nl1 = 60\nl2 = 3"), None);
    let mut page = Stream::open(live.port, 0);
    let frame = page.until("refused", |frame| frame["connection"]["state"] == "gone");
    assert_contains(
        frame["connection"]["reason"].as_str().unwrap(),
        "refuses the configuration",
    );
    // The form shows them for correction.
    let frame = Stream::open(live.port, 2).frame();
    assert_eq!(frame["source"]["settings"]["detection"]["l2"], 3);
    let mut answer = post(live.port, "/settings", "[detection]\nl1 = 60\n");
    until("taken", || {
        if answer.status != 200 {
            answer = post(live.port, "/settings", "[detection]\nl1 = 60\n");
        }
        answer.status == 200
    });
    page.until("live", |frame| frame["connection"]["state"] == "live");
}
