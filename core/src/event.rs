//! The depth event: what a pixel reports.
//!
//! [`Detection::event`](crate::Detection::event) makes it. The pixel keeps it until the link
//! takes it:
//! [`AsyncPixel::take_event`](crate::AsyncPixel::take_event).
//!
//! ```
//! use dtof_core::{Histogram, LaserCycle, PixelAddress, PixelConfig, PixelConfigError};
//!
//! let config = PixelConfig::<128>::paper().build()?;
//! let mut histogram = Histogram::<128>::new();
//! histogram.add_batch(&[60; 9]);
//! let detection = config.detect(&histogram).expect("nine photons against none");
//! let event = detection.event(PixelAddress::new(3), LaserCycle::new(99), 100);
//! assert_eq!(event.position().raw(), 60 * 256 + 128); // 60.5 bins
//! # Ok::<(), PixelConfigError>(())
//! ```
//!
//! Cost: 28 bytes.

use crate::flags::Flags;
use crate::units::{
    BinIndex, BinPosition, BlockLevel, Count, EchoNumber, LaserCycle, PixelAddress, SubBinOffset,
};

/// A peak that stood clear of the background, as a pixel reports it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DepthEvent {
    /// The macropixel; for a block its first, the one of the lowest row and column.
    pub pixel: PixelAddress,
    /// Whether one pixel reports, or a block.
    pub level: BlockLevel,
    /// Which echo of the exposure.
    pub echo: EchoNumber,
    /// The laser cycle at the end of which the pixel decided.
    pub cycle: LaserCycle,
    /// Laser cycles in the histogram the event was decided from (N).
    pub exposure: u16,
    /// The highest bin.
    pub peak_bin: BinIndex,
    /// Where the pulse lies, from the start of the peak bin.
    pub offset: SubBinOffset,
    /// Photons in the highest bin, background included. Of an event that neighbours
    /// [confirmed](Flags::CONFIRMED): the pixel's own photons in the window of the rule.
    pub peak_count: Count,
    /// The background a bin, as the detection rule estimates it. Of an event that neighbours
    /// confirmed, what is expected of the pixel in the window of the rule.
    pub background: Count,
    /// What is known to be wrong with it.
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
