//! Errors of a TMF8829.

use core::fmt;

use super::registers::{BootCommand, Command};
use crate::SensorFault;
use crate::tmf;

/// An error of the bus (`B`), of a pin (`P`) or of the sensor.
pub type Error<B, P> = tmf::Error<B, P, BootCommand, Command, DeviceError>;

/// The step that took too long.
pub type Waiting = tmf::Waiting<BootCommand, Command>;

/// An error that only a TMF8829 has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum DeviceError {
    /// The image is longer than the sensor's 16 KiB.
    LongImage,
    /// The bootloader refused a command.
    Bootloader {
        /// The command.
        command: BootCommand,
        /// The value of `CMD_STAT`.
        status: u8,
    },
    /// The FIFO has lost data. The driver abandons the measurement.
    Overrun {
        /// The value of FIFOSTATUS.
        status: u8,
    },
    /// The data are not a frame of this measurement. The driver abandons it.
    ForeignFrame {
        /// Its identification: kind and mode.
        id: u8,
        /// Its format, or the number of its time slot.
        part: u8,
        /// The length in its header.
        payload: u16,
    },
    /// A frame does not end where it should. The driver abandons the measurement. Its histograms
    /// have been given: those behind the lost bytes are wrong.
    NoEnd {
        /// The bytes in place of the end marker.
        marker: u16,
    },
    /// There is a gap in the numbers of frames. The frame after it is good.
    Missed {
        /// The number of the frame that should have come.
        expected: u32,
        /// The number of the frame that came.
        found: u32,
    },
    /// The sensor aborted the measurement or marks the frame as not valid. Its histograms have
    /// been given.
    Aborted {
        /// The bits at its end.
        flags: u8,
    },
}

impl fmt::Display for DeviceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LongImage => f.write_str("the image is longer than 16 KiB"),
            Self::Bootloader { command, status } => {
                write!(f, "bootloader answers {status:#04x} to {command:?}")
            }
            Self::Overrun { status } => write!(f, "lost data, FIFOSTATUS {status:#04x}"),
            Self::ForeignFrame { id, part, payload } => write!(
                f,
                "frame {id:#04x}, {part:#04x} of {payload} bytes is not of this measurement"
            ),
            Self::NoEnd { marker } => write!(f, "a frame ends with {marker:#06x}"),
            Self::Missed { expected, found } => write!(f, "frame {found} came, not {expected}"),
            Self::Aborted { flags } => write!(f, "a frame is not valid: {flags:#04x}"),
        }
    }
}

impl core::error::Error for DeviceError {}

impl tmf::ModelError for DeviceError {
    const SENSOR: &'static str = "TMF8829";
}

impl From<DeviceError> for SensorFault {
    fn from(error: DeviceError) -> Self {
        match error {
            DeviceError::LongImage | DeviceError::Bootloader { .. } => Self::Rejected,
            DeviceError::Overrun { .. }
            | DeviceError::ForeignFrame { .. }
            | DeviceError::NoEnd { .. }
            | DeviceError::Missed { .. }
            | DeviceError::Aborted { .. } => Self::Data,
        }
    }
}
