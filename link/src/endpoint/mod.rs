//! One end of the link: messages arrive whole, once and in order.
//!
//! Besides its message every frame carries two numbers: that of the message its sender
//! expects next, and the first one it has no room for. An end keeps a message until it is
//! acknowledged, and sends it again after a timeout. A message out of order is dropped and
//! comes again. If the messages of a receiver are not taken, it closes its window, which
//! stops the sender: there is back-pressure, but no loss.
//!
//! Sequence numbers have 8 bits and a window has a few messages, so a number never means
//! two messages at once. The host chooses a new session number at each start, so that frames
//! of an earlier session are recognised.

mod receive;
mod transmit;

use heapless::{Deque, Vec};

use crate::StopReason;
use crate::frame::PAYLOAD_BYTES;

/// The most bytes of a message's body.
pub const BODY_BYTES: usize = PAYLOAD_BYTES - HEADER_BYTES;
/// The most messages in flight, and the most that wait to be taken.
pub const WINDOW: usize = 4;
/// A message that is not acknowledged for this long is sent again. Each repetition doubles
/// the wait, up to [`RETRANSMIT_MOST_MS`]. Eight acknowledged messages without a repetition halve it.
pub const RETRANSMIT_MS: u32 = 100;
/// The longest wait.
pub const RETRANSMIT_MOST_MS: u32 = 1600;
/// An end with nothing to send sends a keep-alive this often.
pub const KEEP_ALIVE_MS: u32 = 50;

/// Bytes of a greeting, in which an end describes itself when a session begins.
pub const GREETING_BYTES: usize = 8;

const HEADER_BYTES: usize = 6;
/// Messages that are acknowledged before the wait is halved.
const PATIENCE: u8 = 8;
const WINDOW_U8: u8 = 4;

/// Kinds below this one are numbered; the others are outside the sequence.
const FIRST_UNNUMBERED: u8 = 0xf0;
/// A host's kinds are below this one, a device's begin with it.
const FIRST_OF_DEVICE: u8 = 0x80;
/// Carries no message. Devices have a kind of their own: a line that echoes a device's frames
/// must not look like a host that is alive.
const KEEP_ALIVE: u8 = 0xf0;
const KEEP_ALIVE_OF_DEVICE: u8 = 0xf4;
/// The host begins a session.
const HELLO: u8 = 0xf1;
/// The device has begun it.
const WELCOME: u8 = 0xf2;
/// The device has no such session; the body says why its sensor stopped last.
const NO_SESSION: u8 = 0xf3;
/// The host ends its session.
const END: u8 = 0xf5;

/// A numbered message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Its kind, below 0xf0.
    pub kind: u8,
    /// Its body.
    pub body: Vec<u8, BODY_BYTES>,
}

/// The window is full: no further message can be sent yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Full;

impl core::fmt::Display for Full {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("the window is full")
    }
}

impl core::error::Error for Full {}

/// Losses and repairs on the wire, since the end was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LinkCounters {
    /// Frames received whole.
    pub frames: u32,
    /// Not COBS, a wrong checksum, or too short.
    pub corrupt: u32,
    /// Longer than a frame can be.
    pub oversized: u32,
    /// Frames of another session, or of a kind that does not exist.
    pub foreign: u32,
    /// Messages dropped because one before them is missing, or there is no
    /// room; they come again.
    pub out_of_order: u32,
    /// Messages that had arrived before.
    pub duplicate: u32,
    /// Messages sent again.
    pub retransmitted: u32,
}

/// One end. The host begins sessions, the device follows.
#[derive(Debug)]
pub struct Endpoint {
    host: bool,
    session: u16,
    open: bool,
    /// A session began since `take_began`.
    began: bool,
    /// The host has ended the session since `take_ended`.
    ended: bool,
    /// The host ends its session, until the device has forgotten it.
    ending: bool,
    /// The device has forgotten the session.
    lost: bool,
    /// The number of the reason why the device's sensor stopped last.
    stop_reason: u8,
    greeting: [u8; GREETING_BYTES],
    peer_greeting: [u8; GREETING_BYTES],
    /// Not acknowledged yet; the front one has the number `first`.
    outbox: Deque<Message, WINDOW>,
    first: u8,
    /// How many of the outbox have been sent, and how many had been sent before a
    /// repetition.
    sent: u8,
    sent_before: u8,
    /// The first number the other end has no room for.
    peer_limit: u8,
    /// Messages that have arrived and were not taken yet.
    inbox: Deque<Message, WINDOW>,
    /// The number that comes next.
    expected: u8,
    /// A message of the session has arrived.
    has_received: bool,
    /// An unnumbered frame that is due, and its session.
    reply: Option<(u8, u16)>,
    acknowledge: bool,
    progress_ms: u32,
    /// How long until unacknowledged messages are sent again.
    wait_ms: u32,
    /// Messages acknowledged since `wait_ms` last changed, or one was sent again.
    acknowledged_in_a_row: u8,
    /// The first message is sent again, by itself.
    alone: bool,
    spoke_ms: u32,
    heard_ms: u32,
    counters: LinkCounters,
}

