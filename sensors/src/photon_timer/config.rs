//! The laser's rate and the length of its pulse, in clocks of the hardware.

use core::error::Error;
use core::fmt;

use crate::dither::Dither;

/// Bins of a laser cycle.
pub const BINS: u32 = 128;

/// The clock of the hardware: a sample, and so a bin, is one of 8 ns.
pub const CLOCK_HZ: u32 = 125_000_000;

/// Clocks of a laser cycle in addition to those of its bins: each shift register samples the
/// level before, passes it on, takes what its dither adds, and starts again.
const BESIDE: u32 = 8;

/// The shortest pulse of the laser: an instruction each to load a counter and to count.
const SHORTEST: u32 = 2;

/// The shortest pause of the laser: it also takes what the dither adds, and counts it.
const SHORTEST_PAUSE: u32 = 5;

/// Clocks of the longest pulse within limits: 1 µs.
const MOST_PULSE: u32 = 125;

/// A pulse within limits takes at most one clock in this many: 2 % of the time.
const LEAST_CLOCKS_A_CLOCK: u32 = 50;

/// Settings of the laser.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Settings {
    /// Laser cycles a second.
    pub laser_hz: u32,
    /// How long the pin of the laser is high, in nanoseconds.
    pub pulse_ns: u32,
}

/// Checked [`Settings`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Config {
    /// The mean.
    period: u32,
    pulse: u32,
    /// Clocks of the shortest laser cycle that keeps the limit of the duty; 0 without the limit.
    least_period: u32,
}

/// Settings that cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ConfigError {
    /// A laser cycle would be shorter than the bins, and 8 clocks. 919,117 a second are the most; up to 922,509
    /// are rounded to them.
    TooFast,
    /// Fewer than 1 a second.
    TooSlow,
    /// The laser's pulse is 0.
    NoPulse,
    /// The laser's pulse takes the whole laser cycle, less 5 clocks.
    LongPulse,
    /// The laser's pulse is longer than 1 µs, which only [`Config::beyond_limits`] takes.
    PulseBeyondLimit,
    /// The laser is on for more than 2 % of the time, which only [`Config::beyond_limits`] takes.
    DutyBeyondLimit,
}

impl ConfigError {
    /// The reason, in one line.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::TooFast => "a laser cycle is shorter than its bins: at most 919117 a second",
            Self::TooSlow => "there is to be a laser cycle a second or more",
            Self::NoPulse => "the laser's pulse is 0 ns",
            Self::LongPulse => "the laser's pulse leaves no pause in its laser cycle",
            Self::PulseBeyondLimit => {
                "the laser's pulse is longer than 1000 ns: only an image with laser-beyond-limits may do that"
            }
            Self::DutyBeyondLimit => {
                "the laser is on for more than 2 % of the time: only an image with laser-beyond-limits may do that"
            }
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
    /// Rounds the laser cycle to the nearest clock and its pulse up, to at least 2 clocks. The
    /// rounded values must be within limits: a pulse of at most 1 µs, and at most 2 % of the time.
    /// The limits bound the harm to an eye from a laser that is wired wrongly or too strong.
    ///
    /// # Errors
    /// Returns a [`ConfigError`] if the settings cannot be used.
    pub const fn new(settings: Settings) -> Result<Self, ConfigError> {
        let mut config = match Self::beyond_limits(settings) {
            Ok(config) => config,
            Err(error) => return Err(error),
        };
        if config.pulse > MOST_PULSE {
            return Err(ConfigError::PulseBeyondLimit);
        }
        config.least_period = config.pulse * LEAST_CLOCKS_A_CLOCK;
        if config.least_period > config.period {
            return Err(ConfigError::DutyBeyondLimit);
        }
        Ok(config)
    }

    /// The same without the limits, for a laser that is safe all the same: all that the hardware can do.
    ///
    /// # Errors
    /// Returns a [`ConfigError`] if the hardware cannot do it.
    pub const fn beyond_limits(settings: Settings) -> Result<Self, ConfigError> {
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
        if pulse > period - SHORTEST_PAUSE {
            return Err(ConfigError::LongPulse);
        }
        Ok(Self {
            period,
            pulse,
            least_period: 0,
        })
    }

    /// Clocks from one laser pulse to the next in the mean; without dither always.
    #[must_use]
    pub const fn period(&self) -> u32 {
        self.period
    }

