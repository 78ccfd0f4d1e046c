//! Flags: every known error of an event is marked, and what neighbours confirmed.

use core::fmt;
use core::ops::{BitOr, BitOrAssign};

/// What is known to be wrong with an event, and whether neighbours confirmed it. Six bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Flags(u8);

impl Flags {
    /// No flags.
    pub const NONE: Self = Self(0);
    /// Bit 0: the peak's counter is full. The peak may lie in another full
    /// bin, and the depth is biased towards the middle of the bin.
    pub const SATURATED: Self = Self(1);
    /// Bit 1: the depth window reaches past the range gate, so the depth is biased into
    /// the gate; or it reaches bins that are left out, because they lie around an earlier echo of
    /// the exposure or were hardly ever live; or the position is limited to two bins from the
    /// peak bin.
    pub const CLIPPED: Self = Self(1 << 1);
    /// Bit 2: a decision was deferred while the slot was full, so the exposure may be
    /// longer than necessary.
    pub const DEFERRED: Self = Self(1 << 2);
    /// Bit 3: early photons hid late ones. With the window rule, which weighs bins by their live
    /// laser cycles, it means that a gated bin was blind or had a photon in nearly all of the
    /// exposure: fewer than one laser cycle in 1024 is left over, or too few for the rule's minimum
    /// of photons. A target there or behind it may be missed. With other rules and in blocks it
    /// means that a TDC of the first photon took one in more than half of the laser cycles: the
    /// depth is biased towards the sensor, and the peak may not be a target. See
    /// [`PixelConfigBuilder::dead_time`](crate::PixelConfigBuilder::dead_time).
    pub const PILE_UP: Self = Self(1 << 3);

    /// Bit 4: the peak lies on the tail of an echo that was reported earlier in the same
    /// exposure, and may be a part of it.
    pub const TAIL: Self = Self(1 << 4);

    /// Bit 5: the pixel's own photons were not enough, and its [neighbours](crate::neighbours) confirmed
    /// them. The depth is that of their photons together.
    pub const CONFIRMED: Self = Self(1 << 5);

    /// From bits, or `None` above six bits.
    #[must_use]
    pub const fn from_bits(bits: u8) -> Option<Self> {
        if bits < 64 { Some(Self(bits)) } else { None }
    }

    /// The bits.
    #[must_use]
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// Those that are not in `other`.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Whether all of `other` is set.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

impl BitOr for Flags {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl BitOrAssign for Flags {
    fn bitor_assign(&mut self, other: Self) {
        *self = *self | other;
    }
}

/// The bits as a decimal number.
impl fmt::Display for Flags {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0, f)
    }
}
