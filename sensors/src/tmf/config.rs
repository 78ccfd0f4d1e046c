//! Settings of a TMF sensor that cannot be used.

use core::fmt;

/// Settings that cannot be used: the error of [`tmf882x::Config::new`](crate::tmf882x::Config::new) and
/// of [`tmf8829::Config::new`](crate::tmf8829::Config::new), which alone returns the last four.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ConfigError {
    /// The I²C address is reserved: below 0x08 or above 0x77.
    Address,
    /// A measurement without pulses.
    ZeroIterations,
    /// The last zone or the last reference has no pixel address.
    Pixels,
    /// A reference has the pixel of a zone.
    Reference,
    /// The time limit for data is not longer than the period.
    Timeout,
    /// The pulses of a measurement take longer than its period. A period of 0 is refused for the
    /// same reason: the sensor would make a single measurement.
    Period,
    /// Only 8×8 zones have the preset for long ranges.
    LongRange,
    /// No target a zone, or more than four.
    Peaks,
    /// A frame of results would have more than 8,192 bytes, which the sensor refuses.
    ResultSize,
}

impl ConfigError {
    /// The reason, in one line.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Address => "the I2C address must be within 0x08 and 0x77",
            Self::ZeroIterations => "a measurement needs at least 1,024 pulses",
            Self::Pixels => "the pixels of all zones do not fit behind the first",
            Self::Reference => "a reference has the pixel of a zone",
            Self::Timeout => "data would time out within one period",
            Self::Period => "the pulses of a measurement take longer than its period",
            Self::LongRange => "only 8x8 zones have a preset for long ranges",
            Self::Peaks => "a zone has 1 to 4 targets",
            Self::ResultSize => "the results of all zones are more than the sensor's 8,192 bytes",
        }
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}

impl core::error::Error for ConfigError {}

/// Checks a 7-bit address and the pulses of a measurement, in 1,024.
///
/// # Errors
/// Returns [`ConfigError::Address`] or [`ConfigError::ZeroIterations`].
pub(crate) const fn check_address_and_pulses(
    address: u8,
    kilo_iterations: u16,
) -> Result<(), ConfigError> {
    if address < 0x08 || address > 0x77 {
        return Err(ConfigError::Address);
    }
    if kilo_iterations == 0 {
        return Err(ConfigError::ZeroIterations);
    }
    Ok(())
}
