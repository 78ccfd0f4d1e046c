//! From laser cycles to time.

use std::fmt;

use anyhow::{Result, ensure};

use crate::events::aer_file::Header;

/// The rate of the laser.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LaserClock {
    /// Laser cycles in a thousand seconds, not 0.
    millihertz: u128,
}

impl Default for LaserClock {
    fn default() -> Self {
        Self {
            millihertz: 1000 * u128::from(Self::PAPER_HZ),
        }
    }
}

impl LaserClock {
    /// The paper's 10 MHz (section III-A).
    pub const PAPER_HZ: u64 = 10_000_000;

    /// `hz` laser cycles a second.
    ///
    /// # Errors
    /// Fails if `hz` is 0.
    pub fn new(hz: u64) -> Result<Self> {
        ensure!(hz > 0, "the laser has 0 cycles a second");
        Ok(Self {
            millihertz: 1000 * u128::from(hz),
        })
    }

    /// The clock of a file; `None` if its rate is unknown.
    #[must_use]
    pub fn from_header(header: &Header) -> Option<Self> {
        Self::from_millihertz(header.laser_millihertz)
    }

    /// The clock for so many laser cycles in a thousand seconds; `None` for 0, which means unknown.
    #[must_use]
    pub fn from_millihertz(millihertz: u64) -> Option<Self> {
        let millihertz = u128::from(millihertz);
        (millihertz > 0).then_some(Self { millihertz })
    }

    /// The clock to use for a file: `requested`, else the file's, else the paper's. Warns if it is
    /// not the file's. Rates that agree to the whole hertz are equal, and the file's is more exact.
    #[must_use]
    pub fn for_file(requested: Option<Self>, header: &Header) -> (Self, Option<String>) {
        match Self::prefer(requested, Self::from_header(header), "the file") {
            (Some(clock), warning) => (clock, warning),
            (None, _) => {
                let assumed = Self::default();
                let warning = format!(
                    "the laser rate is not known; times are for {assumed}, unless --laser-hz says \
                     another"
                );
                (assumed, Some(warning))
            }
        }
    }

    /// The requested clock, or `own`, that of a file or a device called `whose`. Warns if they
    /// differ.
    #[must_use]
    pub fn prefer(
        requested: Option<Self>,
        own: Option<Self>,
        whose: &str,
    ) -> (Option<Self>, Option<String>) {
        match (requested, own) {
            (Some(requested), Some(own))
                if own.millihertz / 1000 * 1000 != requested.millihertz =>
            {
                let differ = format!("{whose} has a laser of {own}; times are for {requested}");
                (Some(requested), Some(differ))
            }
            _ => (own.or(requested), None),
        }
    }

    /// Laser cycles in a thousand seconds, as a header has them.
    #[must_use]
    pub fn millihertz(&self) -> u64 {
        u64::try_from(self.millihertz).unwrap_or(u64::MAX)
    }

    /// Nanoseconds from the start of laser cycle 0 to that of `cycle`, rounded down.
    #[must_use]
    pub fn nanoseconds(&self, cycle: u64) -> u128 {
        u128::from(cycle) * 1_000_000_000_000 / self.millihertz
    }

    /// The same in microseconds.
    #[must_use]
    pub fn microseconds(&self, cycle: u64) -> u128 {
        u128::from(cycle) * 1_000_000_000 / self.millihertz
    }

    /// The nanosecond in which laser cycle `cycle` ends; at least 1, at most the largest 64-bit
    /// number.
    #[must_use]
    pub fn end_ns(&self, cycle: u64) -> u64 {
        let end = self.nanoseconds(cycle.saturating_add(1)).max(1);
        u64::try_from(end).unwrap_or(u64::MAX)
    }
}

/// "10 MHz", "20 kHz".
impl fmt::Display for LaserClock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let millihertz = self.millihertz as f64;
        if millihertz < 1e9 {
            return write!(f, "{} kHz", millihertz / 1e6);
        }
        write!(f, "{} MHz", millihertz / 1e9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_is_rounded_down_and_never_overflows() {
        let clock = LaserClock::default();
        assert_eq!(clock.nanoseconds(3), 300);
        assert_eq!(clock.microseconds(19), 1);
        let slow = LaserClock::new(3).unwrap();
        assert_eq!(slow.microseconds(2), 666_666);
        let one = LaserClock::new(1).unwrap();
        assert_eq!(
            one.nanoseconds(u64::MAX),
            u128::from(u64::MAX) * 1_000_000_000
        );
        assert!(LaserClock::new(0).is_err());
        assert_eq!((clock.end_ns(0), one.end_ns(u64::MAX)), (100, u64::MAX));
        assert_eq!(LaserClock::new(u64::MAX).unwrap().end_ns(0), 1);
        assert_eq!(clock.to_string(), "10 MHz");
    }

    #[test]
    fn what_was_said_of_the_laser_holds_and_a_difference_is_told() {
        let preferred = |requested: Option<u64>, own| {
            let requested = requested.map(|hz| LaserClock::new(hz).unwrap());
            let (clock, warning) =
                LaserClock::prefer(requested, LaserClock::from_millihertz(own), "the device");
            (clock.map(|clock| clock.millihertz()), warning)
        };
        assert_eq!(preferred(None, 0), (None, None));
        assert_eq!(preferred(None, 4_165_818), (Some(4_165_818), None));
        assert_eq!(preferred(Some(10_000), 0), (Some(10_000_000), None));
        // Options have whole hertz, so the device's own rate is more exact.
        assert_eq!(preferred(Some(4165), 4_165_818), (Some(4_165_818), None));
        let (rate, warning) = preferred(Some(3000), 4_165_818);
        assert_eq!(rate, Some(3_000_000));
        let expected = "the device has a laser of 4.165818 kHz; times are for 3 kHz";
        assert_eq!(warning.as_deref(), Some(expected));
    }
}
