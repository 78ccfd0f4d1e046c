//! The times of the TDC7200: the data sheet's example to the picosecond, and
//! the exact formula in wide integers for everything else.

use dtof_sensors::tdc7200::{Calibration, CalibrationPeriods};
use proptest::prelude::*;

/// Data sheet SNAS647C, section 8.4.2.1.1 "Calculating Time-of-Flight
/// (Measurement Mode 1)": CALIBRATION2 = 21121, CALIBRATION1 = 2110,
/// `CALIBRATION2_PERIODS` = 10, CLOCK = 8 MHz, TIME1 = 4175 give 247.061 ns.
#[test]
fn the_data_sheets_example_in_picoseconds() {
    let calibration = Calibration::new(8_000, CalibrationPeriods::Ten, 2110, 21121).unwrap();
    assert_eq!(calibration.mode_1(4175), 247_061);
    // Mode 2 takes the same counts and adds whole periods of the reference clock.
    assert_eq!(calibration.mode_2(4175, 0, 0), 247_061);
    assert_eq!(calibration.mode_2(0, 0, 1), 125_000);
    assert_eq!(calibration.mode_2(0, 4175, 4), 500_000 - 247_061);
}

#[test]
fn what_cannot_be_a_calibration_is_none() {
    let new = |khz, first, second| Calibration::new(khz, CalibrationPeriods::Two, first, second);
    assert!(new(8_000, 2110, 2110).is_none());
    assert!(new(8_000, 2111, 2110).is_none());
    assert!(new(8_000, 0, 1 << 23).is_none());
    assert!(new(999, 2110, 4220).is_none());
    assert!(new(16_001, 2110, 4220).is_none());
    assert!(new(16_000, 0, (1 << 23) - 1).is_some());
}

/// The clock is all there is to measure with: nothing else knows that it is off, and all ranges are
/// off by as much.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts of the chip"
)]
#[test]
fn a_clock_2_percent_off_shows_as_ranges_2_percent_off() {
    const LSB_PS: f64 = 55.0;
    for (actual_khz, factor) in [(8_000.0, 1.0), (8_160.0, 1.02), (7_840.0, 0.98)] {
        let clock_ps = 1e9 / actual_khz;
        // What the chip counts in so many picoseconds.
        let counts = |ps: f64| (ps / LSB_PS).round() as u32;
        let [first, second] = [1.0, 10.0].map(|periods| counts(periods * clock_ps));
        let calibration = Calibration::new(8_000, CalibrationPeriods::Ten, first, second).unwrap();
        for stop_ps in [20_000.0, 100_000.0, 450_000.0] {
            // Two counts of one part in twenty thousand, and one of the time.
            let exact = stop_ps * factor;
            let bound = LSB_PS + exact / f64::from(second - first);
            let mode_1 = calibration.mode_1(counts(stop_ps)) as f64;
            assert!((mode_1 - exact).abs() <= bound, "{mode_1} for {exact} ps");

            // Mode 2: from START and from the stop to the next edge of the clock.
            let (start, stop) = (0.3 * clock_ps, (0.3 * clock_ps + stop_ps) / clock_ps);
            let (time1, next) = (clock_ps - start, (stop.ceil() - stop) * clock_ps);
            let clocks = stop.ceil() as u32 - 1;
            let mode_2 = calibration.mode_2(counts(time1), counts(next), clocks) as f64;
            assert!(
                (mode_2 - exact).abs() <= 2.0 * bound,
                "{mode_2} for {exact} ps"
            );
        }
    }
}

proptest! {
    /// Rounded to the nearest, half up: with the formula as the fraction `n / d`,
    /// the time `t` has `-d < 2·(d·t - n) <= d`.
    #[test]
    fn every_time_is_the_formula_rounded_once(
        khz in 1_000u16..=16_000,
        periods in prop_oneof![
            Just(CalibrationPeriods::Two), Just(CalibrationPeriods::Ten),
            Just(CalibrationPeriods::Twenty), Just(CalibrationPeriods::Forty),
        ],
        first in 0u32..0x7f_ffff,
        more in 1u32..0x7f_ffff,
        time1 in 0u32..=0x7f_ffff,
        next in 0u32..=0x7f_ffff,
        clocks in 0u32..=0xffff,
    ) {
        let second = (first + more).min(0x7f_ffff);
        let calibration = Calibration::new(khz, periods, first, second).unwrap();
        let counts = i128::from(second - first);
        let cycles = i128::from(periods.periods() - 1);
        let denominator = i128::from(khz) * counts;
        let rounded = |time: i64, numerator: i128| {
            let error = 2 * (i128::from(time) * denominator - numerator);
            -denominator < error && error <= denominator
        };

        let mode_1 = i128::from(time1) * cycles * 1_000_000_000;
        prop_assert!(rounded(calibration.mode_1(time1), mode_1));

        let mode_2 = ((i128::from(time1) - i128::from(next)) * cycles
            + i128::from(clocks) * counts) * 1_000_000_000;
        prop_assert!(rounded(calibration.mode_2(time1, next, clocks), mode_2));
    }
}
