//! Replaces the server for Foxglove if the feature `foxglove` is off.

use anyhow::Result;

use super::origin::Origin;
use dtof_data::options::Refused;

/// Most clients at a time.
pub const MOST_CLIENTS: usize = 0;

/// A server that cannot exist.
pub enum Foxglove {}

impl Foxglove {
    /// Refuses to listen.
    ///
    /// # Errors
    /// Always fails, and names the feature.
    pub fn bind(_port: u16, _origins: Vec<Origin>) -> Result<Self> {
        Err(Refused::new(
            "foxglove",
            "needs a program that is built with --features foxglove",
        )
        .into())
    }

    /// Cannot be called.
    #[must_use]
    pub fn address(&self) -> &str {
        match *self {}
    }
}