    /// The largest range of a dither: the shortest laser cycle has room for the bins, and keeps the limits
    /// of the laser.
    #[must_use]
    pub const fn most_dither(&self) -> u8 {
        let bins = BINS + BESIDE;
        let pulse = self.pulse + SHORTEST_PAUSE;
        let mut least = if bins > pulse { bins } else { pulse };
        if self.least_period > least {
            least = self.least_period;
        }
        // Both halves of the range.
        let range = 2 * self.period.saturating_sub(least);
        if range > Dither::MOST as u32 {
            return Dither::MOST;
        }
        #[allow(clippy::cast_possible_truncation, reason = "at most 254")]
        let range = range as u8;
        range
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

    /// The clock in Hz, and the clocks of a laser cycle and of the laser's pulse.
    /// `cargo xtask image` reads them from the image and prints them.
    #[must_use]
    pub const fn laser_clocks(&self) -> [u32; 3] {
        [CLOCK_HZ, self.period, self.pulse]
    }

    /// Laser cycles in a thousand seconds, rounded down.
    #[must_use]
    pub const fn laser_millihertz(&self) -> u64 {
        // `/` could panic. No period is 0.
        match (CLOCK_HZ as u64 * 1000).checked_div(self.period as u64) {
            Some(millihertz) => millihertz,
            None => 0,
        }
    }

    /// The start values of the two counters of the laser's pulse, pulse and pause, for a dither of this
    /// range. The dither adds to the pause.
    #[must_use]
    pub const fn laser_counters(&self, range: u16) -> [u32; 2] {
        let shortest = self.shortest(range);
        [
            self.pulse - SHORTEST,
            shortest.saturating_sub(self.pulse + SHORTEST_PAUSE),
        ]
    }

    /// The start value of the counter of a shift register's pause, likewise.
    #[must_use]
    pub const fn sampler_counter(&self, range: u16) -> u32 {
        self.shortest(range).saturating_sub(BINS + BESIDE)
    }

    /// Clocks of the shortest laser cycle. That of a range above [`Self::most_dither`] is as long as with it, so
    /// that no two pulses come too soon after each other.
    const fn shortest(&self, range: u16) -> u32 {
        let most = self.most_dither() as u16;
        let range = if range < most { range } else { most };
        self.period.saturating_sub(range as u32 / 2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Within the limits or not.
    fn config(laser_hz: u32, pulse_ns: u32) -> Result<Config, ConfigError> {
        Config::beyond_limits(Settings { laser_hz, pulse_ns })
    }

    fn limited(laser_hz: u32, pulse_ns: u32) -> Result<Config, ConfigError> {
        Config::new(Settings { laser_hz, pulse_ns })
    }

    /// The clocks of a laser cycle to which the dither adds so many: of the laser and of a shift register.
    fn clocks(config: &Config, range: u16, added: u32) -> [u32; 2] {
        // A counter from n takes n + 1 clocks, and 1 to load. What the dither adds takes 2 to load.
        let [pulse, pause] = config.laser_counters(range);
        let laser = (1 + pulse + 1) + (1 + pause + 1) + (2 + added + 1);
        assert_eq!(1 + pulse + 1, config.pulse());
        // To load, the level before, to hand over; 2 a bin of its own.
        let rest = config.sampler_counter(range);
        let sampler = 3 + 2 * 64 + (1 + rest + 1) + (2 + added + 1);
        [laser, sampler]
    }

    #[test]
    fn counters_make_the_clocks_that_are_asked_for() {
        for laser_hz in [1, 1000, 99_999, 100_000, 250_000, 922_509] {
            for pulse_ns in [1, 8, 9, 16, 17, 100, 1000] {
                let config = config(laser_hz, pulse_ns).unwrap();
                let off = i64::from(config.period()) * i64::from(laser_hz) - 125_000_000;
                assert!(2 * off.abs() <= i64::from(laser_hz), "{laser_hz}");
                assert_eq!(config.pulse(), pulse_ns.div_ceil(8).max(2));
                assert_eq!(clocks(&config, 0, 0), [config.period(); 2]);
            }
        }
    }

    #[test]
    fn the_longest_and_the_shortest_laser_cycle_lie_as_far_from_the_mean() {
        for laser_hz in [1, 99_999, 100_000, 192_307, 800_000, 922_509] {
            let Ok(config) = limited(laser_hz, 16) else {
                panic!()
            };
            let most = config.most_dither();
            let most = u16::from(most);
            assert!(most <= 254 && most % 2 == 0);
            for range in [0, 2, 64, 128, 254] {
                if range <= most {
                    let half = u32::from(range) / 2;
                    assert_eq!(clocks(&config, range, 0), [config.period() - half; 2]);
                    assert_eq!(
                        clocks(&config, range, 2 * half),
                        [config.period() + half; 2]
                    );
                }
            }
        }
    }

    #[test]
    fn no_range_makes_a_laser_cycle_shorter_than_the_laser_may_have() {
        for (laser_hz, pulse_ns, least) in [(800_000, 16, 136), (189_394, 104, 650)] {
            let config = limited(laser_hz, pulse_ns).unwrap();
            assert!(config.most_dither() < 254);
            for range in [u16::from(config.most_dither()), 254, u16::MAX] {
                assert_eq!(clocks(&config, range, 0), [least; 2], "{laser_hz}");
            }
        }
    }

    #[test]
    fn a_dither_leaves_room_for_the_bins_and_the_limits_of_the_laser() {
        let most = |laser_hz, pulse_ns| limited(laser_hz, pulse_ns).unwrap().most_dither();
        assert_eq!(most(100_000, 100), 254);
        // 156 clocks, of which 136 are taken.
        assert_eq!(most(800_000, 16), 40);
        assert_eq!(most(922_509, 16), 0);
        // 650 clocks are 50 pulses of 13; 660 leave ten.
        assert_eq!(most(192_308, 104), 0);
        assert_eq!(most(189_394, 104), 20);
        // Beyond the limits the bins alone count, or the pulse and the shortest pause: 10 µs less 1,200 clocks.
        let beyond = |laser_hz, pulse_ns| config(laser_hz, pulse_ns).unwrap().most_dither();
        assert_eq!(beyond(192_308, 104), 254);
        assert_eq!(beyond(100_000, 1200 * 8), 90);
    }

    #[test]
    fn what_cannot_be_is_refused() {
        assert_eq!(config(0, 100), Err(ConfigError::TooSlow));
        assert_eq!(config(922_510, 100), Err(ConfigError::TooFast));
        assert_eq!(config(u32::MAX, 100), Err(ConfigError::TooFast));
        assert_eq!(config(100_000, 0), Err(ConfigError::NoPulse));
        // 10 µs are 1250 clocks.
        assert!(config(100_000, 1245 * 8).is_ok());
        assert_eq!(config(100_000, 1245 * 8 + 1), Err(ConfigError::LongPulse));
        assert_eq!(config(100_000, u32::MAX), Err(ConfigError::LongPulse));
    }

    #[test]
    fn a_pulse_of_a_microsecond_passes_and_a_longer_one_is_beyond_the_limits() {
        // Of 10,000 Hz: 2 % are 2 µs.
        assert_eq!(limited(10_000, 1000).unwrap().pulse(), 125);
        let beyond = Err(ConfigError::PulseBeyondLimit);
        for pulse_ns in [1001, 1008, 2000, 99_000] {
            assert_eq!(limited(10_000, pulse_ns), beyond, "{pulse_ns}");
        }
        // 99 % of the time, and half of it.
        assert_eq!(limited(100_000, 9_900), beyond);
        assert_eq!(limited(100, 5_000_000), beyond);
    }

    #[test]
    fn two_percent_of_the_time_pass_and_more_is_beyond_the_limits() {
        let beyond = Err(ConfigError::DutyBeyondLimit);
        // 13 clocks of 650: 125 MHz / 650 = 192,307.7 Hz. Up to 192,455 Hz round to as many clocks.
        for laser_hz in [192_307, 192_308, 192_455] {
            let config = limited(laser_hz, 104).unwrap();
            assert_eq!([config.pulse(), config.period()], [13, 650]);
        }
        assert_eq!(config(192_456, 104).unwrap().period(), 649);
        assert_eq!(limited(192_456, 104), beyond);
        // A pulse of 97 ns takes 13 clocks as well, one of 96 ns 12.
        assert_eq!(limited(192_456, 97), beyond);
        assert!(limited(192_456, 96).is_ok());
        // 1 µs of 50 µs.
        assert!(limited(20_000, 1000).is_ok());
        assert_eq!(config(20_002, 1000).unwrap().period(), 6249);
        assert_eq!(limited(20_002, 1000), beyond);
        // The shortest pulse at any rate.
        assert!(limited(800_000, 16).is_ok());
        assert!(limited(922_509, 1).is_ok());
        assert_eq!(limited(800_000, 100), beyond);
    }

    #[test]
    fn clocks_are_those_of_the_laser_and_the_rest_is_not_sampled() {
        let config = config(100_000, 100).unwrap();
        assert_eq!(config.laser_clocks(), [125_000_000, 1250, 13]);
        assert_eq!(config.unsampled_clocks(), 1250 - 128);
    }

    #[test]
    fn the_rate_is_that_of_whole_clocks() {
        let millihertz = |hz| config(hz, 100).unwrap().laser_millihertz();
        assert_eq!(millihertz(100_000), 100_000_000);
        // 417 clocks.
        assert_eq!(millihertz(300_000), 299_760_191);
    }
}
