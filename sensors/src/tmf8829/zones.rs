//! Zones, presets and bins: what each frame holds.

use dtof_core::fixed::types::U16F16;

/// Reference histograms of a frame.
pub(super) const REFERENCES: u16 = 4;
/// Bins of a reference histogram, and of a zone unless there are 8×8.
pub(super) const FEW_BINS: u16 = 64;
/// Picoseconds of a bin before any shift. The pulses of a public log fit it as well as 203.8 ps.
pub const FINEST_BIN_PS: U16F16 = U16F16::lit("203.65");

/// The zones of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Zones {
    /// 8×8 zones of 4 × (3×2) SPADs.
    Z8x8,
    /// 16×16 zones of 3×2 SPADs.
    Z16x16,
    /// 32×32 zones of 2×1 SPADs.
    Z32x32Pairs,
    /// 32×32 zones of one SPAD.
    Z32x32,
    /// 48 columns and 32 rows of zones of one SPAD.
    Z48x32,
}

impl Zones {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Z8x8,
        Self::Z16x16,
        Self::Z32x32Pairs,
        Self::Z32x32,
        Self::Z48x32,
    ];

    /// Columns and rows.
    #[must_use]
    pub const fn size(self) -> (u16, u16) {
        match self {
            Self::Z8x8 => (8, 8),
            Self::Z16x16 => (16, 16),
            Self::Z32x32Pairs | Self::Z32x32 => (32, 32),
            Self::Z48x32 => (48, 32),
        }
    }

    /// Zones of a measurement.
    #[must_use]
    pub const fn number(self) -> u16 {
        let (columns, rows) = self.size();
        columns * rows
    }

    /// Time slots of a measurement, each with a frame of histograms.
    #[must_use]
    pub const fn frames(self) -> u8 {
        match self {
            Self::Z8x8 | Self::Z16x16 => 2,
            Self::Z32x32Pairs | Self::Z32x32 => 8,
            Self::Z48x32 => 12,
        }
    }

    /// The register `fp_mode`, and the low half of a frame's identification.
    pub(super) const fn mode(self) -> u8 {
        match self {
            Self::Z8x8 => 0,
            Self::Z16x16 => 2,
            Self::Z32x32Pairs => 3,
            Self::Z32x32 => 4,
            Self::Z48x32 => 5,
        }
    }

    /// Whether a measurement has two frames of results: of the even rows and of the odd ones.
    pub(super) const fn is_halved(self) -> bool {
        !matches!(self, Self::Z8x8 | Self::Z16x16)
    }

    /// Zones of a frame of results.
    pub(super) const fn result_zones(self) -> u16 {
        self.number() / (1 + self.is_halved() as u16)
    }

    /// Zones of a frame of histograms.
    pub(super) const fn frame_zones(self) -> u16 {
        self.number() / self.frames() as u16
    }

    /// Bins of a zone's histogram as they are sent.
    pub(super) const fn bins(self) -> u16 {
        match self {
            Self::Z8x8 => 256,
            _ => FEW_BINS,
        }
    }

    /// Row by row, the number of the zone that is at `index` of frame `frame` of histograms:
    /// the tables of AN001096 for x and y.
    pub(super) const fn of_histogram(self, frame: u8, index: u16) -> u16 {
        let (columns, s) = (self.size().0, frame as u16);
        let width = if matches!(self, Self::Z8x8) { 4 } else { 8 };
        let (i, j) = (index / width, index % width);
        let (x, y) = match self {
            Self::Z8x8 | Self::Z16x16 => (j + width * s, i),
            Self::Z32x32Pairs | Self::Z32x32 => (2 * j + 16 * (s % 2) + s / 2 % 2, 2 * i + s / 4),
            Self::Z48x32 => (3 * j + 24 * (s % 2) + s / 2 % 3, 2 * i + s / 6),
        };
        y * columns + x
    }

    /// The same for frames of results, of which the second has the odd rows.
    pub(super) const fn of_result(self, is_second: bool, index: u16) -> u16 {
        if !self.is_halved() {
            return index;
        }
        let columns = self.size().0;
        let (row, column) = (index / columns, index % columns);
        (2 * row + is_second as u16) * columns + column
    }
}

/// The vendor's presets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Preset {
    /// 54 bins of 814.6 ps.
    #[default]
    Standard,
    /// 104 bins of 814.6 ps. Only 8×8 zones have it.
    LongRange,
    /// Shorter pulses. 64 bins of 203.65 ps; with 8×8 zones 109 of 407.3 ps, each of two of the
    /// sensor's.
    HighAccuracy,
}

impl Preset {
    /// The command that loads it.
    pub(super) const fn command(self, zones: Zones) -> u8 {
        match (self, zones) {
            (Self::Standard | Self::LongRange, Zones::Z8x8) => 0x40 + self as u8,
            (Self::HighAccuracy, Zones::Z8x8) => 0x42,
            (_, Zones::Z16x16) => 0x43 + self.is_fine() as u8,
            (_, Zones::Z32x32Pairs | Zones::Z32x32) => 0x45 + self.is_fine() as u8,
            (_, Zones::Z48x32) => 0x47 + self.is_fine() as u8,
        }
    }

    const fn is_fine(self) -> bool {
        matches!(self, Self::HighAccuracy)
    }

    /// A bin of the histogram is 2 to this power of the sensor's bins.
    pub(super) const fn merge(self, zones: Zones) -> u8 {
        (self.is_fine() && matches!(zones, Zones::Z8x8)) as u8
    }

    /// Bins that hold photons for their whole width.
    pub(super) const fn bins(self, zones: Zones) -> u16 {
        match (self, zones) {
            (Self::Standard, _) => 218 >> 2,
            (Self::LongRange, _) => 418 >> 2,
            (Self::HighAccuracy, Zones::Z8x8) => 218 >> 1,
            (Self::HighAccuracy, _) => 64,
        }
    }

    /// From one laser pulse to the next, in hundredths of a picosecond.
    pub(super) const fn laser_period(self) -> u64 {
        let steps = match self {
            Self::Standard | Self::HighAccuracy => 249,
            Self::LongRange => 449,
        };
        steps * 20_365
    }

    /// The width of the histogram's bins.
    pub(super) const fn bin_width(self, zones: Zones) -> U16F16 {
        let shift = if self.is_fine() { self.merge(zones) } else { 2 };
        U16F16::from_bits(FINEST_BIN_PS.to_bits() << shift)
    }
}
