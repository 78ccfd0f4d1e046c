//! Events on their way from the pixels' slots into messages.

use dtof_core::{AerWord, DepthEvent, EchoNumber};
use dtof_link::Source;
use dtof_link::endpoint::BODY_BYTES;
use dtof_link::message;
use heapless::vec::Vec;

use super::Sidecar;

/// Words in one message.
const WORDS: usize = BODY_BYTES / AerWord::BYTES;

impl Sidecar<'_> {
    /// The next message if it is a request. Histograms come after all events and do not change the
    /// order or time of events.
    pub(super) fn question(&self) -> Option<u8> {
        let next = self.endpoint.peek()?.kind;
        (!matches!(next, message::PHOTONS | message::HISTOGRAM_REQUEST)).then_some(next)
    }

    /// Whether events stay in their slots for now. A sensor cannot wait: a request would never be
    /// answered if all later events went before the answer.
    fn holds_slots(&self) -> bool {
        self.source == Source::Sensor
            && self
                .question()
                .is_some_and(|kind| kind != message::CONFIGURE)
    }

    /// Slots to queue, queue to messages, as far as there is room.
    pub(super) fn drain(&mut self) {
        self.send_words();
        if self.holds_slots() {
            return;
        }
        while self.room() > 0
            && let Some(event) = self.array.next_event()
        {
            self.enqueue(&event);
        }
        self.send_words();
    }

    /// Takes an event for which there is room. With dynamic depth only a change is sent.
    #[inline(never)]
    pub(super) fn enqueue(&mut self, event: &DepthEvent) {
        let (time, word) = match &self.dynamic_depth {
            None => self.encoder.encode(event),
            Some(config) => {
                let followed = self.array.data_of(event);
                // Dynamic depth follows the first of several echoes.
                let followed = followed.filter(|_| event.echo == EchoNumber::FIRST);
                let change = followed.and_then(|followed| followed.observe(config, event));
                let Some(change) = change else {
                    return;
                };
                self.encoder.encode_dynamic_depth(&change)
            }
        };
        for word in time.into_iter().chain([word]) {
            let _ = self.words.enqueue(word);
        }
    }

    /// A full message at once, a smaller one only when nothing else is under way
    /// or an answer waits for it.
    fn send_words(&mut self) {
        let all = self.endpoint.is_settled() || self.question().is_some();
        while self.words.len() >= WORDS || (!self.words.is_empty() && all) {
            // An answer goes before the events that came after the request.
            if self.answer.is_some() || !self.endpoint.has_room() {
                return;
            }
            let words = core::iter::from_fn(|| self.words.dequeue()).take(WORDS);
            let mut body: Vec<u8, BODY_BYTES> = Vec::new();
            for byte in words.flat_map(AerWord::to_le_bytes) {
                // There is room for each. `collect` could panic.
                let _ = body.push(byte);
            }
            // There is room: checked above.
            let _ = self.endpoint.offer(message::EVENTS, &body);
        }
    }

    /// Whether every event before a request has become a message.
    pub(super) fn is_drained(&self) -> bool {
        self.words.is_empty() && (self.holds_slots() || !self.array.has_event())
    }

    /// Events for which there is room. Those at the same time may need one time word before them.
    pub(super) fn room(&self) -> usize {
        (self.words.capacity() - self.words.len()).saturating_sub(1)
    }
}
