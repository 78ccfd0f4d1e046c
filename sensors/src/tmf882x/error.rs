//! Errors of a TMF8820/21/28.

use core::fmt;

use super::registers::{BootCommand, Command};
use crate::SensorFault;
use crate::protocol::Failure;

/// The step that took too long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Waiting {
    /// The processor's being ready, after ENABLE.
    PowerUp,
    /// The end of a command of the bootloader.
    Bootloader(BootCommand),
    /// The application that was loaded.
    Application,
    /// The end of a command of the application.
    Command(Command),
    /// A packet of a histogram: the sensor is gone or does not measure.
    Histogram,
}

/// An error of the bus (`B`), of a pin (`P`) or of the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Error<B, P> {
    /// Nobody acknowledged the address, or the bus does not tell what was not
    /// acknowledged.
    Nack(B),
    /// The bus failed otherwise. So it does when a byte after the address is not
    /// acknowledged: somebody is there.
    Bus(B),
    /// A pin failed.
    Pin(P),
    /// Something took too long.
    Timeout(Waiting),
    /// The register ID is not that of a TMF8820/21/28.
    WrongChip {
        /// The value of ID.
        id: u8,
    },
    /// Neither the bootloader nor the measurement application runs.
    WrongApplication {
        /// The value of APPID.
        id: u8,
    },
    /// The bootloader runs, but there is no image to load.
    NoImage,
    /// The bootloader refused a command, or its answer is none.
    Bootloader {
        /// The command.
        command: BootCommand,
        /// Status, length, checksum.
        answer: [u8; 3],
    },
    /// The application refused a command.
    Refused {
        /// The command.
        command: Command,
        /// The value of `CMD_STAT`.
        status: u8,
    },
    /// The application shows another page than the common configuration.
    WrongPage {
        /// The value of `CONFIG_RESULT`.
        page: u8,
    },
    /// The sensor does not have 8×8 zones, though it has taken the command; or it has them, and nine
    /// are wanted.
    WrongMode {
        /// The value of MODE.
        mode: u8,
    },
    /// INT stays low while `INT_STATUS` names no reason, or none but results.
    StuckInterrupt {
        /// The value of `INT_STATUS`.
        status: u8,
    },
    /// A result that is no raw histogram. The set is given up.
    ForeignResult {
        /// Its identification.
        result: u8,
    },
    /// A packet of other than 128 data bytes. The set is given up.
    WrongSize {
        /// Data bytes it says it has.
        size: u8,
    },
    /// A packet is missing, doubled or out of order, and with it a byte of
    /// every count of a histogram. The set is given up. With 8×8 zones a set has 60 packets, and
    /// then a result as number 60: if that is missing, nothing confirms the zones of the set.
    OutOfOrder {
        /// The number of the packet that should have come.
        expected: u8,
        /// The number of the packet that came.
        found: u8,
    },
    /// With 8×8 zones, a result of another capture than the one that was due: the histograms
    /// before it were given as those of other zones.
    WrongCapture {
        /// The capture that should have come, 0 to 3.
        expected: u8,
        /// The capture that came.
        found: u8,
    },
}

impl<B, P> From<Failure<B, P>> for Error<B, P> {
    fn from(failure: Failure<B, P>) -> Self {
        match failure {
            Failure::Nack(error) => Self::Nack(error),
            Failure::Bus(error) => Self::Bus(error),
            Failure::Pin(error) => Self::Pin(error),
        }
    }
}

impl<B: fmt::Debug, P: fmt::Debug> fmt::Display for Error<B, P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("TMF882x: ")?;
        match self {
            Self::Nack(error) => write!(f, "not acknowledged: {error:?}"),
            Self::Bus(error) => write!(f, "I2C: {error:?}"),
            Self::Pin(error) => write!(f, "pin: {error:?}"),
            Self::Timeout(waiting) => write!(f, "timed out: {waiting:?}"),
            Self::WrongChip { id } => write!(f, "not one: ID {id:#04x}"),
            Self::WrongApplication { id } => write!(f, "runs application {id:#04x}"),
            Self::NoImage => f.write_str("there is no image to load"),
            Self::Bootloader { command, answer } => {
                write!(f, "bootloader answers {answer:02x?} to {command:?}")
            }
            Self::Refused { command, status } => {
                write!(f, "refused {command:?} with status {status:#04x}")
            }
            Self::WrongPage { page } => write!(f, "shows page {page:#04x}"),
            Self::WrongMode { mode } => write!(f, "is in the wrong mode, {mode:#04x}"),
            Self::StuckInterrupt { status } => {
                write!(f, "INT stays low, INT_STATUS {status:#04x}")
            }
            Self::ForeignResult { result } => {
                write!(f, "result {result:#04x} is no raw histogram")
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

impl<B: fmt::Debug, P: fmt::Debug> core::error::Error for Error<B, P> {}

impl<B, P> From<Error<B, P>> for SensorFault {
    fn from(error: Error<B, P>) -> Self {
        match error {
            Error::Nack(_) => Self::NoAnswer,
            Error::Bus(_) => Self::Bus,
            Error::Pin(_) => Self::Pin,
            Error::WrongChip { .. } | Error::WrongApplication { .. } => Self::WrongChip,
            Error::Timeout(Waiting::Histogram) => Self::Timeout,
            Error::Timeout(_)
            | Error::Bootloader { .. }
            | Error::Refused { .. }
            | Error::WrongMode { .. }
            | Error::WrongPage { .. } => Self::NotTaken,
            Error::StuckInterrupt { .. } => Self::StuckInterrupt,
            Error::NoImage => Self::NoImage,
            Error::ForeignResult { .. }
            | Error::WrongSize { .. }
            | Error::OutOfOrder { .. }
            | Error::WrongCapture { .. } => Self::Data,
        }
    }
}
