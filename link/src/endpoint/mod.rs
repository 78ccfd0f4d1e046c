//! One end of the link: messages arrive whole, once and in order, or not yet.
//!
//! Every frame carries, beside its message, two numbers: that of the message its
//! sender expects next, and the first one it has no room for. An end keeps a message
//! until it is acknowledged, and sends it again when that takes too long. A message
//! that is not the expected one is dropped and comes again. A receiver that does not
//! take its messages closes its window, which stops the sender: back-pressure, not
//! loss.
//!
//! Sequence numbers have 8 bits and a window holds a few messages, so a number never
//! stands for two messages at once. The host draws a new session at each start, which
//! keeps frames of an earlier life apart.

mod receive;
mod transmit;

use heapless::{Deque, Vec};

use crate::StopReason;
use crate::frame::PAYLOAD_BYTES;

/// The most bytes a message holds.
pub const BODY_BYTES: usize = PAYLOAD_BYTES - HEADER_BYTES;
/// Messages under way, and messages that wait to be taken.
pub const WINDOW: usize = 4;
/// A message not acknowledged for so long is sent again. Each repetition doubles the
/// wait, up to [`RETRANSMIT_MOST_MS`]. Every eight messages that arrive at once halve it.
pub const RETRANSMIT_MS: u32 = 100;
/// The longest wait.
pub const RETRANSMIT_MOST_MS: u32 = 1600;
/// An end with nothing to say says so this often.
pub const KEEP_ALIVE_MS: u32 = 50;

/// Bytes of a greeting, the description an end gives of itself when a session begins.
pub const GREETING_BYTES: usize = 8;

const HEADER_BYTES: usize = 6;
/// Messages that arrive before the wait is halved.
const PATIENCE: u8 = 8;
const WINDOW_U8: u8 = 4;

/// Kinds below this one are numbered; the others stand outside the sequence.
const FIRST_UNNUMBERED: u8 = 0xf0;
/// Those of a host lie below this one, those of a device from it on.
const FIRST_OF_DEVICE: u8 = 0x80;
/// Carries no message. A device's has another kind than a host's: where a line sends a device
/// its own frames back, they are not taken for a host that is alive.
const KEEP_ALIVE: u8 = 0xf0;
const KEEP_ALIVE_OF_DEVICE: u8 = 0xf4;
/// The host begins a session.
const HELLO: u8 = 0xf1;
/// The device has begun it.
const WELCOME: u8 = 0xf2;
/// The device knows no such session; in its body, why its sensor stopped last.
const NO_SESSION: u8 = 0xf3;
/// The host ends its session.
const END: u8 = 0xf5;

/// A numbered message: what it is and what it says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Its kind, below 0xf0.
    pub kind: u8,
    /// Its content.
    pub body: Vec<u8, BODY_BYTES>,
}

/// The window is full: no further message may be under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Full;

impl core::fmt::Display for Full {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("as many messages are under way as may be")
    }
}

impl core::error::Error for Full {}

/// Losses and repairs on the way, since the end was made.
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

/// One end. The host draws sessions, the device follows.
#[derive(Debug)]
pub struct Endpoint {
    host: bool,
    session: u16,
    open: bool,
    /// A session began and nobody has asked yet.
    began: bool,
    /// The host has ended the session, and nobody has asked yet.
    ended: bool,
    /// The host ends its session, and waits to hear that the device has forgotten it.
    ending: bool,
    /// The device has forgotten the session.
    lost: bool,
    /// Why the device's sensor stopped last, by its number: what a device says, or what a host
    /// was told.
    stop_reason: u8,
    greeting: [u8; GREETING_BYTES],
    peer_greeting: [u8; GREETING_BYTES],
    /// Not acknowledged yet; the front one has the number `first`.
    outbox: Deque<Message, WINDOW>,
    first: u8,
    /// How many of the outbox have been sent, and how many had been before they
    /// are sent again.
    sent: u8,
    sent_before: u8,
    /// The first number the other end has no room for.
    peer_limit: u8,
    /// Arrived and not taken yet.
    inbox: Deque<Message, WINDOW>,
    /// The number that comes next.
    expected: u8,
    /// A message of the session has arrived.
    has_received: bool,
    /// An unnumbered frame that is due, and the session it is about.
    reply: Option<(u8, u16)>,
    acknowledge: bool,
    progress_ms: u32,
    /// How long until what is under way is sent again.
    wait_ms: u32,
    /// Messages acknowledged since it was last changed.
    quiet: u8,
    /// The first message is being sent again, and goes alone.
    alone: bool,
    spoke_ms: u32,
    heard_ms: u32,
    counters: LinkCounters,
}

