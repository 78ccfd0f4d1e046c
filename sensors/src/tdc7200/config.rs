//! How a TDC7200 measures.

use core::fmt;
use core::ops::RangeInclusive;

use dtof_core::PixelAddress;
use dtof_core::fixed::types::{I24F8, U16F16};

use super::registers::{FORCE_CAL, MEAS_MODE_2, PARITY_EN, START_EDGE, STOP_EDGE};
use super::time::CalibrationPeriods;

/// CONFIG1 field `MEAS_MODE`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Mode {
    /// The ring oscillator alone, for 12 to 500 ns.
    #[default]
    One,
    /// Ring oscillator and reference clock, for 250 ns to 8 ms.
    Two,
}

/// The range of mode 1 in picoseconds (section 6.6 of the data sheet).
const MODE_1_PS: RangeInclusive<i64> = 12_000..=500_000;

/// CONFIG2 field `NUM_STOP`: after how many stops a measurement is complete.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
#[allow(missing_docs, reason = "the names say it")]
pub enum Stops {
    #[default]
    One = 1,
    Two = 2,
    Three = 3,
    Four = 4,
    Five = 5,
}

/// The edge of START or STOP that counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[allow(missing_docs, reason = "the names say it")]
pub enum Edge {
    #[default]
    Rising,
    Falling,
}

/// The settings. [`Config::new`] checks them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Settings {
    /// The pixel of the photons.
    pub pixel: PixelAddress,
    /// The reference clock at the pin CLOCK in kHz, 1,000 to 16,000. A clock
    /// that is not a whole number of kHz is not supported.
    pub clock_khz: u16,
    /// Picoseconds a bin, until [`Sensor::start`](crate::Sensor::start)
    /// changes it.
    pub bin_width: U16F16,
    /// Where bin 0 starts, in picoseconds after START.
    pub first_bin_ps: u32,
    /// Measurements in a thousand seconds, for converting laser cycles to time; 0 if unknown. This
    /// is the rate of START if the driver arms in time for each. No register depends on it.
    pub laser_millihertz: u64,
    /// The measurement mode.
    pub mode: Mode,
    /// Stops a measurement.
    pub stops: Stops,
    /// The length of the second calibration.
    pub calibration: CalibrationPeriods,
    /// The edge of START that counts.
    pub start_edge: Edge,
    /// The edge of STOP that counts.
    pub stop_edge: Edge,
    /// Where a measurement without enough stops ends: clock periods
    /// (`CLOCK_CNTR_OVF`) in mode 2, turns of the ring oscillator
    /// (`COARSE_CNTR_OVF`) in mode 1. The data sheet does not say how long a turn
    /// takes; TI's support has stated 63 and 126 counts, 3.5 and 7 ns.
    pub overflow: u16,
    /// Clock periods after START in which STOP is ignored
    /// (`CLOCK_CNTR_STOP_MASK`).
    pub stop_mask: u16,
    /// Whether the result registers carry an even parity bit, and it is checked
    /// (CONFIG1 bit `PARITY_EN`).
    pub parity: bool,
    /// Milliseconds without an interrupt after which the driver abandons the measurement: the
    /// laser, and START with it, is missing.
    pub timeout_ms: u32,
    /// Polls in a row that may find INTB low and `INT_STATUS` without a reason.
    pub stuck_limit: u8,
}

