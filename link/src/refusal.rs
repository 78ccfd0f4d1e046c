//! Why a device refuses a configuration.

use dtof_core::events::ZeroThresholdError;
use dtof_core::{ArrayError, GateError, PixelConfigError, RangeScaleError, WindowWidthError};

use crate::numbered::numbered;

numbered! {
    /// Why a configuration is refused.
    Refusal {
        /// The record has the wrong length, or an unknown source, rule, estimator, output,
        /// reference, origin of the dead time, levels, tracking, number of echoes or way to count.
        Unknown = 1: "the configuration is not one this device knows",
        /// X is 0.
        ZeroX = 2: PixelConfigError::ZeroX.text(),
        /// X is greater than L1.
        XAboveL1 = 3: PixelConfigError::XAboveL1.text(),
        /// L2 is not greater than L1.
        L2NotAboveL1 = 4: PixelConfigError::L2NotAboveL1.text(),
        /// No look falls between L1 and L2.
        NoLook = 5: PixelConfigError::NoLook.text(),
        /// The gate ends past the last bin.
        GatePastLastBin = 6: GateError::PastLastBin.text(),
        /// The gate leaves fewer than 8 bins.
        GateTooNarrow = 7: GateError::TooNarrow.text(),
        /// The bin width is zero, or a range would be out of range.
        Range = 8: "the bin width is zero, or a range would be out of range",
        /// No pixels, or more than the device has.
        Pixels = 9: "the device does not have that many pixels",
        /// The minimum peak count is 0 or more than a counter holds.
        MinimumCount = 10: "the minimum peak count must be from 1 to 1023, or to what a counter of 8 bits holds",
        /// The device has no sensor.
        NoSensor = 11: "the device has no sensor",
        /// The bins of the sensor have another width.
        BinWidth = 12: "the bins of the sensor are not as wide as that",
        /// The window of the rule is not 1 to 7 bins wide.
        WindowWidth = 13: WindowWidthError.text(),
        /// The centred window is not 1 to 4 bins wide on either side.
        HalfWidth = 14: "the centred window must be 1 to 4 bins to either side",
        /// The threshold of dynamic depth is less than half of 1/256 bin.
        ZeroThreshold = 15: ZeroThresholdError.text(),
        /// The patience of adaptive binning is 0.
        Patience = 16: "the patience of adaptive binning must be at least 1",
        /// There is no room for that many blocks of pixels, or there are no columns.
        Blocks = 17: "the device has no room for the blocks of pixels",
        /// Tracking with a rule other than the window rule.
        Tracking = 18: "tracking needs the window rule",
        /// The host timeout is not 200 ms to 60 s, or it is 0 and the firmware was not built
        /// for that.
        HostTimeout = 19: "the host timeout must be 200 to 60000 ms",
        /// A reserved field is not 0.
        Reserved = 20: "a reserved field is not 0",
        /// A dead time shorter than a histogram with another rule than the window rule, or with
        /// blocks of pixels.
        DeadTime = 21: "the dead time needs the window rule, without blocks",
        /// Once a bin, of a sensor that gives histograms.
        OncePerBin = 22: "the sensor gives histograms, where photons cannot count once per bin",
        /// A dither that is odd, more than the sensor can, or with photons from the link.
        Dither = 23: "the sensor cannot dither its laser by so many bins",
        /// Neighbours with another rule than the window rule, with blocks, with a dead time that is weighed,
        /// or with a sensor that gives histograms.
        Neighbours = 24: "neighbours need the window rule and photons, without blocks and without a dead time",
    }
}

impl From<PixelConfigError> for Refusal {
    fn from(error: PixelConfigError) -> Self {
        match error {
            PixelConfigError::ZeroX => Self::ZeroX,
            PixelConfigError::XAboveL1 => Self::XAboveL1,
            PixelConfigError::L2NotAboveL1 => Self::L2NotAboveL1,
            PixelConfigError::NoLook => Self::NoLook,
            _ => Self::Unknown,
        }
    }
}

impl From<ArrayError> for Refusal {
    fn from(error: ArrayError) -> Self {
        match error {
            ArrayError::Pixels | ArrayError::Layout => Self::Pixels,
            ArrayError::Blocks | ArrayError::NoLevel | ArrayError::OtherLooks => Self::Blocks,
            ArrayError::BlocksAndNeighbours | ArrayError::NeighboursAndDeadTime => Self::Neighbours,
            _ => Self::Unknown,
        }
    }
}

impl From<GateError> for Refusal {
    fn from(error: GateError) -> Self {
        match error {
            GateError::PastLastBin => Self::GatePastLastBin,
            GateError::TooNarrow => Self::GateTooNarrow,
            _ => Self::Unknown,
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
