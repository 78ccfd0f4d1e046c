//! Selects one echo of each exposure: the first, the last, the strongest, or all.
//!
//! The selected echo is known only when the exposure ends, and events stay in order. So they wait
//! until earlier ones are decided, at most as long as an exposure.

use std::collections::{HashMap, VecDeque};

use dtof_core::{BlockLevel, DepthEvent, EchoNumber, LaserCycle, PixelAddress};

use crate::named_values;

named_values! {
    /// Which echo of an exposure of a pixel or a block.
    #[derive(Debug, PartialEq, Eq)]
    pub enum Echo {
        /// The nearest
        First = "first",
        /// The farthest
        Last = "last",
        /// The one with the most photons a laser cycle in its peak, less the background
        Strongest = "strongest",
        /// Every one
        All = "all",
    }
}

impl Echo {
    /// Whether `event` is shown rather than `other`, which came before it.
    fn prefers(self, event: &DepthEvent, other: &DepthEvent) -> bool {
        match self {
            Self::First => event.position() < other.position(),
            Self::Last => event.position() > other.position(),
            Self::Strongest => {
                // Compares signals a laser cycle, both multiplied by both exposures.
                let above = |event: &DepthEvent| {
                    let signal = event
                        .peak_count
                        .raw()
                        .saturating_sub(event.background.raw());
                    u64::from(signal)
                };
                let exposure = |event: &DepthEvent| u64::from(event.exposure.max(1));
                above(event) * exposure(other) > above(other) * exposure(event)
            }
            Self::All => true,
        }
    }
}

/// Selects echoes from a stream of events.
#[derive(Clone, Debug)]
pub struct EchoSelection {
    echo: Echo,
    /// The last echo of an exposure.
    most: EchoNumber,
    /// The most laser cycles of an exposure.
    longest: u16,
    /// Exposures that may have more echoes, at most one a pixel or block.
    open: HashMap<(PixelAddress, BlockLevel), OpenExposure>,
    /// Events in the order they came.
    waiting: VecDeque<(DepthEvent, Fate)>,
    /// How many events have left the queue.
    taken: u64,
    now: LaserCycle,
}

/// An exposure.
#[derive(Clone, Copy, Debug)]
struct OpenExposure {
    /// Its latest echo.
    last: EchoNumber,
    /// The number of the event to be shown so far.
    chosen: u64,
    /// The last laser cycle that may belong to it.
    end: LaserCycle,
}

/// What becomes of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    /// Shown, unless its exposure has a better one.
    Pending,
    Shown,
    Dropped,
}

impl EchoSelection {
    /// Selects `echo` of each exposure. An exposure has at most `most` echoes and lasts at most
    /// `longest` laser cycles.
    #[must_use]
    pub fn new(echo: Echo, most: EchoNumber, longest: u16) -> Self {
        Self {
            echo,
            most,
            longest,
            open: HashMap::new(),
            waiting: VecDeque::new(),
            taken: 0,
            now: LaserCycle::new(0),
        }
    }

    /// Takes the next event. [`Self::next`] then returns those that are decided.
    pub fn push(&mut self, event: DepthEvent) {
        self.now = self.now.max(event.cycle);
        if self.echo == Echo::All {
            self.waiting.push_back((event, Fate::Shown));
            return;
        }
        let number = self.taken + self.waiting.len() as u64;
        let key = (event.pixel, event.level);
        let open = self.open.get(&key).copied();
        let same = open.filter(|open| event.echo > open.last && event.cycle <= open.end);
        let other = same.and_then(|open| self.waiting.get(self.place(open.chosen)?));
        let is_chosen = other.is_none_or(|(other, _)| self.echo.prefers(&event, other));
        let fate = match is_chosen {
            true => Fate::Pending,
            false => Fate::Dropped,
        };
        self.waiting.push_back((event, fate));
        let chosen = match same {
            Some(open) if !is_chosen => open.chosen,
            Some(open) => {
                self.decide(open.chosen, Fate::Dropped);
                number
            }
            None => {
                if let Some(open) = open {
                    self.decide(open.chosen, Fate::Shown);
                }
                number
            }
        };
        if event.echo >= self.most {
            self.decide(chosen, Fate::Shown);
            self.open.remove(&key);
            return;
        }
        let begun = (event.cycle.raw() + 1).saturating_sub(event.exposure.into());
        let end = LaserCycle::new(begun.saturating_add(self.longest.into()));
        let open = OpenExposure {
            last: event.echo,
            chosen,
            end: same.map_or(end, |open| open.end),
        };
        self.open.insert(key, open);
    }

    /// Ends all exposures.
    pub fn finish(&mut self) {
        for (_, open) in std::mem::take(&mut self.open) {
            self.decide(open.chosen, Fate::Shown);
        }
    }

    /// The index of an event in the queue.
    fn place(&self, number: u64) -> Option<usize> {
        usize::try_from(number.checked_sub(self.taken)?).ok()
    }

    fn decide(&mut self, number: u64, fate: Fate) {
        let place = self.place(number);
        if let Some(waiting) = place.and_then(|place| self.waiting.get_mut(place)) {
            waiting.1 = fate;
        }
    }
}

/// The selected events that are decided, in the order they came.
impl Iterator for EchoSelection {
    type Item = DepthEvent;

    fn next(&mut self) -> Option<DepthEvent> {
        loop {
            let &(event, fate) = self.waiting.front()?;
            if fate == Fate::Pending {
                let key = (event.pixel, event.level);
                let open = self.open.get(&key)?;
                if self.now <= open.end {
                    return None;
                }
                self.open.remove(&key);
            }
            self.waiting.pop_front();
            self.taken += 1;
            if fate != Fate::Dropped {
                return Some(event);
            }
        }
    }
}

#[cfg(test)]
mod tests;
