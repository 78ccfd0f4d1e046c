//! Events since the last message, for those who are sent points: bounded, and all are counted.

use std::collections::VecDeque;

use dtof_events::aer_file::Event;
use dtof_export::foxglove::{MOST_POINTS, Tally};

/// What has arrived since it was taken last.
#[derive(Debug)]
pub struct Slice {
    /// The newest, at most [`MOST_POINTS`].
    events: VecDeque<Event>,
    tally: Tally,
    number: u64,
    left_out: u64,
}

impl Slice {
    /// Nothing yet, of so many pixels.
    pub fn new(pixels: usize) -> Self {
        Self {
            events: VecDeque::new(),
            tally: Tally::new(pixels),
            number: 0,
            left_out: 0,
        }
    }

    /// Laser cycles begin at 0 again: what waits is not to be drawn among what comes.
    pub fn restart(&mut self, pixels: usize) {
        let left_out = self.left_out + self.events.len() as u64;
        *self = Self {
            left_out,
            ..Self::new(pixels)
        };
    }

    /// Takes an event in, and leaves the oldest out if there is no room.
    pub fn add(&mut self, event: &Event) {
        if self.tally.add(event, self.number).is_err() {
            self.left_out += 1;
            return;
        }
        if self.events.len() == MOST_POINTS {
            self.events.pop_front();
            self.left_out += 1;
        }
        self.events.push_back(*event);
    }

    /// Events that wait.
    pub fn len(&self) -> usize {
        self.events.len()
    }

    /// What has arrived: the events that were kept, the counts of all, and how many were left out.
    #[cfg(feature = "foxglove")]
    pub fn take(&mut self) -> (Vec<Event>, dtof_export::foxglove::Statistics, u64) {
        self.number += 1;
        let left_out = std::mem::take(&mut self.left_out);
        (self.events.drain(..).collect(), self.tally.take(), left_out)
    }
}
