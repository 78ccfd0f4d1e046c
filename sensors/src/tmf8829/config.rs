//! How a TMF8829 measures.

use dtof_core::PixelAddress;

use super::OFFSET_MM;
use super::registers::{BootCommand, DEFAULT_ADDRESS};
use super::zones::{Preset, REFERENCES, Zones};
use crate::SensorInfo;
use crate::tmf::{ConfigError, check_address_and_pulses};

/// The results of each zone beside its histogram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Results {
    /// Targets a zone, 1 to 4, nearest first. A cover glass may be the first.
    pub peaks: u8,
    /// The strength of each target.
    pub signal: bool,
    /// The mean bin outside the peaks.
    pub noise: bool,
    /// The strength of the crosstalk.
    pub crosstalk: bool,
}

impl Results {
    /// The register `result_format`.
    pub(super) const fn format(self) -> u8 {
        self.peaks
            | (self.signal as u8) << 3
            | (self.noise as u8) << 4
            | (self.crosstalk as u8) << 5
    }

    /// Bytes a zone.
    pub(super) const fn bytes(self) -> u16 {
        let of_peak = 3 + 2 * self.signal as u16;
        2 * (self.noise as u16 + self.crosstalk as u16) + self.peaks as u16 * of_peak
    }
}

/// The bus that the sensor is on. The bootloader switches the other one off: with both on, later traffic
/// fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Interface {
    /// I²C, at most 1 MHz.
    I2c {
        /// The address to change to, 7 bits; 0x41 is the one after power-up.
        address: u8,
    },
    /// SPI, at most 20 MHz: the driver's bus is a [`Spi`](super::Spi).
    Spi,
}

impl Interface {
    /// The address to change to; with SPI the one after power-up, which is not used.
    pub(super) const fn address(self) -> u8 {
        match self {
            Self::I2c { address } => address,
            Self::Spi => DEFAULT_ADDRESS,
        }
    }

    /// The command that switches the other bus off.
    pub(super) const fn other_off(self) -> BootCommand {
        match self {
            Self::I2c { .. } => BootCommand::SpiOff,
            Self::Spi => BootCommand::I2cOff,
        }
    }
}

/// The settings. [`Config::new`] checks them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Settings {
    /// The pixel of the zone in the first row and column; the others follow it row by row.
    pub first_pixel: PixelAddress,
    /// The pixel of the first of four reference histograms, if they are enabled; the other
    /// three follow it. They have 64 bins as the sensor sends them, never added. Their width with
    /// the preset for high accuracy is not published.
    pub reference: Option<PixelAddress>,
    /// How many zones.
    pub zones: Zones,
    /// The vendor's preset.
    pub preset: Preset,
    /// The results of each zone.
    pub results: Results,
    /// The bus. With another one than the driver's, the sensor does not come up.
    pub interface: Interface,
    /// Milliseconds from one measurement to the next. The pulses take 50.7 ns each, with long range
    /// 91.4 ns, and have to fit.
    pub period_ms: u16,
    /// Laser pulses of a measurement in units of 1,024, all time slots together.
    pub kilo_iterations: u16,
    /// Milliseconds a command may take.
    pub command_timeout_ms: u32,
    /// Milliseconds without data after which the driver abandons the measurement.
    pub data_timeout_ms: u32,
    /// Polls in a row that may find INT low and `INT_STATUS` without a reason.
    pub stuck_limit: u8,
}

impl Settings {
    /// The standard preset with 586 × 1,024 pulses, the vendor's default. The period is the time that a bus
    /// of 400 kHz needs for the histograms, some 600 ms for each time slot: 1.3 s with 8×8 and
    /// 16×16 zones, 5 s with 32×32, 7.5 s with 48×32.
    #[must_use]
    pub const fn new(first_pixel: PixelAddress, zones: Zones) -> Self {
        let period_ms = match zones {
            Zones::Z8x8 | Zones::Z16x16 => 1300,
            Zones::Z32x32Pairs | Zones::Z32x32 => 5000,
            Zones::Z48x32 => 7500,
        };
        Self {
            first_pixel,
            reference: None,
            zones,
            preset: Preset::Standard,
            results: Results {
                peaks: 2,
                signal: false,
                noise: false,
                crosstalk: false,
            },
            interface: Interface::I2c {
                address: DEFAULT_ADDRESS,
            },
            period_ms,
            kilo_iterations: 586,
            command_timeout_ms: 50,
            data_timeout_ms: period_ms as u32 + 1000,
            stuck_limit: 3,
        }
    }

