//! Sorts events that are slightly out of order by time.
//!
//! A device sends events in the order in which the link takes them, and each pixel holds at most
//! one event. So at most as many events as there are pixels can overtake an event, as long as the
//! link takes all of them.

use std::collections::BTreeMap;

/// How many events are held back to be sorted: one for each pixel address.
pub const WAITING: usize = 1 << 16;

/// Events that are held back.
pub struct Reorder<T> {
    /// Keyed by time and then by number, so that events of the same time stay in order.
    waiting: BTreeMap<(u64, u64), T>,
    most: usize,
    number: u64,
    /// The time of the last event returned.
    last: u64,
    late: u64,
}

impl<T> Reorder<T> {
    /// Holds up to `most` events back.
    pub fn new(most: usize) -> Self {
        Self {
            waiting: BTreeMap::new(),
            most,
            number: 0,
            last: 0,
            late: 0,
        }
    }

    /// Adds an event, and returns the oldest if more than `most` are held. An event older than the
    /// last one returned is counted and dropped.
    pub fn push(&mut self, time: u64, item: T) -> Option<T> {
        if time < self.last {
            self.late += 1;
            return None;
        }
        self.waiting.insert((time, self.number), item);
        self.number += 1;
        if self.waiting.len() > self.most {
            self.pop()
        } else {
            None
        }
    }

    /// Returns the oldest event.
    pub fn pop(&mut self) -> Option<T> {
        let ((time, _), oldest) = self.waiting.pop_first()?;
        self.last = time;
        Some(oldest)
    }

    /// How many events were dropped.
    pub fn late(&self) -> u64 {
        self.late
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The events that come out, and how many are dropped.
    fn ordered(most: usize, times: &[u64]) -> (Vec<(u64, usize)>, u64) {
        let mut reorder = Reorder::new(most);
        let mut out = Vec::new();
        for (index, &time) in times.iter().enumerate() {
            out.extend(reorder.push(time, (time, index)));
        }
        out.extend(std::iter::from_fn(|| reorder.pop()));
        (out, reorder.late())
    }

    proptest! {
        #[test]
        fn comes_out_sorted_and_every_loss_is_counted(
            times in prop::collection::vec(0u64..50, 0..100), most in 0usize..20,
        ) {
            let (out, late) = ordered(most, &times);
            prop_assert!(out.is_sorted());
            prop_assert_eq!(out.len() as u64 + late, times.len() as u64);
        }

        #[test]
        fn no_event_is_late_if_there_is_room_for_those_that_overtake_it(
            shifts in prop::collection::vec(0u64..8, 0..200),
        ) {
            // Each is at most 7 out of its place.
            let mut times: Vec<(u64, u64)> =
                shifts.iter().zip(0u64..).map(|(shift, index)| (index + shift, index)).collect();
            times.sort_unstable();
            let times: Vec<u64> = times.iter().map(|(_, time)| *time).collect();
            let (out, late) = ordered(7, &times);
            prop_assert_eq!(late, 0);
            prop_assert!(out.iter().map(|(time, _)| *time).eq(0..times.len() as u64));
        }
    }

    #[test]
    fn one_that_is_too_late_is_counted() {
        assert_eq!(ordered(1, &[5, 6, 7, 5, 8]).1, 1);
        // As old as the last is not too late.
        assert_eq!(ordered(1, &[5, 6, 7, 6, 8]).1, 0);
    }
}
