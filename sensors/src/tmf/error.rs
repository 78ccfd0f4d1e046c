//! Errors of a TMF sensor.

use core::fmt;

use crate::SensorFault;
use crate::protocol::Failure;

/// The step that took too long. `Boot` and `Cmd` are the commands of the bootloader and of the
/// application.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Waiting<Boot, Cmd> {
    /// The processor did not get ready after ENABLE.
    PowerUp,
    /// A command of the bootloader did not end.
    Bootloader(Boot),
    /// The loaded application did not start.
    Application,
    /// A command of the application did not end.
    Command(Cmd),
    /// No frame or packet came: the sensor is gone or does not measure.
    Data,
}

/// The errors that only one model of TMF sensor has: `DeviceError` of [`tmf882x`](crate::tmf882x) or of
/// [`tmf8829`](crate::tmf8829).
pub trait ModelError: Copy + fmt::Debug + fmt::Display + Into<SensorFault> {
    /// The name of the sensor in messages.
    const SENSOR: &'static str;
}

/// An error of the bus (`B`), of a pin (`P`), of any TMF sensor, or of this kind of sensor (`D`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Error<B, P, Boot, Cmd, D> {
    /// No device acknowledged the address, or the bus does not tell which byte was not
    /// acknowledged.
    Nack(B),
    /// The bus failed otherwise. This includes a byte after the address that is not acknowledged:
    /// a device is there.
    Bus(B),
    /// A pin failed.
    Pin(P),
    /// An awaited bus did not finish a transfer in time.
    BusTimeout,
    /// A step took too long.
    Timeout(Waiting<Boot, Cmd>),
    /// The register ID is that of another chip.
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
    /// The application refused a command.
    Refused {
        /// The command.
        command: Cmd,
        /// The value of `CMD_STAT`.
        status: u8,
    },
    /// The application shows another page than the requested one.
    WrongPage {
        /// The page.
        page: u8,
    },
    /// INT stays low while `INT_STATUS` names no reason that the driver serves.
    StuckInterrupt {
        /// The value of `INT_STATUS`.
        status: u8,
    },
    /// An error that only this kind of sensor has.
    Device(D),
}

impl<B, P, Boot, Cmd, D> From<Failure<B, P>> for Error<B, P, Boot, Cmd, D> {
    fn from(failure: Failure<B, P>) -> Self {
        match failure {
            Failure::Nack(error) => Self::Nack(error),
            Failure::Bus(error) => Self::Bus(error),
            Failure::Pin(error) => Self::Pin(error),
            Failure::BusTimeout => Self::BusTimeout,
        }
    }
}

impl<B, P, Boot, Cmd, D: ModelError> From<D> for Error<B, P, Boot, Cmd, D> {
    fn from(error: D) -> Self {
        Self::Device(error)
    }
}

impl<B, P, Boot, Cmd, D> fmt::Display for Error<B, P, Boot, Cmd, D>
where
    B: fmt::Debug,
    P: fmt::Debug,
    Boot: fmt::Debug,
    Cmd: fmt::Debug,
    D: ModelError,
{
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", D::SENSOR)?;
        match self {
            Self::Nack(error) => write!(f, "not acknowledged: {error:?}"),
            Self::Bus(error) => write!(f, "bus: {error:?}"),
            Self::BusTimeout => f.write_str("the bus does not finish a transfer"),
            Self::Pin(error) => write!(f, "pin: {error:?}"),
            Self::Timeout(waiting) => write!(f, "timed out: {waiting:?}"),
            Self::WrongChip { id } => write!(f, "another chip answers: ID {id:#04x}"),
            Self::WrongApplication { id } => write!(f, "runs application {id:#04x}"),
            Self::NoImage => f.write_str("there is no image to load"),
            Self::Refused { command, status } => {
                write!(f, "refused {command:?} with status {status:#04x}")
            }
            Self::WrongPage { page } => write!(f, "shows page {page:#04x}"),
            Self::StuckInterrupt { status } => {
                write!(f, "INT stays low, INT_STATUS {status:#04x}")
            }
            Self::Device(error) => fmt::Display::fmt(error, f),
        }
    }
}

impl<B, P, Boot, Cmd, D> core::error::Error for Error<B, P, Boot, Cmd, D>
where
    B: fmt::Debug,
    P: fmt::Debug,
    Boot: fmt::Debug,
    Cmd: fmt::Debug,
    D: ModelError,
{
}

impl<B, P, Boot, Cmd, D: ModelError> From<Error<B, P, Boot, Cmd, D>> for SensorFault {
    fn from(error: Error<B, P, Boot, Cmd, D>) -> Self {
        match error {
            Error::Nack(_) => Self::NoAnswer,
            Error::Bus(_) | Error::BusTimeout => Self::Bus,
            Error::Pin(_) => Self::Pin,
            Error::WrongChip { .. } | Error::WrongApplication { .. } => Self::WrongChip,
            Error::Timeout(Waiting::Data) => Self::Timeout,
            Error::Timeout(_) | Error::Refused { .. } | Error::WrongPage { .. } => Self::Rejected,
            Error::StuckInterrupt { .. } => Self::StuckInterrupt,
            Error::NoImage => Self::NoImage,
            Error::Device(error) => error.into(),
        }
    }
}
