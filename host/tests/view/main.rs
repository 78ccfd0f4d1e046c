//! The live page: what it serves and to whom, settings, recordings, devices that go and come back,
//! nonsense, and a device that sends 100,000 events a second.

#[path = "../common/mod.rs"]
mod common;

mod away;
mod device;
mod fast;
mod http;
mod latency;
mod nonsense;
mod page;
mod playback;
mod recording;
mod settings;
mod speed;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use dtof::view::live::{Feed, Folder, Hub, Served};

/// A page that is served in this process until it is dropped.
pub struct Live {
    /// Of this computer.
    pub port: u16,
    /// What is known.
    pub hub: Arc<Hub>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Live {
    /// That of a feed; files go into a folder.
    #[must_use]
    pub fn of(feed: Feed, folder: Option<&Path>) -> Self {
        let served = Served::begin(feed, 0, Folder::new(folder).unwrap()).unwrap();
        let port = served
            .address
            .trim_end_matches('/')
            .rsplit_once(':')
            .unwrap();
        let port = port.1.parse().unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        Self {
            port,
            hub: Arc::clone(served.hub()),
            thread: Some(thread::spawn({
                let stop = Arc::clone(&stop);
                move || served.until(|| stop.load(Ordering::Relaxed)).unwrap()
            })),
            stop,
        }
    }

    /// Ends it, with all that is recorded.
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

/// Waits until something is so.
#[track_caller]
pub fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let since = Instant::now();
    while !is_so() {
        assert!(since.elapsed() < Duration::from_secs(60), "never {what}");
        thread::sleep(Duration::from_millis(5));
    }
}
