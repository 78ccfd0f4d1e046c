//! The times that each format can hold.

use anyhow::{Result, ensure};

use super::Format;
use dtof_data::events::aer_file::Header;
use dtof_data::events::clock::LaserClock;
use dtof_data::options::Refused;

/// Bits of an EVT2 time in microseconds.
pub(super) const EVT2_BITS: u32 = 34;

/// The time span of the events of a file.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// Nanoseconds from 1970-01-01 UTC to laser cycle 0; 0 if unknown.
    pub start_ns: u64,
    /// Nanoseconds from laser cycle 0 to the end of the last event's laser cycle, not 0.
    pub end_ns: u64,
}

impl Span {
    /// The span of a file whose last event is in laser cycle `latest`.
    ///
    /// # Errors
    /// Fails if `format` cannot hold the time of its events.
    pub fn new(format: Format, clock: &LaserClock, header: &Header, latest: u64) -> Result<Self> {
        let start_ns = i128::from(header.start_us) * 1000;
        let end_ns = clock.end_ns(latest);
        if let Some(seconds) = format.end_seconds() {
            let end = start_ns + i128::from(end_ns);
            ensure!(
                start_ns >= 0 && end < i128::from(seconds) * 1_000_000_000,
                "its events are {} s to {} s after 1970: {} holds those of less than {seconds} s",
                start_ns / 1_000_000_000,
                end / 1_000_000_000,
                format.name()
            );
        }
        // The other formats have no absolute time.
        let start_ns = u64::try_from(start_ns).unwrap_or(0);
        Ok(Self { start_ns, end_ns })
    }
}

impl Format {
    /// Checks that the format can hold the time of an event in laser cycle `cycle`.
    pub(super) fn check(self, clock: &LaserClock, cycle: u64) -> Result<()> {
        let Some(end_ns) = self.end_ns() else {
            return Ok(());
        };
        let time = clock.nanoseconds(cycle);
        let name = self.name();
        ensure!(
            time < end_ns,
            Refused::input(format!(
                "laser cycle {cycle} lies beyond, {} s after the start: {name} holds {} s of time \
                 (`laser_hz` {})",
                time / 1_000_000_000,
                end_ns / 1_000_000_000,
                clock.millihertz() as f64 / 1e3
            ))
        );
        Ok(())
    }

    /// Its name in messages.
    pub(super) fn name(self) -> String {
        format!("{self:?}").to_uppercase()
    }

    /// Absolute times must be less than so many seconds since 1970, if the format has them.
    fn end_seconds(self) -> Option<u64> {
        match self {
            Self::Csv | Self::Pcd | Self::Ply | Self::Evt2 => None,
            Self::Mcap => Some(1 << 32),
            Self::Ros2 => Some(1 << 31),
        }
    }

    /// Times of events must be less than so many nanoseconds.
    fn end_ns(self) -> Option<u128> {
        match self {
            Self::Csv => None,
            // Whole numbers in a double.
            Self::Pcd | Self::Ply | Self::Mcap | Self::Ros2 => Some(1 << 53),
            // Readers differ in how they treat times that wrap around.
            Self::Evt2 => Some(1000 << EVT2_BITS),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_that_a_double_would_round_are_refused() {
        let clock = LaserClock::new(1_000_000_000).unwrap();
        assert!(Format::Pcd.check(&clock, (1 << 53) - 1).is_ok());
        let error = Format::Ply.check(&clock, 1 << 53).unwrap_err();
        assert!(error.to_string().contains("PLY holds 9007199 s"), "{error}");
        assert!(Format::Csv.check(&clock, u64::MAX).is_ok());
        let clock = LaserClock::new(1_000_000).unwrap();
        assert!(Format::Evt2.check(&clock, (1 << 34) - 1).is_ok());
        assert!(Format::Evt2.check(&clock, 1 << 34).is_err());
    }
}
