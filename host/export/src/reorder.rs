//! Puts events in order of time that are a little out of order.
//!
//! A device sends events in the order in which the link takes them, and each pixel has
//! one event that may wait. So no event can be overtaken by more events than there are
//! pixels, as long as the link takes all of them.

use std::collections::BTreeMap;

/// How many events wait for those that are older: one for each pixel address.
pub const WAITING: usize = 1 << 16;

/// Events on their way, the oldest first.
pub struct Reorder<T> {
    /// By time; events of one time by their number, so that they stay in the order they came in.
    waiting: BTreeMap<(u64, u64), T>,
    most: usize,
    number: u64,
    /// The time of the event that was given out last.
    last: u64,
    late: u64,
}

impl<T> Reorder<T> {
    /// With room for `most` events.
    pub fn new(most: usize) -> Self {
        Self {
            waiting: BTreeMap::new(),
            most,
            number: 0,
            last: 0,
            late: 0,
        }
    }

    /// Takes one in, and gives the oldest out when there is no more room. One that is
    /// older than what was given out is left out and counted.
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

    /// The oldest.
    pub fn pop(&mut self) -> Option<T> {
        let ((time, _), oldest) = self.waiting.pop_first()?;
        self.last = time;
        Some(oldest)
    }

    /// How many were left out.
    pub fn late(&self) -> u64 {
        self.late
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// What comes out, and how many do not.
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
        fn comes_out_sorted_and_nothing_is_lost_unsaid(
            times in prop::collection::vec(0u64..50, 0..100), most in 0usize..20,
        ) {
            let (out, late) = ordered(most, &times);
            prop_assert!(out.is_sorted());
            prop_assert_eq!(out.len() as u64 + late, times.len() as u64);
        }

        #[test]
        fn nothing_is_late_that_fewer_than_there_is_room_for_have_overtaken(
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
