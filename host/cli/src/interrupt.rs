//! Ctrl-C, or a request to end in another way: a command ends when it next looks.

use std::process;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Result;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// From now on [`is_interrupted`] says so. Who asks a second time does not wait: `at_once` is
/// called, and the program ends.
///
/// # Errors
/// If the operating system has no such thing, or this was called before.
pub fn listen(at_once: fn()) -> Result<()> {
    ctrlc::set_handler(move || {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            at_once();
            process::exit(130);
        }
    })?;
    Ok(())
}

/// Whether Ctrl-C was pressed.
pub fn is_interrupted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}
