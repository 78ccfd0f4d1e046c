//! The time of messages, from laser cycles.

use std::time::{SystemTime, UNIX_EPOCH};

use crate::hub::Snapshot;
use dtof_data::events::aer_file::Header;
use dtof_data::events::clock::LaserClock;

/// Seconds since 1970 that no longer fit into a message.
const END_S: u64 = 1 << 32;
/// Nanoseconds since laser cycle 0 that no longer fit into a point: it has a double.
const END_OF_POINTS_NS: u128 = 1 << 53;

/// Converts laser cycles into times. Without laser cycles it gives the time of day.
#[derive(Default)]
pub struct Timing {
    /// Laser cycle 0 in nanoseconds since 1970-01-01 UTC; 0 if unknown.
    start_ns: u64,
    /// `None` before the first laser cycle.
    clock: Option<LaserClock>,
    now: u64,
}

impl Timing {
    /// Times of a device or a recording. An unknown laser rate is taken as 10 MHz, as in exports.
    pub fn of(header: &Header) -> Self {
        if header.bins == 0 {
            return Self::default();
        }
        let start_us = u64::try_from(header.start_us).unwrap_or(0);
        let start_ns = start_us.saturating_mul(1000);
        Self {
            start_ns,
            clock: Some(LaserClock::from_header(header).unwrap_or_default()),
            now: start_ns.min(END_S * 1_000_000_000 - 1),
        }
    }

    /// The clock of the laser.
    pub fn clock(&self) -> LaserClock {
        self.clock.unwrap_or_default()
    }

    /// The start of a laser cycle; `None` if it does not fit into a message or a point.
    pub fn of_cycle(&self, cycle: u64) -> Option<u64> {
        let time = self.clock().nanoseconds(cycle);
        if time >= END_OF_POINTS_NS {
            return None;
        }
        let time = self.start_ns.checked_add(u64::try_from(time).ok()?)?;
        (time < END_S * 1_000_000_000).then_some(time)
    }

    /// The end of the laser cycle that began at `time`, rounded down. Moves the current time up to it.
    pub fn end(&mut self, time: u64) -> u64 {
        let end = time.saturating_add(u64::try_from(self.clock().nanoseconds(1)).unwrap_or(0));
        self.now = self.now.max(end.min(END_S * 1_000_000_000 - 1));
        end
    }

    /// Moves the current time up to that of the device or the recording.
    pub fn advance(&mut self, snapshot: &Snapshot) {
        if self.clock.is_none() {
            // There are no laser cycles yet.
            let now = SystemTime::now().duration_since(UNIX_EPOCH);
            self.now = u64::try_from(now.unwrap_or_default().as_nanos()).unwrap_or(0);
            return;
        }
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "not negative, and saturates"
        )]
        let played = self
            .start_ns
            .saturating_add((snapshot.seconds * 1e9) as u64);
        let reported = self.of_cycle(snapshot.losses.cycles).unwrap_or(0);
        let most = END_S * 1_000_000_000 - 1;
        self.now = self.now.max(reported).max(played).min(most);
    }

    /// The current time in nanoseconds.
    pub fn now(&self) -> u64 {
        self.now
    }
}
