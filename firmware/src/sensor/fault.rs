//! What is wrong with a sensor, whichever it is: what a host is told.

use core::convert::Infallible;
use core::fmt;

/// The kind of a sensor's error. The drivers' own errors say more; each is of one
/// of these kinds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum SensorFault {
    /// Nobody is on the bus: unplugged, without power, or another address.
    NoAnswer = 1,
    /// The bus failed otherwise.
    Bus = 2,
    /// A pin failed.
    Pin = 3,
    /// Another chip, or another program on it, than the driver is for.
    WrongChip = 4,
    /// The sensor does not take a command or a setting, or is never done with it.
    NotTaken = 5,
    /// No data in time: the laser or its START does not come, or the sensor is
    /// gone.
    Timeout = 6,
    /// The interrupt pin stays active for no reason the sensor names.
    StuckInterrupt = 7,
    /// The sensor has to be loaded with its program, and there is none.
    NoImage = 8,
    /// Data that cannot be. They are given up.
    Data = 9,
}

impl SensorFault {
    const ALL: [Self; 9] = [
        Self::NoAnswer,
        Self::Bus,
        Self::Pin,
        Self::WrongChip,
        Self::NotTaken,
        Self::Timeout,
        Self::StuckInterrupt,
        Self::NoImage,
        Self::Data,
    ];

    /// From its number on the wire.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|&fault| fault as u8 == number)
    }
}

impl fmt::Display for SensorFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoAnswer => "no answer",
            Self::Bus => "bus error",
            Self::Pin => "pin error",
            Self::WrongChip => "wrong chip or program",
            Self::NotTaken => "command or setting not taken",
            Self::Timeout => "no data in time",
            Self::StuckInterrupt => "stuck interrupt",
            Self::NoImage => "no image to load",
            Self::Data => "damaged data",
        })
    }
}

impl core::error::Error for SensorFault {}

impl From<Infallible> for SensorFault {
    fn from(never: Infallible) -> Self {
        match never {}
    }
}
