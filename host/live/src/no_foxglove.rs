//! In place of the server for Foxglove, where the feature `foxglove` is off.

use anyhow::Result;

use super::origin::Origin;
use dtof_options::Refused;

/// Clients at a time.
pub const MOST_CLIENTS: usize = 0;

/// There is none.
pub enum Foxglove {}

impl Foxglove {
    /// Refuses.
    ///
    /// # Errors
    /// Always: it names the feature.
    pub fn bind(_port: u16, _origins: Vec<Origin>) -> Result<Self> {
        Err(Refused::new(
            "foxglove",
            "needs a program that is built with --features foxglove",
        )
        .into())
    }

    /// There is none.
    #[must_use]
    pub fn address(&self) -> &str {
        match *self {}
    }
}
