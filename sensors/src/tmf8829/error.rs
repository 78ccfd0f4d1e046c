//! Errors of a TMF8829.

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
    /// A frame: the sensor is gone or does not measure.
    Frame,
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
    /// The register ID is not that of a TMF8829.
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
    /// The image is longer than the sensor takes, 16 KiB.
    LongImage,
    /// The bootloader refused a command.
    Bootloader {
        /// The command.
        command: BootCommand,
        /// The value of `CMD_STAT`.
        status: u8,
    },
    /// The application refused a command.
    Refused {
        /// The command.
        command: Command,
        /// The value of `CMD_STAT`.
        status: u8,
    },
    /// The application shows another page than the preset's.
    WrongPage {
        /// Which.
        page: u8,
    },
    /// INT stays low while `INT_STATUS` names no reason.
    StuckInterrupt {
        /// The value of `INT_STATUS`.
        status: u8,
    },
    /// The FIFO has lost data. The measurement is given up.
    Overrun {
        /// The value of FIFOSTATUS.
        status: u8,
    },
    /// What came is no frame of this measurement. It is given up.
    ForeignFrame {
        /// Its identification: kind and mode.
        id: u8,
        /// Its format, or the number of its time slot.
        part: u8,
        /// The length it says.
        payload: u16,
    },
    /// A frame does not end where it should. The measurement is given up. Its histograms have been
    /// given: those behind the bytes that were lost are wrong.
    NoEnd {
        /// What came instead of the end marker.
        marker: u16,
    },
    /// The numbers of frames leave some out. The frame that came is good.
    Missed {
        /// The number of the frame that should have come.
        expected: u32,
        /// The number of the frame that came.
        found: u32,
    },
    /// The sensor broke the measurement off or says that the frame is not valid. Its histograms
    /// have been given.
    Aborted {
        /// The bits at its end.
        flags: u8,
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
        f.write_str("TMF8829: ")?;
        match self {
            Self::Nack(error) => write!(f, "not acknowledged: {error:?}"),
            Self::Bus(error) => write!(f, "I2C: {error:?}"),
            Self::Pin(error) => write!(f, "pin: {error:?}"),
            Self::Timeout(waiting) => write!(f, "timed out: {waiting:?}"),
            Self::WrongChip { id } => write!(f, "not one: ID {id:#04x}"),
            Self::WrongApplication { id } => write!(f, "runs application {id:#04x}"),
            Self::NoImage => f.write_str("there is no image to load"),
            Self::LongImage => f.write_str("the image is longer than 16 KiB"),
            Self::Bootloader { command, status } => {
                write!(f, "bootloader answers {status:#04x} to {command:?}")
            }
            Self::Refused { command, status } => {
                write!(f, "refused {command:?} with status {status:#04x}")
            }
            Self::WrongPage { page } => write!(f, "shows page {page:#04x}"),
            Self::StuckInterrupt { status } => {
                write!(f, "INT stays low, INT_STATUS {status:#04x}")
            }
            Self::Overrun { status } => write!(f, "lost data, FIFOSTATUS {status:#04x}"),
            Self::ForeignFrame { id, part, payload } => {
                write!(
                    f,
                    "frame {id:#04x}, {part:#04x} of {payload} bytes is none of ours"
                )
            }
            Self::NoEnd { marker } => write!(f, "a frame ends with {marker:#06x}"),
            Self::Missed { expected, found } => {
                write!(f, "frame {found} came, not {expected}")
            }
            Self::Aborted { flags } => write!(f, "a frame is not valid: {flags:#04x}"),
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
            Error::Timeout(Waiting::Frame) => Self::Timeout,
            Error::Timeout(_)
            | Error::LongImage
            | Error::Bootloader { .. }
            | Error::Refused { .. }
            | Error::WrongPage { .. } => Self::NotTaken,
            Error::StuckInterrupt { .. } => Self::StuckInterrupt,
            Error::NoImage => Self::NoImage,
            Error::Overrun { .. }
            | Error::ForeignFrame { .. }
            | Error::NoEnd { .. }
            | Error::Missed { .. }
            | Error::Aborted { .. } => Self::Data,
        }
    }
}
