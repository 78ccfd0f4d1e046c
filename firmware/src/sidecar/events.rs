//! Events on their way from the pixels' slots into messages.

use dtof_core::{AerWord, BlockLevel, DepthEvent, EchoNumber};
use dtof_link::Source;
use dtof_link::endpoint::BODY_BYTES;
use dtof_link::message;
use heapless::spsc::Queue;
use heapless::vec::Vec;

use super::{QUEUE, Sidecar};

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
        // From where there was no room for more, so that each pixel has its turn.
        let turn = core::mem::take(&mut self.turn);
        let slots = self.pixels.len() + self.blocks.len();
        for index in (turn..slots).chain(0..turn) {
            if !self.is_waiting(index) {
                continue;
            }
            if !has_room_for_events(&self.words, 1) {
                self.turn = index;
                break;
            }
            if let Some(event) = self.acknowledge(index) {
                self.enqueue(&event);
            }
        }
        self.send_words();
    }

    /// Takes an event for which there is room. With dynamic depth only a change is sent.
    #[inline(never)]
    pub(super) fn enqueue(&mut self, event: &DepthEvent) {
        let (time, word) = match &self.dynamic_depth {
            None => self.encoder.encode(event),
            Some(config) => {
                let followed = if event.level == BlockLevel::PIXEL {
                    let pixel = self.pixels.get_mut(usize::from(event.pixel.raw()));
                    pixel.map(|pixel| &mut pixel.dynamic_depth)
                } else {
                    let mut blocks = self.blocks.iter_mut();
                    let block = blocks.find(|block| block.is_of(event));
                    block.map(|block| &mut block.dynamic_depth)
                };
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
        self.words.is_empty() && (self.holds_slots() || !self.has_waiting_events())
    }

    /// Whether an event has not left its slot.
    pub(super) fn has_waiting_events(&self) -> bool {
        self.pixels.iter().any(|pixel| pixel.detector.has_event())
            || self.blocks.iter().any(|block| block.detector.has_event())
    }

    /// Whether the slot of a pixel, or after the pixels of a block, is full.
    fn is_waiting(&self, index: usize) -> bool {
        match self.pixels.get(index) {
            Some(pixel) => pixel.detector.has_event(),
            None => {
                let block = self.blocks.get(index - self.pixels.len());
                block.is_some_and(|block| block.detector.has_event())
            }
        }
    }

    /// Takes the event out of such a slot.
    fn acknowledge(&mut self, index: usize) -> Option<DepthEvent> {
        let pixels = self.pixels.len();
        match self.pixels.get_mut(index) {
            Some(pixel) => pixel.detector.take_event(),
            None => {
                let block = self.blocks.get_mut(index - pixels)?;
                block.detector.take_event()
            }
        }
    }
}

/// Events at the same time may need one time word before them.
pub(super) fn has_room_for_events(words: &Queue<AerWord, QUEUE>, events: usize) -> bool {
    words.capacity() - words.len() > events
}
