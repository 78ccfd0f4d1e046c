//! Limits on the wait for an answer.

use std::time::{Duration, Instant};

use anyhow::{Result, ensure};

/// Longest wait without an answer or an event.
const ANSWER: Duration = Duration::from_secs(30);
/// Longest wait for an answer while events arrive. A message of photons may cause a minute of events
/// on a slow line.
const EVENTS_ALONE: Duration = Duration::from_secs(600);

/// A wait for an answer.
#[derive(Clone, Copy)]
pub(super) struct Wait {
    began: Instant,
    /// Time of the start or the last event.
    last_event: Instant,
    arrived: u64,
}

impl Wait {
    /// Begins a wait; `arrived` events have come so far.
    pub fn new(arrived: u64) -> Self {
        let now = Instant::now();
        Self {
            began: now,
            last_event: now,
            arrived,
        }
    }

    /// Fails if a limit is exceeded; `arrived` events have come so far.
    pub fn check(&mut self, arrived: u64) -> Result<()> {
        if arrived > self.arrived {
            (self.last_event, self.arrived) = (Instant::now(), arrived);
        }
        within(self.last_event, ANSWER)?;
        within(self.began, EVENTS_ALONE)
    }
}

fn within(since: Instant, most: Duration) -> Result<()> {
    ensure!(
        since.elapsed() < most,
        "the device does not answer for {} seconds",
        most.as_secs()
    );
    Ok(())
}