impl Endpoint {
    /// The host's end, which opens `session`: a number that was not used recently.
    #[must_use]
    pub const fn host(session: u16, greeting: [u8; GREETING_BYTES], now_ms: u32) -> Self {
        let mut end = Self::closed(greeting);
        end.host = true;
        end.session = session;
        // The first greeting is due at once.
        end.progress_ms = now_ms.wrapping_sub(RETRANSMIT_MS);
        end.heard_ms = now_ms;
        end
    }

    /// The device's end, which waits for a session.
    #[must_use]
    pub const fn device(greeting: [u8; GREETING_BYTES]) -> Self {
        Self::closed(greeting)
    }

    const fn closed(greeting: [u8; GREETING_BYTES]) -> Self {
        Self {
            host: false,
            session: 0,
            open: false,
            began: false,
            ended: false,
            ending: false,
            lost: false,
            stop_reason: 0,
            greeting,
            peer_greeting: [0; GREETING_BYTES],
            outbox: Deque::new(),
            first: 0,
            sent: 0,
            sent_before: 0,
            peer_limit: WINDOW_U8,
            inbox: Deque::new(),
            expected: 0,
            has_received: false,
            reply: None,
            acknowledge: false,
            progress_ms: 0,
            wait_ms: RETRANSMIT_MS,
            acknowledged_in_a_row: 0,
            alone: false,
            spoke_ms: 0,
            heard_ms: 0,
            counters: LinkCounters {
                frames: 0,
                corrupt: 0,
                oversized: 0,
                foreign: 0,
                out_of_order: 0,
                duplicate: 0,
                retransmitted: 0,
            },
        }
    }

    /// Whether there is a session.
    #[must_use]
    pub const fn is_open(&self) -> bool {
        self.open
    }

    /// Whether a session began since the last call. Messages of the session before are
    /// gone.
    pub const fn take_began(&mut self) -> bool {
        core::mem::replace(&mut self.began, false)
    }

    /// Whether the device has no such session, as after a restart. The session does not
    /// come back.
    #[must_use]
    pub const fn is_lost(&self) -> bool {
        self.lost
    }

    /// Why the device's sensor stopped last, as the device reported with the loss of the
    /// session.
    #[must_use]
    pub const fn stop_reason(&self) -> Option<StopReason> {
        StopReason::from_number(self.stop_reason)
    }

    /// Sets the reason that a device reports to a host whose session it does not have.
    pub const fn set_stop_reason(&mut self, reason: StopReason) {
        self.stop_reason = reason as u8;
    }

    /// Ends the host's session: the device stops its sensor. [`Self::is_lost`] is true once
    /// the device has received this. Nothing else is sent from now on.
    pub const fn end(&mut self, now_ms: u32) {
        self.ending = true;
        // Due at once.
        self.spoke_ms = now_ms.wrapping_sub(KEEP_ALIVE_MS);
    }

    /// Forgets the session. [`Self::take_ended`] does not report this.
    pub fn close(&mut self) {
        self.forget();
    }

    /// The number of messages that have arrived and were not taken.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.inbox.len()
    }

    /// Whether the host has ended its session since the last call. Messages of the session are
    /// gone.
    pub const fn take_ended(&mut self) -> bool {
        core::mem::replace(&mut self.ended, false)
    }

    /// The greeting of the other end.
    #[must_use]
    pub const fn peer_greeting(&self) -> &[u8; GREETING_BYTES] {
        &self.peer_greeting
    }

    /// Milliseconds since the last frame of the other end.
    #[must_use]
    pub const fn silent_ms(&self, now_ms: u32) -> u32 {
        now_ms.wrapping_sub(self.heard_ms)
    }

    /// Losses and repairs so far.
    #[must_use]
    pub const fn counters(&self) -> &LinkCounters {
        &self.counters
    }

    /// Whether [`Self::offer`] has room.
    #[must_use]
    pub fn has_room(&self) -> bool {
        self.room() > 0
    }

    /// The number of messages that [`Self::offer`] has room for.
    #[must_use]
    pub fn room(&self) -> usize {
        WINDOW - self.outbox.len()
    }

    /// Whether the other end has acknowledged every message.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.outbox.is_empty()
    }

    /// Queues a message. Of `body` only the first [`BODY_BYTES`] are taken.
    ///
    /// # Errors
    /// Fails while the window is full; the message is not queued.
    pub fn offer(&mut self, kind: u8, body: &[u8]) -> Result<(), Full> {
        let taken = body.get(..body.len().min(BODY_BYTES)).unwrap_or_default();
        // There is room for them.
        let _ = self.offer_empty(kind)?.extend_from_slice(taken);
        Ok(())
    }

    /// Queues a message and returns its empty body for the caller to write.
    ///
    /// # Errors
    /// Fails while the window is full.
    pub fn offer_empty(&mut self, kind: u8) -> Result<&mut Vec<u8, BODY_BYTES>, Full> {
        let body = Vec::new();
        self.outbox
            .push_back(Message { kind, body })
            .map_err(|_| Full)?;
        let message = self.outbox.back_mut().ok_or(Full)?;
        Ok(&mut message.body)
    }

    /// The next message from the other end, without taking it.
    #[must_use]
    pub fn peek(&self) -> Option<&Message> {
        self.inbox.front()
    }

    /// Takes the next message from the other end.
    pub fn take(&mut self) -> Option<Message> {
        // The window was closed and opens again, which the other end must learn.
        self.acknowledge |= self.inbox.is_full();
        self.inbox.pop_front()
    }
}
