//! The sending half of an endpoint.

use super::receive::count;
use super::{
    END, Endpoint, HEADER_BYTES, HELLO, KEEP_ALIVE, KEEP_ALIVE_MS, KEEP_ALIVE_OF_DEVICE,
    NO_SESSION, RETRANSMIT_MOST_MS, RETRANSMIT_MS, WELCOME, WINDOW,
};
use crate::frame::{self, WIRE_BYTES};

impl Endpoint {
    /// Writes the next frame into `wire`. Returns its bytes, 0 if none is due.
    pub fn transmit(&mut self, now_ms: u32, wire: &mut [u8; WIRE_BYTES]) -> usize {
        if let Some((kind, session)) = self.reply.take() {
            return self.unnumbered(kind, session, now_ms, wire);
        }
        let waited_ms = now_ms.wrapping_sub(self.progress_ms);
        if !self.open {
            if self.host && waited_ms >= RETRANSMIT_MS {
                self.progress_ms = now_ms;
                return self.unnumbered(HELLO, self.session, now_ms, wire);
            }
            return 0;
        }
        let is_due = now_ms.wrapping_sub(self.spoke_ms) >= KEEP_ALIVE_MS;
        if self.ending {
            if self.lost || !is_due {
                return 0;
            }
            return self.unnumbered(END, self.session, now_ms, wire);
        }
        if self.sent > 0 && waited_ms >= self.wait_ms {
            self.sent = 0;
            self.wait_ms = RETRANSMIT_MOST_MS.min(2 * self.wait_ms);
            self.acknowledged_in_a_row = 0;
            self.alone = true;
        }
        let number = self.first.wrapping_add(self.sent);
        let room = self.peer_limit.wrapping_sub(number);
        let next = self.outbox.iter().nth(self.sent.into());
        // A repeated message goes by itself until it arrives, so that repetitions do not fill
        // a slow line.
        let must_wait = self.alone && self.sent > 0;
        if let Some(message) = next.filter(|_| (1..128).contains(&room) && !must_wait) {
            let header = self.header(message.kind, self.session, number);
            let length = frame::encode([&header, &message.body], wire);
            if self.sent == 0 {
                self.progress_ms = now_ms;
            }
            self.sent += 1;
            if self.sent <= self.sent_before {
                count(&mut self.counters.retransmitted);
            } else {
                self.sent_before = self.sent;
            }
            self.acknowledge = false;
            self.spoke_ms = now_ms;
            return length;
        }
        if self.acknowledge || is_due {
            let kind = if self.host {
                KEEP_ALIVE
            } else {
                KEEP_ALIVE_OF_DEVICE
            };
            return self.unnumbered(kind, self.session, now_ms, wire);
        }
        0
    }

    fn unnumbered(
        &mut self,
        kind: u8,
        session: u16,
        now_ms: u32,
        wire: &mut [u8; WIRE_BYTES],
    ) -> usize {
        if matches!(kind, KEEP_ALIVE | KEEP_ALIVE_OF_DEVICE | END) {
            self.spoke_ms = now_ms;
            self.acknowledge = false;
        }
        let header = self.header(kind, session, 0);
        let body: &[u8] = match kind {
            HELLO | WELCOME => &self.greeting,
            NO_SESSION => &[self.stop_reason],
            _ => &[],
        };
        frame::encode([&header, body], wire)
    }

    fn header(&self, kind: u8, session: u16, number: u8) -> [u8; HEADER_BYTES] {
        let [session0, session1] = session.to_le_bytes();
        // At most WINDOW.
        #[allow(clippy::cast_possible_truncation)]
        let free = (WINDOW - self.inbox.len()) as u8;
        [
            kind,
            session0,
            session1,
            number,
            self.expected,
            self.expected.wrapping_add(free),
        ]
    }
}
