//! From the counts of the TDC7200 to picoseconds, in integers.
//!
//! With `calCount = (CALIBRATION2 - CALIBRATION1) / (periods - 1)` and
//! `normLSB = Tclk / calCount` the data sheet (SNAS647D, sections 8.4.2.1.1 and
//! 8.4.2.2.1) has
//!
//! ```text
//! mode 1   TOFn = TIMEn · normLSB
//! mode 2   TOFn = (TIME1 - TIME(n+1)) · normLSB + CLOCK_COUNTn · Tclk
//! ```
//!
//! Here each is one fraction, rounded once: the result is the formula's value
//! to the nearest picosecond, half a picosecond up. An error of the reference clock is an error of
//! all times.
//!
//! The data sheet's example of mode 1:
//!
//! ```
//! use dtof_sensors::tdc7200::{Calibration, CalibrationPeriods};
//!
//! let calibration = Calibration::new(8_000, CalibrationPeriods::Ten, 2110, 21121).unwrap();
//! assert_eq!(calibration.mode_1(4175), 247_061); // 247.061 ns
//! ```

/// Clock periods of the second calibration: CONFIG2 field
/// `CALIBRATION2_PERIODS`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CalibrationPeriods {
    /// 2 clock periods.
    Two,
    /// 10 clock periods, as after reset.
    #[default]
    Ten,
    /// 20 clock periods.
    Twenty,
    /// 40 clock periods.
    Forty,
}

impl CalibrationPeriods {
    /// Their number.
    #[must_use]
    pub const fn periods(self) -> u8 {
        match self {
            Self::Two => 2,
            Self::Ten => 10,
            Self::Twenty => 20,
            Self::Forty => 40,
        }
    }

    /// The field of CONFIG2.
    pub(super) const fn bits(self) -> u8 {
        match self {
            Self::Two => 0b00,
            Self::Ten => 0b01,
            Self::Twenty => 0b10,
            Self::Forty => 0b11,
        }
    }
}

/// The time of a count, from one measurement's own calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Calibration {
    clock_khz: i64,
    /// Clock periods between the two calibrations.
    periods: i64,
    /// Counts in them.
    counts: i64,
}

impl Calibration {
    const PS_PER_MS: i64 = 1_000_000_000;
    /// A time past the last bin of any width, so that it is counted as rejected.
    const NEVER: i64 = i64::MAX;

    /// From CALIBRATION1 and CALIBRATION2 and the reference clock in kHz, or
    /// `None` unless CALIBRATION2 is greater, both fit 23 bits and the clock is within 1 to 16 MHz.
    #[must_use]
    #[allow(clippy::cast_lossless, reason = "`From` is not const")]
    pub const fn new(
        clock_khz: u16,
        periods: CalibrationPeriods,
        calibration1: u32,
        calibration2: u32,
    ) -> Option<Self> {
        let clock_fits = 1_000 <= clock_khz && clock_khz <= 16_000;
        if !clock_fits || calibration1 >= calibration2 || calibration2 >= 1 << 23 {
            return None;
        }
        Some(Self {
            clock_khz: clock_khz as i64,
            periods: (periods.periods() - 1) as i64,
            counts: (calibration2 - calibration1) as i64,
        })
    }

    /// Measurement mode 1: from START to the stop of `TIMEn`. The upper nine bits
    /// of `time` are ignored.
    #[must_use]
    pub const fn mode_1(&self, time: u32) -> i64 {
        self.time(time as i64 & 0x7f_ffff, 0)
    }

    /// Measurement mode 2: from START to the stop of TIME(n+1) and
    /// `CLOCK_COUNTn`. Negative only if the registers contradict each other. The
    /// upper nine bits of the times and the upper 16 of the clock count, which
    /// the data sheet leaves unused, are ignored.
    #[must_use]
    pub const fn mode_2(&self, time1: u32, time_next: u32, clock_count: u32) -> i64 {
        let counts = (time1 as i64 & 0x7f_ffff) - (time_next as i64 & 0x7f_ffff);
        self.time(counts, clock_count as i64 & 0xffff)
    }

    /// `counts` of the ring oscillator and `clocks` of the reference clock.
    const fn time(&self, counts: i64, clocks: i64) -> i64 {
        // Whole picoseconds of the clock first, so that all fits 63 bits:
        // 23 + 6 + 30 for the counts, 14 + 23 for what the clock leaves.
        let clock_ps = clocks * Self::PS_PER_MS;
        let denominator = self.clock_khz * self.counts;
        // `/` could panic. Neither divisor is 0.
        let Some(whole) = clock_ps.checked_div(self.clock_khz) else {
            return Self::NEVER;
        };
        let rest = clock_ps - whole * self.clock_khz;
        let numerator = counts * self.periods * Self::PS_PER_MS + rest * self.counts;
        match (numerator + denominator / 2).checked_div_euclid(denominator) {
            Some(rounded) => whole + rounded,
            None => Self::NEVER,
        }
    }
}
