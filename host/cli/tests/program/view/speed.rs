//! 100,000 events a second: frames still come, and what is kept is bounded.

use std::time::{Duration, Instant};
#[cfg(target_os = "linux")]
use std::{fs, io::BufReader, path::Path};

use crate::common::Scratch;
#[cfg(target_os = "linux")]
use crate::common::{assert_contains, skipped};
use crate::view::http::{Stream, post};
use crate::view::{Live, device, fast};
#[cfg(target_os = "linux")]
use crate::view::{browser::Browser, until};
#[cfg(target_os = "linux")]
use dtof_data::events::aer_file::Reader;
#[cfg(target_os = "linux")]
use dtof_data::options::rows::grouped;
use dtof_live::{MOST_EVENTS, MOST_PIXELS};
#[cfg(target_os = "linux")]
use serde_json::Value;

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

/// Prints a figure of docs/view.md.
#[test]
#[ignore = "ten seconds, on a computer with nothing else to do"]
fn as_many_events_as_the_link_takes() {
    let (frames, rate) = run(Duration::from_secs(10), None);
    println!("load: {rate:.0} events/s recorded, frames/s of two pages {frames:.1?}");
    assert!(frames.iter().all(|frames| *frames > 5.0));
    assert!(rate > 500_000.0);
}

/// Memory of this process in MB.
#[cfg(target_os = "linux")]
fn memory_mb() -> f64 {
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kb = line.unwrap().trim().strip_suffix(" kB").unwrap();
    kb.parse::<f64>().unwrap() / 1e3
}

/// How many events a recording of the fast device has, and how many it lacks: of those between its first and its last, and
/// of those with the numbers `from..=to`.
#[cfg(target_os = "linux")]
fn recorded(path: &Path, from: u64, to: u64) -> [u64; 2] {
    let mut reader = Reader::new(BufReader::new(fs::File::open(path).unwrap())).unwrap();
    let (mut events, mut first, mut last) = (0, None, 0);
    while let Some(event) = reader.next_event().unwrap() {
        // The first comes in laser cycle 10, each other ten laser cycles after the one before it.
        let cycle = event.cycle().raw();
        assert!(cycle % 10 == 0 && cycle / 10 > last, "{cycle} after {last}");
        last = cycle / 10;
        first.get_or_insert(last);
        events += 1;
    }
    let expected = last.max(to) + 1 - first.unwrap_or(from).min(from);
    [events, expected - events]
}

/// Prints figures of docs/view.md.
#[cfg(target_os = "linux")]
#[test]
#[ignore = "as many minutes as DTOF_MINUTES says, else one, on a computer with nothing else to do"]
fn two_pages_in_chromium_at_100_000_events_a_second() {
    const RATE: u64 = 100_000;
    let minutes = std::env::var("DTOF_MINUTES").map_or(1.0, |text| text.parse::<f64>().unwrap());
    let Some(mut browser) = Browser::start() else {
        skipped("two pages in Chromium", "chromium");
        return;
    };
    let scratch = Scratch::new();
    let live = Live::of(fast::feed(Some(RATE)), Some(&scratch.path("out")));
    Stream::open(live.port, 0).until("live", |frame| frame["connection"]["state"] == "live");
    let address = format!("http://127.0.0.1:{}/", live.port);
    let pages = [(); 2].map(|()| browser.open(&address));
    let frames = |browser: &mut Browser| {
        let counted = pages
            .iter()
            .map(|page| browser.value(page, "[counted.arrived, counted.drawn]"));
        let counted: Vec<[f64; 2]> = counted
            .map(|pair| serde_json::from_value(pair).unwrap())
            .collect();
        [0, 1].map(|what| [counted[0][what], counted[1][what]])
    };
    until("drawn", || {
        frames(&mut browser)[1].iter().all(|drawn| *drawn > 20.0)
    });

    assert_eq!(post(live.port, "/record", "{\"on\":true}").status, 200);
    // An event that arrives while recording starts or ends may be in the recording.
    let from = live.hub.arrived() + 1;
    let begun = Instant::now();
    let before = frames(&mut browser);
    let (mut heaps, mut memory) = (Vec::new(), Vec::new());
    for tenth in 1..=10 {
        while begun.elapsed().as_secs_f64() < 6.0 * minutes * f64::from(tenth) {
            let [pixels, waiting, histograms] = live.hub.memory();
            assert_eq!(pixels, usize::from(fast::PIXELS));
            assert!(waiting <= 3 * MOST_EVENTS && histograms <= 3);
            std::thread::sleep(Duration::from_millis(50));
        }
        heaps.push([0, 1].map(|page| browser.heap(&pages[page]) / 1e6));
        memory.push(memory_mb());
    }
    let after = frames(&mut browser);
    let seconds = begun.elapsed().as_secs_f64();
    let [arrived, drawn] =
        [0, 1].map(|what| [0, 1].map(|page| (after[what][page] - before[what][page]) / seconds));
    for page in &pages {
        let shown = live.hub.arrived();
        let [frame, errors] =
            ["frame", "errors"].map(|what| browser.value(page, &format!("counted.{what}")));
        assert_eq!(errors, serde_json::json!([]));
        let frame: Value = serde_json::from_str(frame.as_str().unwrap()).unwrap();
        // A frame is a second old at most.
        assert!(
            frame["events"].as_u64() > Some(shown - RATE),
            "of {shown}: {frame}"
        );
        for loss in frame["losses"]["counts"].as_array().unwrap() {
            assert_eq!(loss[1], 0, "{loss}");
        }
    }
    let to = live.hub.arrived();
    let answer = post(live.port, "/record", "{\"on\":false}").body;
    let recorded_for = begun.elapsed().as_secs_f64();
    live.end();

    let [events, lost] = recorded(&scratch.path("out/events.aer"), from, to);
    let events_text = grouped(events);
    assert_contains(&answer, &format!("Saved {events_text} events as "));
    let most = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    // What is kept has its full size after a tenth.
    let [early, heap] = [&heaps[..1], &heaps[1..]].map(|some| most(some.as_flattened()));
    let [first, memory] = [&memory[..1], &memory[1..]].map(most);
    let rate = events as f64 / recorded_for;
    println!(
        "load: {minutes} min, {rate:.0} events/s recorded, {lost} of {events_text} lost; two pages in Chromium: \
         {arrived:.1?} frames/s arrive, {drawn:.1?} are drawn; heap {early:.1} MB after a tenth, later {heap:.1} MB at \
         most; memory of the program {first:.1} MB, later {memory:.1} MB at most"
    );
    assert_eq!(lost, 0);
    assert!(rate > 0.95 * RATE as f64);
    assert!(drawn.iter().all(|drawn| *drawn > 5.0));
    assert!(heap < early + 10.0 && heap < 60.0);
    assert!(memory < first + 10.0);
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
