//! Why a device does not take a configuration.

use dtof_core::{ConfigError, GateError, RangeScaleError, WindowWidthError, ZeroThresholdError};

/// Why a configuration is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Refusal {
    /// Not as long as the record, or of an unknown source, rule, estimator, output,
    /// reference or number of hits.
    Unknown = 1,
    /// X is 0.
    ZeroX = 2,
    /// X is greater than L1.
    XAboveL1 = 3,
    /// L2 is not greater than L1.
    L2NotAboveL1 = 4,
    /// No look falls between L1 and L2.
    NoLook = 5,
    /// The gate ends past the last bin.
    GatePastLastBin = 6,
    /// The gate leaves fewer than 8 bins.
    GateTooNarrow = 7,
    /// The bin width is zero, or a range would be out of range.
    Range = 8,
    /// No pixels, or more than the device has.
    Pixels = 9,
    /// The minimum peak count is 0 or more than a counter holds.
    MinimumCount = 10,
    /// The device has no sensor.
    NoSensor = 11,
    /// The bins of the sensor are not as wide as that.
    BinWidth = 12,
    /// The window of the rule is not 1 to 7 bins wide.
    WindowWidth = 13,
    /// The centred window is not 1 to 4 bins wide on either side.
    HalfWidth = 14,
    /// The threshold of dynamic depth is less than half of 1/256 bin.
    ZeroThreshold = 15,
}

impl Refusal {
    const ALL: [Self; 15] = [
        Self::Unknown,
        Self::ZeroX,
        Self::XAboveL1,
        Self::L2NotAboveL1,
        Self::NoLook,
        Self::GatePastLastBin,
        Self::GateTooNarrow,
        Self::Range,
        Self::Pixels,
        Self::MinimumCount,
        Self::NoSensor,
        Self::BinWidth,
        Self::WindowWidth,
        Self::HalfWidth,
        Self::ZeroThreshold,
    ];

    /// From its number on the wire.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|&refusal| refusal as u8 == number)
    }
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Unknown => f.write_str("the configuration is not one this device knows"),
            Self::ZeroX => ConfigError::ZeroX.fmt(f),
            Self::XAboveL1 => ConfigError::XAboveL1.fmt(f),
            Self::L2NotAboveL1 => ConfigError::L2NotAboveL1.fmt(f),
            Self::NoLook => ConfigError::NoLook.fmt(f),
            Self::GatePastLastBin => GateError::PastLastBin.fmt(f),
            Self::GateTooNarrow => GateError::TooNarrow.fmt(f),
            Self::Range => f.write_str("the bin width is zero, or a range would be out of range"),
            Self::Pixels => f.write_str("the device does not have that many pixels"),
            Self::MinimumCount => f.write_str("the minimum peak count must be from 1 to 1023"),
            Self::NoSensor => f.write_str("the device has no sensor"),
            Self::BinWidth => f.write_str("the bins of the sensor are not as wide as that"),
            Self::WindowWidth => WindowWidthError.fmt(f),
            Self::HalfWidth => f.write_str("the centred window must be 1 to 4 bins to either side"),
            Self::ZeroThreshold => ZeroThresholdError.fmt(f),
        }
    }
}

impl core::error::Error for Refusal {}

impl From<ConfigError> for Refusal {
    fn from(error: ConfigError) -> Self {
        match error {
            ConfigError::ZeroX => Self::ZeroX,
            ConfigError::XAboveL1 => Self::XAboveL1,
            ConfigError::L2NotAboveL1 => Self::L2NotAboveL1,
            ConfigError::NoLook => Self::NoLook,
        }
    }
}

impl From<GateError> for Refusal {
    fn from(error: GateError) -> Self {
        match error {
            GateError::PastLastBin => Self::GatePastLastBin,
            GateError::TooNarrow => Self::GateTooNarrow,
        }
    }
}

impl From<WindowWidthError> for Refusal {
    fn from(_: WindowWidthError) -> Self {
        Self::WindowWidth
    }
}

impl From<ZeroThresholdError> for Refusal {
    fn from(_: ZeroThresholdError) -> Self {
        Self::ZeroThreshold
    }
}

impl From<RangeScaleError> for Refusal {
    fn from(_: RangeScaleError) -> Self {
        Self::Range
    }
}
