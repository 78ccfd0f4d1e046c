//! How a TMF8820/21/28 measures.

use core::fmt;

use dtof_core::PixelAddress;

use super::frame::CHANNELS;
use super::registers::DEFAULT_ADDRESS;

/// The vendor's maps of nine zones that are measured at once (`SPAD_MAP_ID`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum SpadMap {
    /// 3×3 zones, 29° × 29°.
    #[default]
    Map1 = 1,
    /// 3×3 zones, 29° × 43.5°, macro mode.
    Map2 = 2,
    /// 3×3 zones, 29° × 43.5°, macro mode.
    Map3 = 3,
    /// 3×3 zones, 44° × 48°.
    Map6 = 6,
    /// Nine zones, 29° × 43.5°.
    Map8 = 8,
    /// Nine zones, 29° × 43.5°.
    Map9 = 9,
    /// 3×3 zones, 29° × 29°, a checkerboard.
    Map11 = 11,
    /// 3×3 zones, 29° × 29°, the other checkerboard.
    Map12 = 12,
}

/// How many zones a measurement has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Zones {
    /// Nine, of this map.
    Nine(SpadMap),
    /// 8×8 of a TMF8828, row by row, in four captures.
    SixtyFour,
}

impl Zones {
    /// How many they are.
    #[must_use]
    pub const fn number(self) -> u16 {
        match self {
            Self::Nine(_) => CHANNELS as u16 - 1,
            Self::SixtyFour => 64,
        }
    }
}

/// The choices there are. [`Config::new`] checks them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Settings {
    /// The pixel of the first zone; the others follow it.
    pub first_pixel: PixelAddress,
    /// The pixel that the reference histogram goes to, if to any.
    pub reference: Option<PixelAddress>,
    /// The I²C address to change to, 7 bits; 0x41 is the one after power-up.
    pub address: u8,
    /// `PERIOD_MS`: milliseconds from one measurement to the next. With 8×8 zones that seems to
    /// be all four captures.
    pub period_ms: u16,
    /// `KILO_ITERATIONS`: laser pulses a measurement, or half a capture, in 1,024.
    pub kilo_iterations: u16,
    /// How many zones, and which SPADs make them up (`SPAD_MAP_ID`).
    pub zones: Zones,
    /// Milliseconds a command may take.
    pub command_timeout_ms: u32,
    /// Milliseconds without a packet after which the measurement is given up.
    pub data_timeout_ms: u32,
    /// Polls in a row that may find INT low and `INT_STATUS` without a reason.
    pub stuck_limit: u8,
}

impl Settings {
    /// 537 × 1,024 pulses of map 1 as the vendor's drivers have it, but every
    /// 132 ms: at 400 kHz the 30 packets alone take 98 ms.
    #[must_use]
    pub const fn new(first_pixel: PixelAddress) -> Self {
        Self {
            first_pixel,
            reference: None,
            address: DEFAULT_ADDRESS,
            period_ms: 132,
            kilo_iterations: 537,
            zones: Zones::Nine(SpadMap::Map1),
            command_timeout_ms: 50,
            data_timeout_ms: 1000,
            stuck_limit: 3,
        }
    }

    /// The 8×8 zones of a TMF8828, with the same pulses. At 400 kHz its 244 packets and results
    /// take 0.8 s, so the period is one second.
    #[must_use]
    pub const fn of_8x8(first_pixel: PixelAddress) -> Self {
        Self {
            zones: Zones::SixtyFour,
            period_ms: 1000,
            data_timeout_ms: 2000,
            ..Self::new(first_pixel)
        }
    }
}

/// Checked [`Settings`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Config(Settings);

/// Settings that cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ConfigError {
    /// The I²C address is reserved: below 0x08 or above 0x77.
    Address,
    /// A measurement without pulses.
    ZeroIterations,
    /// The last zone would have a pixel past the last.
    Pixels,
    /// The reference would have the pixel of a zone.
    Reference,
    /// The time limit of data is not longer than the period.
    Timeout,
}

impl ConfigError {
    /// The reason, in one line.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Address => "the I2C address must be within 0x08 and 0x77",
            Self::ZeroIterations => "a measurement needs at least 1,024 pulses",
            Self::Pixels => "the pixels of all zones do not fit behind the first",
            Self::Reference => "the reference has the pixel of a zone",
            Self::Timeout => "data would time out within one period",
        }
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}

impl core::error::Error for ConfigError {}

impl Config {
    /// Checks `settings`.
    ///
    /// # Errors
    /// [`ConfigError`] says what cannot be.
    pub const fn new(settings: Settings) -> Result<Self, ConfigError> {
        if settings.address < 0x08 || settings.address > 0x77 {
            return Err(ConfigError::Address);
        }
        if settings.kilo_iterations == 0 {
            return Err(ConfigError::ZeroIterations);
        }
        let PixelAddress(first) = settings.first_pixel;
        let Some(last) = first.checked_add(settings.zones.number() - 1) else {
            return Err(ConfigError::Pixels);
        };
        if let Some(PixelAddress(reference)) = settings.reference
            && first <= reference
            && reference <= last
        {
            return Err(ConfigError::Reference);
        }
        if settings.data_timeout_ms <= settings.period_ms as u32 {
            return Err(ConfigError::Timeout);
        }
        Ok(Self(settings))
    }

    /// The checked settings.
    #[must_use]
    pub const fn settings(&self) -> &Settings {
        &self.0
    }

    /// One more than the last pixel of a zone or the reference.
    pub(super) fn pixels(&self) -> u16 {
        let PixelAddress(first) = self.0.first_pixel;
        let zones = first.saturating_add(self.0.zones.number());
        let reference = self.0.reference.map(|PixelAddress(pixel)| pixel);
        reference.map_or(zones, |pixel| zones.max(pixel.saturating_add(1)))
    }

    /// Laser pulses a measurement, or half a capture.
    pub(super) const fn pulses(&self) -> u32 {
        self.0.kilo_iterations as u32 * 1024
    }

    /// Laser pulses that are counted in a thousand seconds, on average, rounded down. With 8×8
    /// zones nobody says.
    pub(super) const fn laser_millihertz(&self) -> u64 {
        if matches!(self.0.zones, Zones::SixtyFour) {
            return 0;
        }
        match (self.pulses() as u64 * 1_000_000).checked_div(self.0.period_ms as u64) {
            Some(rate) => rate,
            None => 0,
        }
    }

    /// Where the histogram of a zone goes.
    pub(super) const fn pixel(&self, zone: u8) -> Option<PixelAddress> {
        let PixelAddress(first) = self.0.first_pixel;
        // At most the last zone, which fits.
        Some(PixelAddress(first.saturating_add(zone as u16)))
    }
}
