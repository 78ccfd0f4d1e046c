//! The result of a look, and the state of a pixel that looks depend on.

/// The result of ending a laser cycle.
///
/// Exhaustive, because the C header numbers each outcome.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Look {
    /// Fewer than X laser cycles since the last look: none was taken.
    NotDue,
    /// N has not exceeded L1.
    TooEarly,
    /// The peak does not stand clear of the background; the exposure goes on.
    NoPeak,
    /// The slot still has an event, so the decision is deferred by X laser
    /// cycles.
    Deferred,
    /// The peak stands clear: the event is in the slot, a new exposure begins.
    Event,
    /// N reached L2 without an event, or a counter is full, with a dead time or of 8 bits: a new
    /// exposure begins.
    Expired,
    /// The wait for another echo is over: a new exposure begins.
    Ended,
}

/// The state that looks depend on. Most often it is empty, which takes one comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct State(u8);

impl State {
    pub(super) const NONE: Self = Self(0);
    /// `event` waits for the link.
    pub(super) const REQUESTING: Self = Self(1);
    /// A decision was deferred, since the exposure began or its last echo was reported.
    pub(super) const DEFERRED: Self = Self(1 << 1);
    /// An echo of this exposure was reported.
    pub(super) const HAS_ECHO: Self = Self(1 << 2);
    /// The exposure before this one had an event, and the pixel tracks.
    pub(super) const EXPECTING: Self = Self(1 << 3);

    /// A look has begun in steps, and decides.
    pub(super) const DECIDES: Self = Self(1 << 4);
    /// The event in the slot is to be reported at the end of this look.
    pub(super) const DETECTED: Self = Self(1 << 5);

    pub(super) const fn contains(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    pub(super) const fn set(&mut self, other: Self) {
        self.0 |= other.0;
    }

    pub(super) const fn clear(&mut self, other: Self) {
        self.0 &= !other.0;
    }

    /// Clears the state of the exposure. An event that waits remains.
    pub(super) const fn end_exposure(&mut self) {
        self.0 &= Self::REQUESTING.0;
    }
}
