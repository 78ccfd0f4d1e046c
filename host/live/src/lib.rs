#![doc = include_str!("../README.md")]
//! ## From a device to a page
//!
//! ```text
//! device, recording → feed (a thread) → Hub → server → pages, Foxglove
//!                       ↑ commands               ↓
//!                       └────────────────────────┘
//! ```

#![deny(clippy::print_stderr, clippy::print_stdout)]

mod feed;
#[cfg(feature = "foxglove")]
mod foxglove;
#[cfg(not(feature = "foxglove"))]
#[path = "no_foxglove.rs"]
mod foxglove;
mod guard;
mod hub;
mod origin;
mod outputs;
mod server;
mod terminal;

use std::net::{Ipv4Addr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread;

use anyhow::{Result, anyhow};

use dtof_options::Refused;

pub use feed::{Device, Feed, Playback};
pub use foxglove::{Foxglove, MOST_CLIENTS};
pub use hub::{Hub, MOST_EVENTS, MOST_PAGES, MOST_PIXELS};
pub use origin::Origin;
pub use outputs::Folder;
pub use terminal::Terminal;

/// Commands that wait for the feed, at most.
const COMMANDS: usize = 16;

/// A page that is ready to be served.
pub struct Served {
    /// Its address.
    pub address: String,
    listener: TcpListener,
    hub: Arc<Hub>,
    feed: Feed,
    folder: Folder,
    foxglove: Option<Foxglove>,
    terminal: Terminal,
}

impl Served {
    /// A page of `feed` on `port` of this computer, 0 for any that is free. Files are written into
    /// `folder` only, what went wrong is told on `terminal`, too. Nothing runs yet.
    ///
    /// # Errors
    /// If the port is taken.
    pub fn begin(feed: Feed, port: u16, folder: Folder, terminal: Terminal) -> Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))
            .map_err(|error| Refused::value("port", port, error.to_string()))?;
        let address = format!("http://{}/", listener.local_addr()?);
        let hub = Arc::new(Hub::new(feed.name(), feed.kind()));
        Ok(Self {
            address,
            listener,
            hub,
            feed,
            folder,
            foxglove: None,
            terminal,
        })
    }

    /// Foxglove is served, too.
    #[must_use]
    pub fn with(mut self, foxglove: Option<Foxglove>) -> Self {
        self.foxglove = foxglove;
        self
    }

    /// What is known now.
    #[must_use]
    pub fn hub(&self) -> &Arc<Hub> {
        &self.hub
    }

    /// Runs the feed on a thread of its own, and serves the page until `done`, asked some times a
    /// second, says so. Then the device rests, and a recording is ended.
    ///
    /// # Errors
    /// If there is no more serving, the device does not rest, or the recording cannot be written.
    pub fn until(self, done: impl Fn() -> bool) -> Result<()> {
        let Self {
            listener,
            hub,
            feed,
            folder,
            foxglove,
            terminal,
            ..
        } = self;
        let (commands, receiver) = mpsc::sync_channel(COMMANDS);
        let stop = AtomicBool::new(false);
        let (served, ended) = thread::scope(|scope| {
            let (hub, stop) = (&hub, &stop);
            let thread = scope.spawn(move || feed.run(hub, &receiver, folder, stop, terminal));
            let served = server::serve(listener, foxglove, hub, commands, terminal, done);
            stop.store(true, Ordering::Relaxed);
            (served, thread.join())
        });
        served.and(ended.map_err(|_| anyhow!("the thread of the device has failed"))?)
    }
}
