//! How long a driver has waited, and how often INT was low for no reason.

use super::error::{Error, Waiting};
use crate::timer::Since;

/// Limits of a driver's waits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Watch {
    since: Since,
    /// Polls in a row with INT low for no reason.
    stuck: u8,
}

impl Watch {
    pub(crate) const fn new() -> Self {
        Self {
            since: Since::new(0),
            stuck: 0,
        }
    }

    /// The present wait begins at `now_ms`.
    pub(crate) const fn restart(&mut self, now_ms: u32) {
        self.since = Since::new(now_ms);
    }

    /// INT was high, or low for a reason.
    pub(crate) const fn clear_stuck(&mut self) {
        self.stuck = 0;
    }

    /// Whether the present wait has certainly lasted `limit_ms`.
    pub(crate) const fn is_over(&self, limit_ms: u32, now_ms: u32) -> bool {
        self.since.is_over(limit_ms, now_ms)
    }

    /// # Errors
    /// Returns [`Error::Timeout`] if the present wait has lasted longer than `limit_ms`.
    pub(crate) fn check_time<B, P, Boot, Cmd, D>(
        &self,
        limit_ms: u32,
        waiting: Waiting<Boot, Cmd>,
        now_ms: u32,
    ) -> Result<(), Error<B, P, Boot, Cmd, D>> {
        if self.is_over(limit_ms, now_ms) {
            return Err(Error::Timeout(waiting));
        }
        Ok(())
    }

    /// INT is low, and `status` names no reason.
    ///
    /// # Errors
    /// Returns [`Error::StuckInterrupt`] at the `limit`th time in a row.
    pub(crate) fn check_stuck<B, P, Boot, Cmd, D>(
        &mut self,
        limit: u8,
        status: u8,
    ) -> Result<(), Error<B, P, Boot, Cmd, D>> {
        self.stuck = self.stuck.saturating_add(1);
        if self.stuck >= limit {
            return Err(Error::StuckInterrupt { status });
        }
        Ok(())
    }
}
