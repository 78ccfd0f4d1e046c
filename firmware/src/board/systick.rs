//! Waiting by the timer of milliseconds.

use embedded_hal::delay::DelayNs;

/// At most this long at a time: a part of the timer's millisecond, so that an
/// interrupt between two looks at the timer hides none of its turns, and few
/// enough cycles for 32 bits.
const PIECE_NS: u32 = 100_000;

/// The value the timer restarts from, so that a turn takes a millisecond of a processor
/// at `hclk_hz`.
#[must_use]
pub const fn reload(hclk_hz: u32) -> u32 {
    hclk_hz / 1000 - 1
}

/// Waits by the processor's timer, which counts its cycles down from [`reload`] to
/// 0 again and again and is running. Never shorter than requested; longer by a
/// look at the timer, and by the interrupts that come.
#[derive(Debug)]
pub struct SystickDelay<F> {
    now: F,
    reload: u32,
    cycles_per_us: u32,
}

impl<F: FnMut() -> u32> SystickDelay<F> {
    /// `now` reads the timer of a processor at `hclk_hz`: whole megahertz, at
    /// most 16,000.
    pub const fn new(now: F, hclk_hz: u32) -> Self {
        Self {
            now,
            reload: reload(hclk_hz),
            cycles_per_us: hclk_hz / 1_000_000,
        }
    }

    // Not inlined to save flash: a call while waiting costs nothing.
    #[inline(never)]
    fn wait(&mut self, ns: u32) {
        let start = (self.now)();
        let cycles = (ns * self.cycles_per_us).div_ceil(1000);
        // The first cycle was under way.
        while elapsed(start, (self.now)(), self.reload) <= cycles {}
    }
}

impl<F: FnMut() -> u32> DelayNs for SystickDelay<F> {
    #[inline(never)]
    fn delay_ns(&mut self, ns: u32) {
        let mut left = ns;
        while left > PIECE_NS {
            self.wait(PIECE_NS);
            left -= PIECE_NS;
        }
        self.wait(left);
    }
}

/// Cycles from `start` to `now`, both read from a timer that counts down to 0 and
/// goes on with `reload`; less than one turn of it.
const fn elapsed(start: u32, now: u32, reload: u32) -> u32 {
    if now <= start {
        start - now
    } else {
        start + (reload + 1 - now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use core::cell::Cell;

    /// Every pair of a small timer.
    #[test]
    fn elapsed_is_how_often_the_timer_was_counted_down() {
        for reload in 0..20 {
            for start in 0..=reload {
                let mut now = start;
                for cycles in 0..=reload {
                    assert_eq!(elapsed(start, now, reload), cycles);
                    now = now.checked_sub(1).unwrap_or(reload);
                }
            }
        }
        // The most 24 bits can count.
        assert_eq!(elapsed(0, 1, 0xff_ffff), 0xff_ffff);
    }

    /// From any value of the timer, with interrupts or without: what is requested,
    /// and no more than the looks and pieces cost.
    #[test]
    fn waits_as_long_as_asked() {
        for (hclk_hz, per_us) in [(16_000_000, 16), (168_000_000, 168)] {
            let turn = u64::from(reload(hclk_hz)) + 1;
            assert_eq!(turn, 1000 * per_us);
            for look in [1, 7, 90 * per_us] {
                for first in (0..turn).step_by(997) {
                    for ns in [0, 1, 100, 300, 1300, 99_999, 100_000, 100_001, 3_000_000] {
                        let cycle = Cell::new(first);
                        let now = || {
                            cycle.set(cycle.get() + look);
                            u32::try_from(turn - 1 - cycle.get() % turn).unwrap()
                        };
                        SystickDelay::new(now, hclk_hz).delay_ns(ns);
                        let took = cycle.get() - first;
                        let requested = (u64::from(ns) * per_us).div_ceil(1000);
                        let pieces = u64::from(ns.div_ceil(PIECE_NS).max(1));
                        assert!(took >= requested, "{took} of {requested} cycles");
                        assert!(took <= requested + pieces * (2 * look + 1));
                    }
                }
            }
        }
    }
}
