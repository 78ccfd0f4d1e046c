//! The result of a depth estimator: a place within the bins, and flags.

use crate::flags::Flags;
use crate::units::SubBinOffset;

/// A sub-bin estimate and its flags.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DepthEstimate {
    /// From the start of the peak bin. The centroid gives 0 to 1 bin inclusive, or −0.5 to 1.5 if a
    /// neighbouring bin has more counts.
    pub offset: SubBinOffset,
    /// [`Flags::SATURATED`] if the counter of the peak bin is full,
    /// [`Flags::CLIPPED`] if the window reaches past the gate.
    pub flags: Flags,
}
