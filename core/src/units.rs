//! The quantities of the pipeline as types, so that a [`Count`] cannot be mistaken for a
//! [`BinIndex`].
//!
//! `new` makes a quantity and `raw` gives its integer. `new` returns `None` out of range,
//! so that a [`DepthEvent`](crate::DepthEvent) always fits its [`AerWord`](crate::AerWord).
//! Where a conversion rounds, its name or its documentation says how.
//!
//! | type | unit | range | in the AER word |
//! |---|---|---|---|
//! | [`PixelAddress`] | macropixel | 0..=65,535 | 16 bits |
//! | [`LaserCycle`] | laser cycles since the start | 0..=2⁶⁴−1 | 16 bits + time word |
//! | [`BinIndex`] | histogram bin | 0..=1,023 | 10 bits |
//! | [`Count`] | photons | 0..=16,777,215 | 24 bits |
//! | [`SubBinOffset`] | 1/256 bin from the start of the peak bin | −2..+2 bins | 10 bits |
//! | [`BlockLevel`] | pixels of a side, as a power of two | 0..=3 | 2 bits |
//! | [`EchoNumber`] | echoes of an exposure | 1..=4 | 2 bits |
//! | [`BinPosition`] | 1/256 bin from the start of bin 0 | −2..1,025 bins | derived |

use core::fmt;

/// A bounded unsigned newtype: `new` is checked.
macro_rules! bounded {
    ($(#[$doc:meta])* $name:ident($raw:ty), max $max:expr) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub struct $name($raw);

        impl $name {
            /// The largest value.
            pub const MAX: Self = Self($max);

            /// The quantity, or `None` above [`Self::MAX`].
            #[inline]
            #[must_use]
            pub const fn new(raw: $raw) -> Option<Self> {
                if raw <= $max { Some(Self(raw)) } else { None }
            }

            /// The quantity, limited to [`Self::MAX`].
            #[inline]
            #[must_use]
            pub const fn saturating(raw: $raw) -> Self {
                if raw <= $max { Self(raw) } else { Self::MAX }
            }

            /// The plain integer.
            #[inline]
            #[must_use]
            pub const fn raw(self) -> $raw {
                self.0
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                fmt::Display::fmt(&self.0, f)
            }
        }
    };
}

bounded! {
    /// A bin of a histogram, counted from 0.
    BinIndex(u16), max 1023
}

bounded! {
    /// Photons in one bin: 10 bits in the paper's FPGA, up to 24 bits in
    /// recorded histograms.
    Count(u32), max 0x00ff_ffff
}

bounded! {
    /// How many pixels decide together (adaptive binning): level 0 is one pixel, level `k`
    /// a block of 2ᵏ × 2ᵏ pixels, fewer at the array's edge.
    BlockLevel(u8), max 3
}

impl BlockLevel {
    /// One pixel.
    pub const PIXEL: Self = Self(0);

    /// Pixels of a whole block: 1, 4, 16 or 64.
    #[inline]
    #[must_use]
    pub const fn pixels(self) -> u64 {
        1 << (2 * self.0)
    }
}

/// Which of the echoes that a pixel reports within an exposure: 1 to 4, in the order in
/// which they stood clear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EchoNumber(u8);

impl EchoNumber {
    /// The first, and the only one unless pixels report more.
    pub const FIRST: Self = Self(1);
    /// The last that a pixel can report.
    pub const LAST: Self = Self(4);

    /// From 1 to 4, or `None`.
    #[inline]
    #[must_use]
    pub const fn new(raw: u8) -> Option<Self> {
        if 1 <= raw && raw <= Self::LAST.0 {
            Some(Self(raw))
        } else {
            None
        }
    }

    /// From 1 to 4.
    #[inline]
    #[must_use]
    pub const fn raw(self) -> u8 {
        self.0
    }
}

impl fmt::Display for EchoNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0, f)
    }
}

/// An unsigned newtype without bounds: `new` takes every integer.
macro_rules! unbounded {
    ($(#[$doc:meta])* $name:ident($raw:ty)) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name($raw);

        // Not derived: that borrows the integer, which a packed one does not allow.
        #[cfg(feature = "defmt")]
        impl defmt::Format for $name {
            fn format(&self, f: defmt::Formatter<'_>) {
                defmt::write!(f, "{=str}({})", stringify!($name), self.raw());
            }
        }

        impl $name {
            /// The quantity.
            #[inline]
            #[must_use]
            pub const fn new(raw: $raw) -> Self {
                Self(raw)
            }

            /// The plain integer.
            #[inline]
            #[must_use]
            pub const fn raw(self) -> $raw {
                self.0
            }
        }
    };
}

unbounded! {
    /// Which macropixel an event comes from; row-major in an array.
    PixelAddress(u16)
}

unbounded! {
    /// When: laser cycles since the sensor was started, the first being 0.
    // Aligned as 32-bit words are, so that an event has no padding.
    #[repr(Rust, packed(4))]
    LaserCycle(u64)
}

/// Distance from the **start of the peak bin**, in 1/256 bin: −2 bins
/// inclusive to +2 bins exclusive. A photon spread evenly over the peak bin
/// averages +0.5 bin, [`SubBinOffset::CENTRE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SubBinOffset(i16);

impl SubBinOffset {
    /// Two bins before the start of the peak bin.
    pub const MIN: Self = Self(-512);
    /// The middle of the peak bin.
    pub const CENTRE: Self = Self(128);
    /// 1/256 bin before the end of the bin that follows the peak bin.
    pub const MAX: Self = Self(511);

    /// From 1/256 bins, or `None` outside [`Self::MIN`]..=[`Self::MAX`].
    #[inline]
    #[must_use]
    pub const fn new(raw: i16) -> Option<Self> {
        if Self::MIN.0 <= raw && raw <= Self::MAX.0 {
            Some(Self(raw))
        } else {
            None
        }
    }

    /// In 1/256 bins.
    #[inline]
    #[must_use]
    pub const fn raw(self) -> i16 {
        self.0
    }
}

/// Distance from the **start of bin 0**, in 1/256 bin (signed: an estimator may
/// place a pulse up to two bins before bin 0).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BinPosition(i32);

impl BinPosition {
    /// The number of fractional bits of [`Self::raw`].
    pub const FRACTIONAL_BITS: u32 = 8;
    /// 1,024 bins and 255/256: the farthest an event can lie.
    pub const MAX: Self = Self::of(BinIndex::MAX, SubBinOffset::MAX);
    /// Two bins before bin 0: the nearest.
    pub const MIN: Self = Self::of(BinIndex(0), SubBinOffset::MIN);

    /// From 1/256 bins, or `None` outside [`Self::MIN`]..=[`Self::MAX`].
    #[inline]
    #[must_use]
    pub const fn new(raw: i32) -> Option<Self> {
        if Self::MIN.0 <= raw && raw <= Self::MAX.0 {
            Some(Self(raw))
        } else {
            None
        }
    }

    /// Where `offset` from the start of `bin` lies. Exact.
    #[inline]
    #[must_use]
    pub const fn of(bin: BinIndex, offset: SubBinOffset) -> Self {
        // 10 + 8 bits, plus or minus 9.
        Self(((bin.0 as i32) << Self::FRACTIONAL_BITS) + offset.0 as i32)
    }

    /// In 1/256 bins.
    #[inline]
    #[must_use]
    pub const fn raw(self) -> i32 {
        self.0
    }
}
