//! Errors of a TMF8820/21/28.

use core::fmt;

use super::registers::{BootCommand, Command};
use crate::SensorFault;
use crate::tmf;

/// An error of the bus (`B`), of a pin (`P`) or of the sensor.
pub type Error<B, P> = tmf::Error<B, P, BootCommand, Command, DeviceError>;

/// The step that took too long.
pub type Waiting = tmf::Waiting<BootCommand, Command>;

/// An error that only a TMF8820/21/28 has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum DeviceError {
    /// The bootloader refused a command, or its answer is malformed.
    Bootloader {
        /// The command.
        command: BootCommand,
        /// Status, length, checksum.
        answer: [u8; 3],
    },
    /// The sensor accepted the command for 8×8 zones but does not have them; or it has them, and
    /// nine zones are configured.
    WrongMode {
        /// The value of MODE.
        mode: u8,
    },
    /// A result that is not a raw histogram. The driver drops the set.
    ForeignResult {
        /// Its identification.
        result: u8,
    },
    /// A packet does not have 128 data bytes. The driver drops the set.
    WrongSize {
        /// Data bytes according to its header.
        size: u8,
    },
    /// A packet is missing, doubled or out of order, and with it a byte of
    /// every count of a histogram. The driver drops the set. With 8×8 zones a set has 60 packets
    /// and a result as number 60: if that is missing, nothing confirms the zones of the set.
    OutOfOrder {
        /// The number of the packet that should have come.
        expected: u8,
        /// The number of the packet that came.
        found: u8,
    },
    /// With 8×8 zones, the result of another capture than the expected one: the histograms
    /// before it were given as those of other zones.
    WrongCapture {
        /// The capture that should have come, 0 to 3.
        expected: u8,
        /// The capture that came.
        found: u8,
    },
}

impl fmt::Display for DeviceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bootloader { command, answer } => {
                write!(f, "bootloader answers {answer:02x?} to {command:?}")
            }
            Self::WrongMode { mode } => write!(f, "is in the wrong mode, {mode:#04x}"),
            Self::ForeignResult { result } => {
                write!(f, "result {result:#04x} is not a raw histogram")
            }
            Self::WrongSize { size } => write!(f, "packet of {size} bytes, not 128"),
            Self::OutOfOrder { expected, found } => {
                write!(f, "packet {found} came, not {expected}")
            }
            Self::WrongCapture { expected, found } => {
                write!(f, "the result of capture {found} came, not {expected}")
            }
        }
    }
}

impl core::error::Error for DeviceError {}

impl tmf::ModelError for DeviceError {
    const SENSOR: &'static str = "TMF882x";
}

impl From<DeviceError> for SensorFault {
    fn from(error: DeviceError) -> Self {
        match error {
            DeviceError::Bootloader { .. } | DeviceError::WrongMode { .. } => Self::Rejected,
            DeviceError::ForeignResult { .. }
            | DeviceError::WrongSize { .. }
            | DeviceError::OutOfOrder { .. }
            | DeviceError::WrongCapture { .. } => Self::Data,
        }
    }
}
