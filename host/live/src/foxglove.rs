//! The live data for Foxglove: a websocket on this computer alone, beside the page.
//!
//! ```text
//! Hub → frames, ten a second, made once → a ring of the newest → each client what it wants of them
//! ```
//!
//! The feed never waits for a client. A client that reads slowly misses frames, which are counted
//! and told to it; one that takes nothing is given up.

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

use super::hub::Hub;
use super::origin::Origin;
use super::terminal::Terminal;
use client::Client;
use frames::{Frame, Frames};
use guard::Origins;
use topics::Topic;

use dtof_options::Refused;

/// Between two frames.
const EVERY: Duration = Duration::from_millis(100);
/// Frames that wait for clients, at most: the newest.
const RING: usize = 4;
/// Clients at a time, at most. Others wait to be taken.
pub const MOST_CLIENTS: usize = 16;

/// A port for Foxglove that is ready to be served.
pub struct Foxglove {
    address: String,
    pub(super) listener: TcpListener,
    origins: Vec<Origin>,
}

impl Foxglove {
    /// At `port` of this computer, 0 for any that is free. Pages of `origins` may read, beside
    /// Foxglove's own.
    ///
    /// # Errors
    /// If the port is taken.
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

/// What all clients share.
pub(super) struct App {
    hub: Arc<Hub>,
    origins: Origins,
    frames: broadcast::Sender<Arc<Frame>>,
    /// Clients that want each topic.
    wanted: [AtomicUsize; Topic::ALL.len()],
    /// Somebody wants what may have been said before.
    is_new: AtomicBool,
    /// Of this program, among others that a client may have known.
    began_ms: u128,
    /// What was refused, as far as it was said: each once.
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
            wanted: <_>::default(),
            is_new: AtomicBool::new(false),
            began_ms: now.unwrap_or_default().as_millis(),
            refused: Mutex::default(),
            terminal,
        }
    }

    /// Makes frames of what is wanted, as long as something is.
    pub async fn make_frames(self: Arc<Self>) {
        let mut ticks = interval(EVERY);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut frames = Frames::new();
        loop {
            ticks.tick().await;
            let is_new = self.is_new.swap(false, Ordering::Relaxed);
            let wanted = |topic: Topic| self.wanted[topic.index()].load(Ordering::Relaxed) > 0;
            let frame = frames.next(&self.hub, &wanted, is_new);
            // Nobody reads it if nobody is there.
            let _ = self.frames.send(Arc::new(frame));
        }
    }

    /// Serves a client until it is gone.
    pub async fn serve(self: Arc<Self>, stream: impl AsyncRead + AsyncWrite + Unpin) {
        if let Some(client) = Client::accept(&self, stream).await {
            client.run().await;
        }
    }

    fn wants(&self, topic: Topic) {
        self.wanted[topic.index()].fetch_add(1, Ordering::Relaxed);
        self.is_new.store(true, Ordering::Relaxed);
    }

    fn wants_no_more(&self, topic: Topic) {
        self.wanted[topic.index()].fetch_sub(1, Ordering::Relaxed);
    }

    /// Says once, to who started the program, that somebody was refused.
    fn complain(&self, why: &str) {
        /// Lines, at most.
        const MOST: usize = 8;
        let mut refused = self.refused.lock().unwrap_or_else(PoisonError::into_inner);
        if refused.len() < MOST && !refused.iter().any(|said| said == why) {
            (self.terminal.complain)(&format!("{}: {why}", (self.terminal.name)("foxglove")));
            refused.push(why.to_owned());
        }
    }
}
