//! The kinds of errors that all sensors share.

use core::convert::Infallible;

/// The kind of a sensor's error. The error of a driver has more detail.
///
/// It is exhaustive on purpose: a program that reports faults has to name each of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SensorFault {
    /// No device answers: it is unplugged, has no power, or has another address.
    NoAnswer,
    /// The bus failed otherwise.
    Bus,
    /// A pin failed.
    Pin,
    /// The chip, or the program on it, is not one that the driver supports.
    WrongChip,
    /// The sensor rejects a command or a setting, or never completes it.
    Rejected,
    /// No data in time: the laser or its START is missing, or the sensor is gone.
    Timeout,
    /// The interrupt pin stays active, but the status register names no reason.
    StuckInterrupt,
    /// The sensor needs a program image, and the driver has none.
    NoImage,
    /// The data are invalid and were dropped.
    Data,
}

impl From<Infallible> for SensorFault {
    fn from(never: Infallible) -> Self {
        match never {}
    }
}
