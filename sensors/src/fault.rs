//! The kinds of errors that all sensors share.

use core::convert::Infallible;

/// The kind of a sensor's error. The drivers' own errors say more; each is of one
/// of these kinds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SensorFault {
    /// Nobody is on the bus: unplugged, without power, or another address.
    NoAnswer,
    /// The bus failed otherwise.
    Bus,
    /// A pin failed.
    Pin,
    /// Another chip, or another program on it, than the driver is for.
    WrongChip,
    /// The sensor does not take a command or a setting, or is never done with it.
    NotTaken,
    /// No data in time: the laser or its START does not come, or the sensor is
    /// gone.
    Timeout,
    /// The interrupt pin stays active for no reason the sensor names.
    StuckInterrupt,
    /// The sensor has to be loaded with its program, and there is none.
    NoImage,
    /// Data that cannot be. They are given up.
    Data,
}

impl From<Infallible> for SensorFault {
    fn from(never: Infallible) -> Self {
        match never {}
    }
}
