//! Errors of a TDC7200.

use core::fmt;

use crate::SensorFault;

/// An error of the bus (`B`), of a pin (`P`) or of the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Error<B, P> {
    /// The bus failed.
    Bus(B),
    /// A pin failed.
    Pin(P),
    /// After its reset the device does not have the register values of a TDC7200:
    /// CONFIG2 = 0x40, `INT_MASK` = 0x07. It has no identification register.
    WrongChip {
        /// The value of CONFIG2.
        config2: u8,
        /// The value of `INT_MASK`.
        int_mask: u8,
    },
    /// A register does not hold what was written to it.
    NotWritten {
        /// Its address.
        register: u8,
        /// The value written.
        wrote: u8,
        /// The value read.
        read: u8,
    },
    /// No interrupt came: START is missing, or the sensor is gone.
    Timeout,
    /// INTB stays low while `INT_STATUS` names no reason.
    StuckInterrupt {
        /// `INT_STATUS`.
        status: u8,
    },
    /// `INT_STATUS` reads as all ones, reserved bits included: nothing drives the bus.
    NoAnswer,
    /// A result register has an odd number of ones, parity bit included.
    Parity {
        /// Its address.
        register: u8,
    },
    /// Stops were measured but CALIBRATION2 is not greater than CALIBRATION1.
    Calibration {
        /// CALIBRATION1.
        calibration1: u32,
        /// CALIBRATION2.
        calibration2: u32,
    },
}

impl<B: fmt::Debug, P: fmt::Debug> fmt::Display for Error<B, P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bus(error) => write!(f, "TDC7200: SPI: {error:?}"),
            Self::Pin(error) => write!(f, "TDC7200: pin: {error:?}"),
            Self::WrongChip { config2, int_mask } => write!(
                f,
                "not a TDC7200: CONFIG2 {config2:#04x}, INT_MASK {int_mask:#04x} after reset"
            ),
            Self::NotWritten {
                register,
                wrote,
                read,
            } => write!(
                f,
                "TDC7200: register {register:#04x} reads {read:#04x}, not {wrote:#04x}"
            ),
            Self::Timeout => f.write_str("TDC7200: no interrupt: START does not come"),
            Self::StuckInterrupt { status } => {
                write!(f, "TDC7200: INTB stays low, INT_STATUS {status:#04x}")
            }
            Self::NoAnswer => f.write_str("TDC7200: does not answer"),
            Self::Parity { register } => {
                write!(f, "TDC7200: parity of register {register:#04x}")
            }
            Self::Calibration {
                calibration1,
                calibration2,
            } => write!(
                f,
                "TDC7200: calibration counts {calibration1} and {calibration2}"
            ),
        }
    }
}

impl<B: fmt::Debug, P: fmt::Debug> core::error::Error for Error<B, P> {}

impl<B, P> From<Error<B, P>> for SensorFault {
    fn from(error: Error<B, P>) -> Self {
        match error {
            Error::Bus(_) => Self::Bus,
            Error::Pin(_) => Self::Pin,
            // A bus that nothing drives reads so.
            Error::NoAnswer
            | Error::WrongChip {
                config2: 0x00,
                int_mask: 0x00,
            }
            | Error::WrongChip {
                config2: 0xff,
                int_mask: 0xff,
            } => Self::NoAnswer,
            Error::WrongChip { .. } => Self::WrongChip,
            Error::NotWritten { .. } => Self::Rejected,
            Error::Timeout => Self::Timeout,
            Error::StuckInterrupt { .. } => Self::StuckInterrupt,
            Error::Parity { .. } | Error::Calibration { .. } => Self::Data,
        }
    }
}
