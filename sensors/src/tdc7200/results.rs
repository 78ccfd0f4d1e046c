//! The result registers, and the times in them.

use super::config::{Mode, Settings};
use super::registers::{CALIBRATION1, CALIBRATION2, CLOCK_COUNT1, RESULTS, TIME1, VALUE};
use super::time::Calibration;

/// TIME1 to CALIBRATION2 as read, most significant byte first. A register that was
/// not read is 0.
#[derive(Default)]
pub(super) struct Results([[u8; 3]; RESULTS]);

/// The register of the last stop's time. Clock counts stand between the times.
pub(super) const fn last(settings: &Settings) -> u8 {
    match settings.mode {
        Mode::One => TIME1 + 2 * (settings.stops as u8 - 1),
        Mode::Two => TIME1 + 2 * settings.stops as u8,
    }
}

impl Results {
    pub(super) fn range(&mut self, first: u8, last: u8) -> &mut [[u8; 3]] {
        let range = usize::from(first - TIME1)..=usize::from(last - TIME1);
        self.0.get_mut(range).unwrap_or_default()
    }

    /// CALIBRATION1 and CALIBRATION2.
    pub(super) fn calibrations(&self) -> [u32; 2] {
        [CALIBRATION1, CALIBRATION2].map(|register| self.get(register))
    }

    /// Picoseconds from START to each stop that came. `None` if one came and the
    /// calibration is invalid.
    pub(super) fn times(&self, settings: &Settings) -> Option<[Option<i64>; 5]> {
        let stops = 0..settings.stops as u8;
        // The time, and in mode 2 the clock count before it.
        let raw = |n: u8| match settings.mode {
            Mode::One => [self.get(TIME1 + 2 * n), 0],
            Mode::Two => {
                [TIME1 + 2 * (n + 1), CLOCK_COUNT1 + 2 * n].map(|register| self.get(register))
            }
        };
        let mut times = [None; 5];
        if stops.clone().all(|n| raw(n) == [0; 2]) {
            return Some(times);
        }
        let [first, second] = self.calibrations();
        let calibration =
            Calibration::new(settings.clock_khz, settings.calibration, first, second)?;
        for (n, slot) in stops.zip(&mut times) {
            let [time, clocks] = raw(n);
            *slot = match settings.mode {
                _ if [time, clocks] == [0; 2] => None,
                Mode::One => Some(calibration.mode_1(time)),
                Mode::Two => Some(calibration.mode_2(self.get(TIME1), time, clocks)),
            };
        }
        Some(times)
    }

    /// The value of a register, without its parity bit.
    fn get(&self, register: u8) -> u32 {
        let index = usize::from(register - TIME1);
        let [high, middle, low] = self.0.get(index).copied().unwrap_or_default();
        u32::from_be_bytes([0, high, middle, low]) & VALUE
    }
}
