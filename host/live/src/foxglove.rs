//! A server for Foxglove: a WebSocket on this computer alone, beside the page.
//!
//! ```text
//! Hub → ten frames a second, the same for all → ring of the newest → each client its topics
//! ```
//!
//! The feed never waits for a client. A slow client misses frames and is told how many. A client that
//! reads nothing is disconnected.

mod client;
mod frames;
mod guard;
mod protocol;
mod topics;

use std::net::{Ipv4Addr, TcpListener};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::Result;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::sync::broadcast;
use tokio::time::{MissedTickBehavior, interval};

use super::Terminal;
use super::hub::Hub;
use super::origin::Origin;
use client::Client;
use frames::{Frame, Frames};
use guard::Origins;
use topics::Topic;

use dtof_data::options::Refused;

/// Interval of frames.
const EVERY: Duration = Duration::from_millis(100);
/// Most frames that wait for clients: the newest.
const RING: usize = 4;
/// Most clients at a time. Others wait to be accepted.
pub const MOST_CLIENTS: usize = 16;

/// A port for Foxglove that is ready to be served.
pub struct Foxglove {
    address: String,
    pub(super) listener: TcpListener,
    origins: Vec<Origin>,
}

impl Foxglove {
    /// Listens at `port` of this computer, or at any free port if it is 0. Pages of `origins` may
    /// connect, and Foxglove's own.
    ///
    /// # Errors
    /// Fails if the port is taken.
    pub fn bind(port: u16, origins: Vec<Origin>) -> Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))
            .map_err(|error| Refused::value("foxglove", port, error.to_string()))?;
        Ok(Self {
            address: format!("ws://{}", listener.local_addr()?),
            listener,
            origins,
        })
    }

    /// Its address.
    #[must_use]
    pub fn address(&self) -> &str {
        &self.address
    }
}

/// State that all clients share.
pub(super) struct App {
    hub: Arc<Hub>,
    origins: Origins,
    frames: broadcast::Sender<Arc<Frame>>,
    /// Number of subscribers of each topic.
    subscribers: [AtomicUsize; Topic::ALL.len()],
    /// A client has subscribed. It needs values that have not changed, too.
    has_new_subscriber: AtomicBool,
    /// Start of this program, which tells it from other programs a client may have seen.
    began_ms: u128,
    /// Refusals that were printed.
    refused: Mutex<Vec<String>>,
    terminal: Terminal,
}

impl App {
    pub fn new(hub: Arc<Hub>, foxglove: &Foxglove, terminal: Terminal) -> Self {
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        Self {
            hub,
            origins: Origins::new(&foxglove.origins),
            frames: broadcast::Sender::new(RING),
            subscribers: <_>::default(),
            has_new_subscriber: AtomicBool::new(false),
            began_ms: now.unwrap_or_default().as_millis(),
            refused: Mutex::default(),
            terminal,
        }
    }

    /// Makes frames of the topics that have subscribers.
    pub async fn make_frames(self: Arc<Self>) {
        let mut ticks = interval(EVERY);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut frames = Frames::default();
        loop {
            ticks.tick().await;
            let resend = self.has_new_subscriber.swap(false, Ordering::Relaxed);
            let is_subscribed =
                |topic: Topic| self.subscribers[topic.index()].load(Ordering::Relaxed) > 0;
            let frame = frames.next(&self.hub, &is_subscribed, resend);
            // Sending fails without clients.
            let _ = self.frames.send(Arc::new(frame));
        }
    }

    /// Serves a client until it is gone.
    pub async fn serve(self: Arc<Self>, stream: impl AsyncRead + AsyncWrite + Unpin) {
        if let Some(client) = Client::accept(&self, stream).await {
            client.run().await;
        }
    }

    fn subscribe(&self, topic: Topic) {
        self.hub.set_visited();
        self.subscribers[topic.index()].fetch_add(1, Ordering::Relaxed);
        self.has_new_subscriber.store(true, Ordering::Relaxed);
    }

    fn unsubscribe(&self, topic: Topic) {
        self.subscribers[topic.index()].fetch_sub(1, Ordering::Relaxed);
    }

    /// Prints a refusal on the terminal, each once.
    fn complain(&self, why: &str) {
        /// Most lines.
        const MOST: usize = 8;
        let mut refused = self.refused.lock().unwrap_or_else(PoisonError::into_inner);
        if refused.len() < MOST && !refused.iter().any(|printed| printed == why) {
            (self.terminal.complain)(&format!("{}: {why}", (self.terminal.name)("foxglove")));
            refused.push(why.to_owned());
        }
    }
}
