//! The receiving half of an endpoint.

use heapless::Vec;

use super::{
    BODY_BYTES, END, Endpoint, FIRST_OF_DEVICE, FIRST_UNNUMBERED, GREETING_BYTES, HEADER_BYTES,
    HELLO, KEEP_ALIVE, KEEP_ALIVE_OF_DEVICE, Message, NO_SESSION, PATIENCE, RETRANSMIT_MS, WELCOME,
};
use crate::frame::FrameError;

/// Adds one. Counters wrap, because readers compare differences.
pub(super) const fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}

impl Endpoint {
    /// Takes a frame, or an error, from a [`Deframer`](crate::frame::Deframer).
    pub fn receive(&mut self, frame: Result<&[u8], FrameError>, now_ms: u32) {
        match frame {
            Ok(payload) => self.frame(payload, now_ms),
            Err(FrameError::Corrupt) => count(&mut self.counters.corrupt),
            Err(FrameError::Oversized) => count(&mut self.counters.oversized),
        }
    }

    fn frame(&mut self, payload: &[u8], now_ms: u32) {
        let Some((&[kind, session0, session1, number, expects, limit], body)) =
            payload.split_first_chunk::<HEADER_BYTES>()
        else {
            count(&mut self.counters.corrupt);
            return;
        };
        if body.len() > BODY_BYTES {
            count(&mut self.counters.oversized);
            return;
        }
        count(&mut self.counters.frames);
        let session = u16::from_le_bytes([session0, session1]);
        let ours = self.open && session == self.session;
        match kind {
            HELLO if !self.host => {
                let Some(greeting) = body.first_chunk() else {
                    count(&mut self.counters.corrupt);
                    return;
                };
                // After a message of the session a greeting comes only from another host
                // with the same session number.
                if !ours || self.has_received {
                    self.begin(session, *greeting);
                }
                self.reply = Some((WELCOME, session));
            }
            WELCOME if self.host && session == self.session => {
                if let (false, Some(greeting)) = (self.open, body.first_chunk()) {
                    self.begin(session, *greeting);
                }
            }
            NO_SESSION if self.host && ours => {
                self.lost = true;
                self.stop_reason = body.first().copied().unwrap_or(0);
            }
            END if !self.host && ours => {
                self.forget();
                self.ended = true;
                self.reply = Some((NO_SESSION, session));
            }
            KEEP_ALIVE if ours && !self.host => self.acknowledged(expects, limit, now_ms),
            KEEP_ALIVE_OF_DEVICE if ours && self.host => self.acknowledged(expects, limit, now_ms),
            0..FIRST_UNNUMBERED if ours && self.host == (kind >= FIRST_OF_DEVICE) => {
                self.acknowledged(expects, limit, now_ms);
                self.numbered(kind, number, body);
            }
            _ => {
                count(&mut self.counters.foreign);
                // Only frames of a host are answered, never answers.
                let is_of_host = matches!(kind, 0..FIRST_OF_DEVICE | KEEP_ALIVE | END);
                if !self.host && is_of_host {
                    self.reply = Some((NO_SESSION, session));
                }
                return;
            }
        }
        self.heard_ms = now_ms;
    }

    fn begin(&mut self, session: u16, peer_greeting: [u8; GREETING_BYTES]) {
        self.forget();
        self.session = session;
        self.open = true;
        self.began = true;
        self.peer_greeting = peer_greeting;
    }

    /// Becomes an end without a session.
    pub(super) fn forget(&mut self) {
        *self = Self {
            host: self.host,
            // Also if the session begins now.
            ending: self.ending,
            counters: self.counters,
            stop_reason: self.stop_reason,
            ..Self::closed(self.greeting)
        };
    }

    /// The other end has all messages before `expects`, and room up to `limit`.
    fn acknowledged(&mut self, expects: u8, limit: u8, now_ms: u32) {
        let arrived = expects.wrapping_sub(self.first);
        if arrived > self.sent_before {
            return; // older than the last one
        }
        for _ in 0..arrived {
            self.outbox.pop_front();
        }
        if arrived > 0 {
            self.progress_ms = now_ms;
            self.alone = false;
            self.acknowledged_in_a_row = self.acknowledged_in_a_row.saturating_add(arrived);
            if self.acknowledged_in_a_row >= PATIENCE {
                self.acknowledged_in_a_row = 0;
                self.wait_ms = RETRANSMIT_MS.max(self.wait_ms / 2);
            }
        }
        self.first = expects;
        self.sent = self.sent.saturating_sub(arrived);
        self.sent_before = self.sent_before.saturating_sub(arrived);
        self.peer_limit = limit;
    }

    fn numbered(&mut self, kind: u8, number: u8, body: &[u8]) {
        let ahead = number.wrapping_sub(self.expected);
        self.acknowledge = true;
        if ahead >= 128 {
            count(&mut self.counters.duplicate);
            return;
        }
        let body = Vec::from_slice(body).unwrap_or_default();
        if ahead > 0 || self.inbox.push_back(Message { kind, body }).is_err() {
            count(&mut self.counters.out_of_order);
            return;
        }
        self.expected = self.expected.wrapping_add(1);
        self.has_received = true;
    }
}
