//! What a depth estimator finds: a place within the bins, and flags.

use crate::flags::Flags;
use crate::units::SubBinOffset;

/// A sub-bin estimate and what is to be said against it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Depth {
    /// From the start of the peak bin: 0 to 1 bin inclusive if that is the
    /// highest, −0.5 to 1.5 if it is not.
    pub offset: SubBinOffset,
    /// [`Flags::SATURATED`] if the counter of the peak bin is full,
    /// [`Flags::CLIPPED`] if the window reaches past the gate.
    pub flags: Flags,
}
