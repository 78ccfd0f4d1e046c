//! The depth event, and the slot in which it waits for the link.

use crate::flags::Flags;
use crate::units::{BinIndex, BinPosition, Count, LaserCycle, PixelAddress, SubBinOffset};

/// A peak stood clear of the background: what a pixel reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DepthEvent {
    /// Which macropixel.
    pub pixel: PixelAddress,
    /// The laser cycle whose end brought the decision.
    pub cycle: LaserCycle,
    /// Laser cycles in the histogram the event was decided from (N).
    pub exposure: u16,
    /// The highest bin.
    pub peak_bin: BinIndex,
    /// Where the pulse lies, from the start of the peak bin.
    pub offset: SubBinOffset,
    /// Photons in the highest bin, background included.
    pub peak_count: Count,
    /// The background a bin, as the detection rule estimates it.
    pub background: Count,
    /// What is to be said against it.
    pub flags: Flags,
}

impl DepthEvent {
    /// Where the pulse lies, from the start of bin 0.
    #[inline]
    #[must_use]
    pub const fn position(&self) -> BinPosition {
        BinPosition::of(self.peak_bin, self.offset)
    }
}

/// A pixel's event while it waits for the link, with the paper's handshake:
/// the pixel raises REQ by filling the slot, the link acknowledges by emptying
/// it. A full slot never takes a second event, so none is overwritten.
///
/// ```
/// use dtof_core::EventSlot;
/// # use dtof_core::*;
/// # let event = DepthEvent {
/// #     pixel: PixelAddress(3), cycle: LaserCycle(9), exposure: 10,
/// #     peak_bin: BinIndex::saturating(1), offset: SubBinOffset::CENTRE,
/// #     peak_count: Count::saturating(9), background: Count::saturating(1), flags: Flags::NONE,
/// # };
/// let mut slot = EventSlot::new();
/// assert!(slot.offer(event).is_ok() && slot.request());
/// assert_eq!(slot.offer(event), Err(event)); // given back, not lost
/// assert_eq!(slot.acknowledge(), Some(event));
/// assert!(!slot.request());
/// ```
#[derive(Clone, Debug, Default)]
pub struct EventSlot(Option<DepthEvent>);

impl EventSlot {
    /// An empty slot.
    #[must_use]
    pub const fn new() -> Self {
        Self(None)
    }

    /// REQ: whether an event waits.
    #[inline]
    #[must_use]
    pub const fn request(&self) -> bool {
        self.0.is_some()
    }

    /// Fills the slot.
    ///
    /// # Errors
    /// Gives the event back if the slot is full.
    #[inline]
    pub const fn offer(&mut self, event: DepthEvent) -> Result<(), DepthEvent> {
        if self.request() {
            return Err(event);
        }
        self.0 = Some(event);
        Ok(())
    }

    /// ACK: takes the event, so that the pixel may fire again.
    #[inline]
    #[must_use = "the event is taken from the slot"]
    pub const fn acknowledge(&mut self) -> Option<DepthEvent> {
        self.0.take()
    }
}