impl Endpoint {
    /// The host's end, which opens `session` (a number not used just before).
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
            quiet: 0,
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

    /// Whether a session began since this was last asked. All that belonged to
    /// the session before is gone.
    pub const fn take_began(&mut self) -> bool {
        core::mem::replace(&mut self.began, false)
    }

    /// Whether the device has said that it knows nothing of this session, as
    /// after a restart. It does not come back.
    #[must_use]
    pub const fn is_lost(&self) -> bool {
        self.lost
    }

    /// Why the device's sensor stopped last, as the device said when it had forgotten the
    /// session.
    #[must_use]
    pub const fn stop_reason(&self) -> Option<StopReason> {
        StopReason::from_number(self.stop_reason)
    }

    /// What a device tells a host whose session it has forgotten.
    pub const fn set_stop_reason(&mut self, reason: StopReason) {
        self.stop_reason = reason as u8;
    }

    /// Ends the host's session: the device stops its sensor. [`Self::is_lost`] tells when the
    /// device has heard it. Nothing else is sent from now on.
    pub const fn end(&mut self, now_ms: u32) {
        self.ending = true;
        // It is due at once.
        self.spoke_ms = now_ms.wrapping_sub(KEEP_ALIVE_MS);
    }

    /// Forgets the session, as if the host had ended it.
    pub fn close(&mut self) {
        self.forget();
    }

    /// Messages that have arrived and were not taken.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.inbox.len()
    }

    /// Whether the host has ended its session since this was last asked. All that belonged to
    /// the session is gone.
    pub const fn take_ended(&mut self) -> bool {
        core::mem::replace(&mut self.ended, false)
    }

    /// The greeting of the other end.
    #[must_use]
    pub const fn peer_greeting(&self) -> &[u8; GREETING_BYTES] {
        &self.peer_greeting
    }

    /// Milliseconds since the other end was last heard.
    #[must_use]
    pub const fn silent_ms(&self, now_ms: u32) -> u32 {
        now_ms.wrapping_sub(self.heard_ms)
    }

    /// Losses and repairs on the way so far.
    #[must_use]
    pub const fn counters(&self) -> &LinkCounters {
        &self.counters
    }

    /// Whether [`Self::offer`] has room.
    #[must_use]
    pub fn has_room(&self) -> bool {
        self.room() > 0
    }

    /// Messages that [`Self::offer`] has room for.
    #[must_use]
    pub fn room(&self) -> usize {
        WINDOW - self.outbox.len()
    }

    /// Whether the other end has everything that was offered.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.outbox.is_empty()
    }

    /// Sends a message, sooner or later. Of `body` only [`BODY_BYTES`] are
    /// taken.
    ///
    /// # Errors
    /// [`Full`] while the window is; nothing was taken.
    pub fn offer(&mut self, kind: u8, body: &[u8]) -> Result<(), Full> {
        let taken = body.get(..body.len().min(BODY_BYTES)).unwrap_or_default();
        // There is room for them.
        let _ = self.offer_empty(kind)?.extend_from_slice(taken);
        Ok(())
    }

    /// The same for a body that the caller writes in its place, before anything else is done.
    ///
    /// # Errors
    /// [`Full`] while the window is.
    pub fn offer_empty(&mut self, kind: u8) -> Result<&mut Vec<u8, BODY_BYTES>, Full> {
        let body = Vec::new();
        self.outbox
            .push_back(Message { kind, body })
            .map_err(|_| Full)?;
        let message = self.outbox.back_mut().ok_or(Full)?;
        Ok(&mut message.body)
    }

    /// The next message from the other end, left where it is.
    #[must_use]
    pub fn peek(&self) -> Option<&Message> {
        self.inbox.front()
    }

    /// The next message from the other end.
    pub fn take(&mut self) -> Option<Message> {
        // A window that was closed is open again, which the other end must hear.
        self.acknowledge |= self.inbox.is_full();
        self.inbox.pop_front()
    }
}
