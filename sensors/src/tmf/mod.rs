//! What the drivers of the TMF8820/21/28 and the TMF8829 share: errors, registers and waits.

mod config;
mod error;
pub(crate) mod registers;
mod watch;

pub use self::config::ConfigError;
pub use self::error::{Error, ModelError, Waiting};

pub(crate) use self::config::check_address_and_pulses;
pub(crate) use self::watch::Watch;

/// Adds 1 and stops at the largest value.
pub(crate) fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
