//! The live page: what it serves and to whom, settings, recordings, devices that go and come back,
//! nonsense, and a device that sends 100,000 events a second.

mod away;
#[cfg(target_os = "linux")]
mod browser;
pub mod device;
mod fast;
mod foxglove;
pub mod http;
mod latency;
mod nonsense;
mod page;
mod playback;
mod recording;
mod settings;
mod speed;
mod stopped;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use dtof::complain;
use dtof_data::options::flag;
use dtof_live::{Feed, Folder, Foxglove, Hub, Served, Terminal};

/// A page that is served in this process until it is dropped.
pub struct Live {
    /// Port of the page.
    pub port: u16,
    /// Port of Foxglove, if it is served.
    pub foxglove: u16,
    /// State of the page.
    pub hub: Arc<Hub>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Live {
    /// Serves a feed. Files are written into `folder`.
    #[must_use]
    pub fn of(feed: Feed, folder: Option<&Path>) -> Self {
        Self::with(feed, folder, None)
    }

    /// The same with Foxglove, for pages of these origins.
    #[must_use]
    pub fn with_foxglove(feed: Feed, folder: Option<&Path>, origins: &[&str]) -> Self {
        let origins = origins.iter().map(|origin| origin.parse().unwrap());
        let foxglove = Foxglove::bind(0, origins.collect()).unwrap();
        Self::with(feed, folder, Some(foxglove))
    }

    fn with(feed: Feed, folder: Option<&Path>, foxglove: Option<Foxglove>) -> Self {
        let terminal = Terminal {
            complain,
            name: flag,
        };
        let served = Served::begin(feed, 0, Folder::new(folder).unwrap(), terminal).unwrap();
        let port = port(&served.address);
        let foxglove_port = foxglove
            .as_ref()
            .map_or(0, |foxglove| crate::view::port(foxglove.address()));
        let served = served.with(foxglove);
        let stop = Arc::new(AtomicBool::new(false));
        Self {
            port,
            foxglove: foxglove_port,
            hub: Arc::clone(served.hub()),
            thread: Some(thread::spawn({
                let stop = Arc::clone(&stop);
                move || served.until(|| stop.load(Ordering::Relaxed)).unwrap()
            })),
            stop,
        }
    }

    /// Ends the page and completes the recording.
    pub fn end(mut self) {
        self.join();
    }

    fn join(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let ended = thread.join();
            assert!(ended.is_ok() || thread::panicking());
        }
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.join();
    }
}

/// The port of an address.
fn port(address: &str) -> u16 {
    let port = address.trim_end_matches('/').rsplit_once(':').unwrap();
    port.1.parse().unwrap()
}

/// Waits until a condition holds.
#[track_caller]
pub fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let since = Instant::now();
    while !is_so() {
        assert!(since.elapsed() < Duration::from_secs(60), "never {what}");
        thread::sleep(Duration::from_millis(5));
    }
}
