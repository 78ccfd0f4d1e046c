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

use std::net::{Ipv4Addr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread;

use anyhow::{Result, anyhow};

use dtof_data::options::Refused;

pub use feed::{Device, Feed, Playback};
pub use foxglove::{Foxglove, MOST_CLIENTS};
pub use hub::{Hub, MOST_EVENTS, MOST_PAGES, MOST_PIXELS};
pub use origin::Origin;
pub use outputs::Folder;

/// Most commands that wait for the feed.
const REQUESTS: usize = 16;

/// The terminal of the program that serves the page: prints lines, and names options.
#[derive(Clone, Copy)]
pub struct Terminal {
    /// Writes a line on standard error.
    pub complain: fn(&str),
    /// Gives the name of an option from its key, such as its flag.
    pub name: fn(&str) -> String,
}

/// A page that is ready to be served. Nothing runs yet.
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
    /// Prepares a page of `feed` on `port` of this computer, or on any free port if it is 0. Files are
    /// written into `folder` only. Errors are printed on `terminal` as well.
    ///
    /// # Errors
    /// Fails if the port is taken.
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

    /// Serves Foxglove as well, if it is given.
    #[must_use]
    pub fn with(mut self, foxglove: Option<Foxglove>) -> Self {
        self.foxglove = foxglove;
        self
    }

    /// The state that pages show.
    #[must_use]
    pub fn hub(&self) -> &Arc<Hub> {
        &self.hub
    }

    /// Runs the feed on a thread, and serves the page until `done`, called 20 times a second, returns
    /// true. Then the device stops its sensor, and a recording is completed.
    ///
    /// # Errors
    /// Fails if the page cannot be served, the sensor may still run, or the recording cannot be written.
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
        let (requests, receiver) = mpsc::sync_channel(REQUESTS);
        let stop = AtomicBool::new(false);
        let (served, ended) = thread::scope(|scope| {
            let (hub, stop) = (&hub, &stop);
            let thread = scope.spawn(move || feed.run(hub, &receiver, folder, stop, terminal));
            let served = server::serve(listener, foxglove, hub, requests, terminal, done);
            stop.store(true, Ordering::Relaxed);
            (served, thread.join())
        });
        served.and(ended.map_err(|_| anyhow!("the thread of the device has failed"))?)
    }
}
