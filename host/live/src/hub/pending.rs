//! Events since the last point cloud. Their number is bounded, and all are counted.

use std::collections::VecDeque;

use dtof_data::events::aer_file::Event;
use dtof_run::export::foxglove::{MOST_POINTS, Tally};

/// Events since the last [`PendingEvents::take`].
#[derive(Debug)]
pub struct PendingEvents {
    /// The newest events, at most [`MOST_POINTS`].
    events: VecDeque<Event>,
    tally: Tally,
    number: u64,
    dropped: u64,
}

impl PendingEvents {
    /// No events, of an array of so many `pixels`.
    pub fn new(pixels: usize) -> Self {
        Self {
            events: VecDeque::new(),
            tally: Tally::new(pixels),
            number: 0,
            dropped: 0,
        }
    }

    /// Drops the events that wait, as laser cycles begin at 0 again.
    pub fn restart(&mut self, pixels: usize) {
        let dropped = self.dropped + self.events.len() as u64;
        *self = Self {
            dropped,
            ..Self::new(pixels)
        };
    }

    /// Adds an event, and drops the oldest if there is no room.
    pub fn add(&mut self, event: &Event) {
        if self.tally.add(event, self.number).is_err() {
            self.dropped += 1;
            return;
        }
        if self.events.len() == MOST_POINTS {
            self.events.pop_front();
            self.dropped += 1;
        }
        self.events.push_back(*event);
    }

    /// Number of events that wait.
    pub fn len(&self) -> usize {
        self.events.len()
    }

    /// Takes the events, the counts of all events, and the number of dropped ones.
    #[cfg(feature = "foxglove")]
    pub fn take(&mut self) -> (Vec<Event>, dtof_run::export::foxglove::Statistics, u64) {
        self.number += 1;
        let dropped = std::mem::take(&mut self.dropped);
        (self.events.drain(..).collect(), self.tally.take(), dropped)
    }
}
