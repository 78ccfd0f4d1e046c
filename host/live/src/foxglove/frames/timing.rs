//! From laser cycles to the time of messages.

use std::time::{SystemTime, UNIX_EPOCH};

use crate::hub::Seen;
use dtof_events::aer_file::Header;
use dtof_events::clock::LaserClock;

/// Seconds from which on a message cannot tell the time.
const END_S: u64 = 1 << 32;
/// Nanoseconds from laser cycle 0 on from which on a point cannot: they are whole numbers in a
/// double.
const END_OF_POINTS_NS: u128 = 1 << 53;

/// When laser cycles are.
pub struct Timing {
    /// Of 1970-01-01 UTC, if that is known.
    start_ns: u64,
    /// None before the first laser cycle.
    clock: Option<LaserClock>,
    now: u64,
}

impl Timing {
    /// That of no laser cycles.
    pub fn unknown() -> Self {
        Self {
            start_ns: 0,
            clock: None,
            now: 0,
        }
    }

    /// That of a device or a recording. If nobody knows the laser rate, it is the paper's, as in
    /// exports.
    pub fn of(header: &Header) -> Self {
        if header.bins == 0 {
            return Self::unknown();
        }
        let start_us = u64::try_from(header.start_us).unwrap_or(0);
        let start_ns = start_us.saturating_mul(1000);
        Self {
            start_ns,
            clock: Some(LaserClock::of(header).unwrap_or_default()),
            now: start_ns.min(END_S * 1_000_000_000 - 1),
        }
    }

    /// The laser.
    pub fn clock(&self) -> LaserClock {
        self.clock.unwrap_or_default()
    }

    /// The beginning of a laser cycle, unless a message or a point cannot hold it.
    pub fn of_cycle(&self, cycle: u64) -> Option<u64> {
        let time = self.clock().nanoseconds(cycle);
        if time >= END_OF_POINTS_NS {
            return None;
        }
        let time = self.start_ns.checked_add(u64::try_from(time).ok()?)?;
        (time < END_S * 1_000_000_000).then_some(time)
    }

    /// The end of the laser cycle that began at `time`, rounded down, and now at least that.
    pub fn end(&mut self, time: u64) -> u64 {
        let end = time.saturating_add(u64::try_from(self.clock().nanoseconds(1)).unwrap_or(0));
        self.now = self.now.max(end.min(END_S * 1_000_000_000 - 1));
        end
    }

    /// Goes on to where the device or the recording says that it is.
    pub fn advance(&mut self, seen: &Seen) {
        if self.clock.is_none() {
            // There are no laser cycles yet.
            let now = SystemTime::now().duration_since(UNIX_EPOCH);
            self.now = u64::try_from(now.unwrap_or_default().as_nanos()).unwrap_or(0);
            return;
        }
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "of a recording, not negative; what is too much is held"
        )]
        let played = self.start_ns.saturating_add((seen.seconds * 1e9) as u64);
        let reported = self.of_cycle(seen.losses.cycles).unwrap_or(0);
        let most = END_S * 1_000_000_000 - 1;
        self.now = self.now.max(reported).max(played).min(most);
    }

    /// The latest time that is known.
    pub fn now(&self) -> u64 {
        self.now
    }
}
