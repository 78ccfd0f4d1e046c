//! How long a device may keep the host waiting.

use std::time::{Duration, Instant};

use anyhow::{Result, ensure};

/// A device that speaks, and does not answer for so long, nor sends an event, is gone.
const ANSWER: Duration = Duration::from_secs(30);
/// So is one that sends events, and does not answer for so long. A message of photons may make
/// events for a minute on a slow line.
const EVENTS_ALONE: Duration = Duration::from_secs(600);

/// Waiting for an answer.
#[derive(Clone, Copy)]
pub(super) struct Wait {
    began: Instant,
    /// The beginning, or the last event.
    heard: Instant,
    arrived: u64,
}

impl Wait {
    /// Begins after so many events have `arrived`.
    pub fn new(arrived: u64) -> Self {
        let now = Instant::now();
        Self {
            began: now,
            heard: now,
            arrived,
        }
    }

    /// Fails once a device has kept the host waiting for too long.
    pub fn goes_on(&mut self, arrived: u64) -> Result<()> {
        if arrived > self.arrived {
            (self.heard, self.arrived) = (Instant::now(), arrived);
        }
        within(self.heard, ANSWER)?;
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
