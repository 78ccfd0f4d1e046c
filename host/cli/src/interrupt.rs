//! Ctrl-C and other requests to end. A command checks for them now and then.

use std::process;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Result;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Handles Ctrl-C, which [`is_interrupted`] then reports. A second Ctrl-C ends the program at
/// once.
///
/// # Errors
/// Fails if the operating system does not support it, or if this was called before.
pub fn handle_ctrl_c() -> Result<()> {
    ctrlc::set_handler(move || {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            process::exit(130);
        }
    })?;
    Ok(())
}

/// Returns whether Ctrl-C was pressed.
pub fn is_interrupted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}
