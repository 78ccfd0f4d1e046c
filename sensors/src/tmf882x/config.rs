//! How a TMF8820/21/28 measures.

use dtof_core::PixelAddress;
use dtof_core::fixed::types::I24F8;

use super::frame::CHANNELS;
use super::registers::DEFAULT_ADDRESS;
use super::{BIN_WIDTH_8X8_PS, BIN_WIDTH_PS, OFFSET_MM};
use crate::SensorInfo;
use crate::tmf::{ConfigError, check_address_and_pulses};

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

/// The zones of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Zones {
    /// Nine, of this map.
    Nine(SpadMap),
    /// 8×8 of a TMF8828, row by row, in four captures.
    SixtyFour,
}

impl Zones {
    /// Their number.
    #[must_use]
    pub const fn number(self) -> u16 {
        match self {
            Self::Nine(_) => CHANNELS as u16 - 1,
            Self::SixtyFour => 64,
        }
    }
}

/// The settings. [`Config::new`] checks them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Settings {
    /// The pixel of the first zone; the others follow it.
    pub first_pixel: PixelAddress,
    /// The pixel of the reference histogram, if it is enabled.
    pub reference: Option<PixelAddress>,
    /// The I²C address to change to, 7 bits; 0x41 is the one after power-up.
    pub address: u8,
    /// `PERIOD_MS`: milliseconds from one measurement to the next. With 8×8 zones this
    /// seems to cover all four captures.
    pub period_ms: u16,
    /// `KILO_ITERATIONS`: laser pulses of a measurement, or of half a capture, in units of 1,024.
    pub kilo_iterations: u16,
    /// How many zones, and which SPADs make them up (`SPAD_MAP_ID`).
    pub zones: Zones,
    /// Milliseconds a command may take.
    pub command_timeout_ms: u32,
    /// Milliseconds without a packet after which the driver abandons the measurement.
    pub data_timeout_ms: u32,
    /// Polls in a row that may find INT low and `INT_STATUS` without a reason.
    pub stuck_limit: u8,
}

impl Settings {
    /// 537 × 1,024 pulses of map 1, the vendor's default, but every 132 ms: at 400 kHz the 30
    /// packets alone take 98 ms.
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

impl Config {
    /// Checks `settings`.
    ///
    /// # Errors
    /// Returns a [`ConfigError`] if the settings cannot be used.
    pub const fn new(settings: Settings) -> Result<Self, ConfigError> {
        if let Err(error) = check_address_and_pulses(settings.address, settings.kilo_iterations) {
            return Err(error);
        }
        let first = settings.first_pixel.raw();
        let Some(last) = first.checked_add(settings.zones.number() - 1) else {
            return Err(ConfigError::Pixels);
        };
        if let Some(reference) = settings.reference
            && first <= reference.raw()
            && reference.raw() <= last
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

    /// The description for a host, also as a constant. The laser rate is the mean over a period.
    #[must_use]
    pub const fn info(&self) -> SensorInfo {
        let (bin_width, offset) = match self.0.zones {
            Zones::Nine(_) => (BIN_WIDTH_PS, OFFSET_MM),
            Zones::SixtyFour => (BIN_WIDTH_8X8_PS, I24F8::ZERO),
        };
        SensorInfo {
            pixels: self.pixels(),
            bin_width: Some(bin_width),
            bins: 128,
            offset,
            gives_histograms: true,
            laser_millihertz: self.laser_millihertz(),
            most_dither: 0,
            dead_time: 0,
        }
    }

    /// One more than the last pixel of a zone or the reference.
    const fn pixels(&self) -> u16 {
        let first = self.0.first_pixel.raw();
        let zones = first.saturating_add(self.0.zones.number());
        match self.0.reference {
            Some(pixel) if pixel.raw() >= zones => pixel.raw().saturating_add(1),
            _ => zones,
        }
    }

    /// Laser pulses a measurement, or half a capture.
    pub(super) const fn pulses(&self) -> u32 {
        self.0.kilo_iterations as u32 * 1024
    }

    /// Laser pulses that are counted in a thousand seconds, on average, rounded down. 0 with 8×8
    /// zones, for which it is not documented.
    const fn laser_millihertz(&self) -> u64 {
        if matches!(self.0.zones, Zones::SixtyFour) {
            return 0;
        }
        match (self.pulses() as u64 * 1_000_000).checked_div(self.0.period_ms as u64) {
            Some(rate) => rate,
            None => 0,
        }
    }

    /// The pixel of a zone.
    pub(super) const fn pixel(&self, zone: u8) -> Option<PixelAddress> {
        let first = self.0.first_pixel.raw();
        // At most the last zone, which fits.
        Some(PixelAddress::new(first.saturating_add(zone as u16)))
    }
}