impl Settings {
    /// Mode 1, one stop, rising edges, as much time as the counters hold.
    #[must_use]
    pub const fn new(pixel: PixelAddress, clock_khz: u16, bin_width: U16F16) -> Self {
        Self {
            pixel,
            clock_khz,
            bin_width,
            first_bin_ps: 0,
            laser_millihertz: 0,
            mode: Mode::One,
            stops: Stops::One,
            calibration: CalibrationPeriods::Ten,
            start_edge: Edge::Rising,
            stop_edge: Edge::Rising,
            overflow: u16::MAX,
            stop_mask: 0,
            parity: false,
            timeout_ms: 100,
            stuck_limit: 3,
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
#[non_exhaustive]
pub enum ConfigError {
    /// The clock is outside 1 to 16 MHz.
    Clock,
    /// The bin width is zero.
    ZeroBinWidth,
    /// The counter overflows at once, or before the stop mask ends.
    Overflow,
}

impl ConfigError {
    /// The reason, in one line.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Clock => "the reference clock must be within 1 and 16 MHz",
            Self::ZeroBinWidth => "the bin width is zero",
            Self::Overflow => "the counter overflows before a stop can count",
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
    /// Returns a [`ConfigError`] if the settings cannot be used.
    pub const fn new(settings: Settings) -> Result<Self, ConfigError> {
        if settings.clock_khz < 1_000 || settings.clock_khz > 16_000 {
            return Err(ConfigError::Clock);
        }
        if settings.bin_width.to_bits() == 0 {
            return Err(ConfigError::ZeroBinWidth);
        }
        // The mask counts clock periods, which only mode 2's overflow does too.
        let masked = matches!(settings.mode, Mode::Two) && settings.overflow <= settings.stop_mask;
        if settings.overflow == 0 || masked {
            return Err(ConfigError::Overflow);
        }
        Ok(Self(settings))
    }

    /// The checked settings.
    #[must_use]
    pub const fn settings(&self) -> &Settings {
        &self.0
    }

    /// Bins of another width from now on, which is above zero.
    pub(super) fn set_bin_width(&mut self, bin_width: U16F16) {
        self.0.bin_width = bin_width.max(U16F16::DELTA);
    }

    /// The range of the start of bin 0, rounded to the nearest 1/256 mm.
    pub(super) fn offset(&self) -> I24F8 {
        /// Half the speed of light in m/s, so in millimetres per 10⁹ ps.
        const HALF_C: u64 = 149_896_229;
        // 32 + 28 + 8 bits would be too many; no laser pulse is 4 ms old.
        let range = u128::from(self.0.first_bin_ps) * u128::from(HALF_C) * 256;
        let rounded = (range + 500_000_000) / 1_000_000_000;
        I24F8::from_bits(i32::try_from(rounded).unwrap_or(i32::MAX))
    }

    /// CONFIG1 without `START_MEAS`. The calibration is always forced, so that
    /// the stops before an overflow have one.
    pub(super) fn config1(&self) -> u8 {
        let settings = &self.0;
        let bit = |condition: bool, bit: u8| if condition { bit } else { 0 };
        FORCE_CAL
            | bit(settings.parity, PARITY_EN)
            | bit(settings.stop_edge == Edge::Falling, STOP_EDGE)
            | bit(settings.start_edge == Edge::Falling, START_EDGE)
            | bit(settings.mode == Mode::Two, MEAS_MODE_2)
    }

    /// CONFIG2, without averaging: a photon's time is its own.
    pub(super) const fn config2(&self) -> u8 {
        self.0.calibration.bits() << 6 | (self.0.stops as u8 - 1)
    }

    /// `COARSE_CNTR_OVF` and `CLOCK_CNTR_OVF`.
    pub(super) const fn overflows(&self) -> [u16; 2] {
        match self.0.mode {
            Mode::One => [self.0.overflow, u16::MAX],
            Mode::Two => [u16::MAX, self.0.overflow],
        }
    }

    /// The bin of a time in picoseconds after START, rounded down. A time
    /// before bin 0 gives `u16::MAX`, as does one past the last or one that mode 1
    /// does not measure (12 to 500 ns), so that each is counted as rejected.
    #[must_use]
    pub fn code(&self, time_ps: i64) -> u16 {
        if self.0.mode == Mode::One && !MODE_1_PS.contains(&time_ps) {
            return u16::MAX;
        }
        let Ok(since) = u64::try_from(time_ps - i64::from(self.0.first_bin_ps)) else {
            return u16::MAX;
        };
        // 40 bits, 1.1 s, are past the last bin of any width.
        let since = since.min(1 << 40) << 16;
        let code = since.checked_div(self.0.bin_width.to_bits().into());
        code.and_then(|code| u16::try_from(code).ok())
            .unwrap_or(u16::MAX)
    }
}
