//! The laser's rate and the length of its pulse, in clocks of the hardware.

use core::error::Error;
use core::fmt;

/// Bins of a laser cycle.
pub const BINS: u32 = 128;

/// The clock of the hardware: a sample, and so a bin, is one of 8 ns.
pub const CLOCK_HZ: u32 = 125_000_000;

/// Clocks of a laser cycle beside those of its bins: each shift register takes the level
/// before, hands it over, and begins anew.
const BESIDE: u32 = 5;

/// The shortest pulse and the shortest pause of the laser: an instruction each to load a
/// counter and to count.
const SHORTEST: u32 = 2;

/// Of the laser.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Laser cycles a second.
    pub laser_hz: u32,
    /// How long the pin of the laser is high, in nanoseconds.
    pub pulse_ns: u32,
}

/// Checked [`Settings`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    period: u32,
    pulse: u32,
}

/// Why settings cannot be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConfigError {
    /// A laser cycle would be shorter than the bins, and 5 clocks: above 943,396 a second.
    TooFast,
    /// Fewer than 1 a second.
    TooSlow,
    /// The laser's pulse is 0.
    NoPulse,
    /// The laser's pulse takes the whole laser cycle, less 2 clocks.
    LongPulse,
}

impl ConfigError {
    /// What is wrong, in words.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::TooFast => "a laser cycle is shorter than its bins: at most 943396 a second",
            Self::TooSlow => "there is to be a laser cycle a second or more",
            Self::NoPulse => "the laser's pulse is 0 ns",
            Self::LongPulse => "the laser's pulse leaves no pause in its laser cycle",
        }
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}

impl Error for ConfigError {}

impl Config {
    /// The laser cycle is rounded to the nearest clock, its pulse up, to 2 clocks at least.
    ///
    /// # Errors
    /// [`ConfigError`] says what cannot be.
    pub const fn new(settings: Settings) -> Result<Self, ConfigError> {
        let Settings { laser_hz, pulse_ns } = settings;
        if laser_hz == 0 {
            return Err(ConfigError::TooSlow);
        }
        let period = (CLOCK_HZ + laser_hz / 2) / laser_hz;
        if period < BINS + BESIDE {
            return Err(ConfigError::TooFast);
        }
        if pulse_ns == 0 {
            return Err(ConfigError::NoPulse);
        }
        let clocks = pulse_ns.div_ceil(1_000_000_000 / CLOCK_HZ);
        let pulse = if clocks < SHORTEST { SHORTEST } else { clocks };
        if pulse > period - SHORTEST {
            return Err(ConfigError::LongPulse);
        }
        Ok(Self { period, pulse })
    }

    /// Clocks from one laser pulse to the next.
    #[must_use]
    pub const fn period(&self) -> u32 {
        self.period
    }

    /// Clocks that the laser's pin is high.
    #[must_use]
    pub const fn pulse(&self) -> u32 {
        self.pulse
    }

    /// Clocks of a laser cycle in which a photon is not seen.
    #[must_use]
    pub const fn unsampled_clocks(&self) -> u32 {
        self.period - BINS
    }

    /// Laser cycles in a thousand seconds, rounded down.
    #[must_use]
    pub const fn laser_millihertz(&self) -> u64 {
        CLOCK_HZ as u64 * 1000 / self.period as u64
    }

    /// What the two counters of the laser's pulse begin with: of the pulse, of the pause.
    #[must_use]
    pub const fn laser_counters(&self) -> [u32; 2] {
        [self.pulse - SHORTEST, self.period - self.pulse - SHORTEST]
    }

    /// What the two counters of a shift register begin with: of its bins, of the rest.
    #[must_use]
    pub const fn sampler_counters(&self) -> [u32; 2] {
        [BINS / 2 - 1, self.period - BINS - BESIDE]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config(laser_hz: u32, pulse_ns: u32) -> Result<Config, ConfigError> {
        Config::new(Settings { laser_hz, pulse_ns })
    }

    #[test]
    fn counters_make_the_clocks_that_are_asked_for() {
        for laser_hz in [1, 1000, 99_999, 100_000, 250_000, 943_396] {
            for pulse_ns in [1, 8, 9, 16, 17, 100, 1000] {
                let config = config(laser_hz, pulse_ns).unwrap();
                let off = i64::from(config.period()) * i64::from(laser_hz) - 125_000_000;
                assert!(2 * off.abs() <= i64::from(laser_hz), "{laser_hz}");
                assert_eq!(config.pulse(), pulse_ns.div_ceil(8).max(2));
                // A counter from n takes n + 1 clocks, and 1 to load.
                let [pulse, pause] = config.laser_counters();
                assert_eq!((1 + pulse + 1) + (1 + pause + 1), config.period());
                assert_eq!(1 + pulse + 1, config.pulse());
                // To load, the level before, to hand over; 2 a bin of its own; to load, rest.
                let [bins, rest] = config.sampler_counters();
                assert_eq!(3 + 2 * (bins + 1) + 1 + rest + 1, config.period());
            }
        }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        assert_eq!(config(0, 100), Err(ConfigError::TooSlow));
        assert_eq!(config(943_397, 100), Err(ConfigError::TooFast));
        assert_eq!(config(u32::MAX, 100), Err(ConfigError::TooFast));
        assert_eq!(config(100_000, 0), Err(ConfigError::NoPulse));
        // 10 µs are 1250 clocks.
        assert!(config(100_000, 1248 * 8).is_ok());
        assert_eq!(config(100_000, 1248 * 8 + 1), Err(ConfigError::LongPulse));
        assert_eq!(config(100_000, u32::MAX), Err(ConfigError::LongPulse));
    }

    #[test]
    fn the_rate_is_that_of_whole_clocks() {
        let millihertz = |hz| config(hz, 100).unwrap().laser_millihertz();
        assert_eq!(millihertz(100_000), 100_000_000);
        // 417 clocks.
        assert_eq!(millihertz(300_000), 299_760_191);
    }
}
