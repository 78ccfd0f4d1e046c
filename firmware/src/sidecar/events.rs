//! Events on their way from the pixels' slots into messages.

use dtof_core::{AerWord, DepthEvent};
use dtof_link::Source;
use dtof_link::endpoint::BODY_BYTES;
use dtof_link::message;
use heapless::spsc::Queue;
use heapless::vec::Vec;

use super::{QUEUE, Sidecar};

/// Words in one message.
const WORDS: usize = BODY_BYTES / AerWord::BYTES;

impl Sidecar<'_> {
    /// What the host asks, if that is what it has sent next.
    pub(super) fn question(&self) -> Option<u8> {
        let next = self.endpoint.peek()?.kind;
        (next != message::PHOTONS).then_some(next)
    }

    /// Whether events stay in their slots for now: photons of a sensor do not
    /// wait, so that a question would never be answered if all events that come
    /// meanwhile went before the answer.
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
        // From where there was no room for more, so that each pixel has its turn.
        let turn = core::mem::take(&mut self.turn);
        let pixels = self.pixels.len();
        for index in (turn..pixels).chain(0..turn) {
            let Some(pixel) = self.pixels.get_mut(index) else {
                break;
            };
            if !pixel.detector.request() {
                continue;
            }
            if !has_room_for_event(&self.words) {
                self.turn = index;
                break;
            }
            if let Some(event) = pixel.detector.acknowledge() {
                self.enqueue(&event);
            }
        }
        self.send_words();
    }

    /// Takes an event for which there is room. Of dynamic depth only a change goes on.
    pub(super) fn enqueue(&mut self, event: &DepthEvent) {
        let (time, word) = match &self.dynamic_depth {
            None => self.encoder.encode(event),
            Some(config) => {
                let pixel = self.pixels.get_mut(usize::from(event.pixel.0));
                let change = pixel.and_then(|pixel| pixel.dynamic_depth.observe(config, event));
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
            // An answer stands before the events that came after the question.
            if self.answer.is_some() || !self.endpoint.has_room() {
                return;
            }
            let words = core::iter::from_fn(|| self.words.dequeue()).take(WORDS);
            let body: Vec<u8, BODY_BYTES> = words.flat_map(AerWord::to_le_bytes).collect();
            // There is room: asked above.
            let _ = self.endpoint.offer(message::EVENTS, &body);
        }
    }

    /// Whether every event before a question has become a message.
    pub(super) fn is_drained(&self) -> bool {
        self.words.is_empty() && (self.holds_slots() || self.waiting() == 0)
    }

    /// Events that have not left their slots.
    pub(super) fn waiting(&self) -> u64 {
        let waiting = self.pixels.iter().filter(|pixel| pixel.detector.request());
        waiting.map(|_| 1).sum()
    }
}

/// An event may need a time word before it.
pub(super) fn has_room_for_event(words: &Queue<AerWord, QUEUE>) -> bool {
    words.capacity() - words.len() >= 2
}