    /// The same over SPI. The period is the time of the pulses and of a bus of 10 MHz, as the sensor waits while it is
    /// read: 80 ms with 8×8 and 16×16 zones, 210 ms with 32×32, 300 ms with 48×32.
    #[must_use]
    pub const fn over_spi(first_pixel: PixelAddress, zones: Zones) -> Self {
        let period_ms = match zones {
            Zones::Z8x8 | Zones::Z16x16 => 80,
            Zones::Z32x32Pairs | Zones::Z32x32 => 210,
            Zones::Z48x32 => 300,
        };
        Self {
            interface: Interface::Spi,
            period_ms,
            data_timeout_ms: period_ms as u32 + 1000,
            ..Self::new(first_pixel, zones)
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
        if let Err(error) =
            check_address_and_pulses(settings.interface.address(), settings.kilo_iterations)
        {
            return Err(error);
        }
        // In hundredths of a picosecond.
        let lasts = settings.kilo_iterations as u64 * 1024 * settings.preset.laser_period();
        if lasts > settings.period_ms as u64 * 100_000_000_000 {
            return Err(ConfigError::Period);
        }
        let zones = settings.zones;
        let first = settings.first_pixel.raw();
        let Some(last) = first.checked_add(zones.number() - 1) else {
            return Err(ConfigError::Pixels);
        };
        if let Some(reference) = settings.reference {
            let Some(last_reference) = reference.raw().checked_add(REFERENCES - 1) else {
                return Err(ConfigError::Pixels);
            };
            if reference.raw() <= last && first <= last_reference {
                return Err(ConfigError::Reference);
            }
        }
        if settings.data_timeout_ms <= settings.period_ms as u32 {
            return Err(ConfigError::Timeout);
        }
        if matches!(settings.preset, Preset::LongRange) && !matches!(zones, Zones::Z8x8) {
            return Err(ConfigError::LongRange);
        }
        if settings.results.peaks == 0 || settings.results.peaks > 4 {
            return Err(ConfigError::Peaks);
        }
        if zones.result_zones() as u32 * settings.results.bytes() as u32 + 33 > 8192 {
            return Err(ConfigError::ResultSize);
        }
        Ok(Self(settings))
    }

    /// The checked settings.
    #[must_use]
    pub const fn settings(&self) -> &Settings {
        &self.0
    }

    /// The description for a host, also as a constant: for the range gate of its bins, say.
    #[must_use]
    pub const fn info(&self) -> SensorInfo {
        let settings = self.settings();
        SensorInfo {
            pixels: self.pixels(),
            bin_width: Some(settings.preset.bin_width(settings.zones)),
            bins: settings.preset.bins(settings.zones),
            offset: OFFSET_MM,
            gives_histograms: true,
            laser_millihertz: self.laser_millihertz(),
            dead_time: 0,
            most_dither: 0,
        }
    }

    /// One more than the last pixel of a zone or a reference.
    const fn pixels(&self) -> u16 {
        let first = self.0.first_pixel.raw();
        let zones = first.saturating_add(self.0.zones.number());
        match self.0.reference {
            Some(reference) if reference.raw() >= zones => {
                reference.raw().saturating_add(REFERENCES)
            }
            _ => zones,
        }
    }

    /// Laser pulses that a frame of histograms has integrated: those of its time slot.
    pub(super) const fn pulses(&self) -> u32 {
        self.0.kilo_iterations as u32 * 1024 / self.0.zones.frames() as u32
    }

    /// Laser pulses that are counted in a thousand seconds, on average, rounded down.
    const fn laser_millihertz(&self) -> u64 {
        let pulses = self.pulses() as u64 * self.0.zones.frames() as u64;
        match (pulses * 1_000_000).checked_div(self.0.period_ms as u64) {
            Some(rate) => rate,
            None => 0,
        }
    }
}
