//! How long an event takes from the device's port to the page's socket.

use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use crate::view::Live;
use crate::view::fast::{Fast, feed_of};
use crate::view::http::Stream;

/// An interval that does not coincide with frames.
const RATE: u64 = 37;

/// Sorted milliseconds of `events` events, from the device's port to the hub and to the socket of a
/// page.
fn run(events: u64) -> [Vec<f64>; 2] {
    let ran: Arc<OnceLock<Instant>> = Arc::default();
    let begins = Arc::clone(&ran);
    let live = Live::of(
        feed_of(move || {
            let mut device = Fast::new(Some(RATE));
            device.ran = Arc::clone(&ran);
            device.is_one_pixel = true;
            device
        }),
        None,
    );
    let mut page = Stream::open(live.port, 0);
    let first = page.until("live", |frame| frame["connection"]["state"] == "live");
    let began = *begins.get().unwrap();
    let due = |event: u64| began + Duration::from_secs_f64(event as f64 / RATE as f64);
    let since = |event: u64| {
        let late = Instant::now().saturating_duration_since(due(event));
        late.as_secs_f64() * 1000.0
    };
    let mut sent = Vec::new();
    // The first events are older than this page.
    let mut seen = first["events"].as_u64().unwrap();
    let known = std::thread::scope(|scope| {
        let hub = &live.hub;
        let watcher = scope.spawn(move || {
            let mut next = seen + 1;
            let mut times = Vec::new();
            while next < seen + events {
                let arrived = hub.arrived();
                while next <= arrived {
                    times.push(since(next));
                    next += 1;
                }
                std::thread::sleep(Duration::from_micros(50));
            }
            times
        });
        while (sent.len() as u64) < events {
            let arrived = page.frame()["events"].as_u64().unwrap();
            sent.extend((seen + 1..=arrived).map(since));
            seen = arrived;
        }
        watcher.join().unwrap()
    });
    [known, sent].map(|mut times| {
        times.sort_by(f64::total_cmp);
        times
    })
}

/// A percentile.
fn percentile(times: &[f64], of: usize) -> f64 {
    times[(times.len() - 1) * of / 100]
}

#[test]
fn an_event_reaches_a_page() {
    let [known, sent] = run(20);
    // A frame is due each 100 ms. This computer may be busy.
    assert!(known[0] < 50.0, "{known:?}");
    assert!(percentile(&sent, 50) < 1000.0, "{sent:?}");
    assert!(known[0] <= sent[0]);
}

/// Prints the figures of docs/view.md.
#[test]
#[ignore = "half a minute, on a computer with nothing else to do"]
fn from_the_port_to_the_page() {
    let [known, sent] = run(1000);
    for (name, times) in [("known", known), ("sent", sent)] {
        let of = |of| percentile(&times, of);
        let (median, most) = (of(50), of(99));
        println!("latency: {name} after {median:.2} ms, 99 % within {most:.2} ms");
        assert!(most < 1000.0);
    }
}
