//! Which echo of each exposure is shown: the first, the last, the strongest or all.
//!
//! Which it is cannot be known before the exposure ends, and events stay in their order. So
//! they wait until those before them are decided, no longer than an exposure may last.

use std::collections::{HashMap, VecDeque};

use dtof_core::{BlockLevel, DepthEvent, EchoNumber, LaserCycle, PixelAddress};

use dtof_options::Named;

/// Which echo of an exposure of a pixel or a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Echo {
    /// The nearest
    First,
    /// The farthest
    Last,
    /// The one with the most photons a laser cycle in its peak, less the background
    Strongest,
    /// Every one
    All,
}

impl Named for Echo {
    const NAMES: &'static [(&'static str, Self, &'static str)] = &[
        ("first", Self::First, "The nearest"),
        ("last", Self::Last, "The farthest"),
        (
            "strongest",
            Self::Strongest,
            "The one with the most photons a laser cycle in its peak, less the background",
        ),
        ("all", Self::All, "Every one"),
    ];
}

impl Echo {
    /// Is `event` to be shown rather than `other`, which came before it?
    fn prefers(self, event: &DepthEvent, other: &DepthEvent) -> bool {
        match self {
            Self::First => event.position() < other.position(),
            Self::Last => event.position() > other.position(),
            Self::Strongest => {
                // Signals a laser cycle, both times both exposures.
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

/// Events that wait for a choice.
#[derive(Clone, Debug)]
pub struct Selection {
    echo: Echo,
    /// An exposure has no more echoes.
    most: EchoNumber,
    /// An exposure lasts no longer.
    longest: u16,
    /// The exposures that may have more echoes, one a pixel or block at most.
    open: HashMap<(PixelAddress, BlockLevel), Open>,
    /// In the order they came.
    waiting: VecDeque<(DepthEvent, Fate)>,
    /// How many have left the queue.
    left: u64,
    now: LaserCycle,
}

/// An exposure.
#[derive(Clone, Copy, Debug)]
struct Open {
    /// Its latest echo.
    last: EchoNumber,
    /// The number of the event that is to be shown so far.
    chosen: u64,
    /// The last laser cycle that may belong to it.
    end: LaserCycle,
}

/// What becomes of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    /// To be shown, unless its exposure has another that is preferred.
    Open,
    Shown,
    Dropped,
}

impl Selection {
    /// Of each exposure, `echo`. It has `most` echoes at most and lasts `longest` laser cycles
    /// at most.
    #[must_use]
    pub fn new(echo: Echo, most: EchoNumber, longest: u16) -> Self {
        Self {
            echo,
            most,
            longest,
            open: HashMap::new(),
            waiting: VecDeque::new(),
            left: 0,
            now: LaserCycle(0),
        }
    }

    /// Takes the next event. [`Self::next`] gives those that are decided then.
    pub fn push(&mut self, event: DepthEvent) {
        self.now = self.now.max(event.cycle);
        if self.echo == Echo::All {
            self.waiting.push_back((event, Fate::Shown));
            return;
        }
        let number = self.left + self.waiting.len() as u64;
        let key = (event.pixel, event.level);
        let open = self.open.get(&key).copied();
        let same = open.filter(|open| event.echo > open.last && event.cycle <= open.end);
        let other = same.and_then(|open| self.waiting.get(self.place(open.chosen)?));
        let is_chosen = other.is_none_or(|(other, _)| self.echo.prefers(&event, other));
        let fate = match is_chosen {
            true => Fate::Open,
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
        let begun = (event.cycle.0 + 1).saturating_sub(event.exposure.into());
        let end = LaserCycle(begun.saturating_add(self.longest.into()));
        let open = Open {
            last: event.echo,
            chosen,
            end: same.map_or(end, |open| open.end),
        };
        self.open.insert(key, open);
    }

    /// No exposure has more echoes.
    pub fn finish(&mut self) {
        for (_, open) in std::mem::take(&mut self.open) {
            self.decide(open.chosen, Fate::Shown);
        }
    }

    /// The place of an event in the queue.
    fn place(&self, number: u64) -> Option<usize> {
        usize::try_from(number.checked_sub(self.left)?).ok()
    }

    fn decide(&mut self, number: u64, fate: Fate) {
        let place = self.place(number);
        if let Some(waiting) = place.and_then(|place| self.waiting.get_mut(place)) {
            waiting.1 = fate;
        }
    }
}

/// Those to be shown, in the order they came, as far as that is decided.
impl Iterator for Selection {
    type Item = DepthEvent;

    fn next(&mut self) -> Option<DepthEvent> {
        loop {
            let &(event, fate) = self.waiting.front()?;
            if fate == Fate::Open {
                let key = (event.pixel, event.level);
                let open = self.open.get(&key)?;
                if self.now <= open.end {
                    return None;
                }
                self.open.remove(&key);
            }
            self.waiting.pop_front();
            self.left += 1;
            if fate != Fate::Dropped {
                return Some(event);
            }
        }
    }
}

#[cfg(test)]
mod tests;
