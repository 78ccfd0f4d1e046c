//! Progress of a long job: the job reports it, and its caller shows it.

use std::sync::{Mutex, PoisonError};

use anyhow::Result;

/// Receives the progress of a long job.
pub trait Progress: Send {
    /// A part of the job begins: `total` items called `unit`. None of them is done.
    fn begin(&mut self, total: u64, unit: &str);

    /// `done` items are done.
    ///
    /// # Errors
    /// Fails if the job was cancelled.
    fn at(&mut self, done: u64) -> Result<()>;

    /// Whether a job that reads photons ends here, with what it has.
    fn ends_early(&self) -> bool {
        false
    }

    /// The part has ended.
    fn end(&mut self);
}

/// Shows nothing.
impl Progress for () {
    fn begin(&mut self, _total: u64, _unit: &str) {}

    fn at(&mut self, _done: u64) -> Result<()> {
        Ok(())
    }

    fn end(&mut self) {}
}

/// Reports items called `unit` to `progress`, from any thread: how many are done, and how many there are. A
/// part begins with 0. A call that comes late is reported as the highest number so far.
pub fn shared<'a>(
    progress: &'a mut dyn Progress,
    unit: &'a str,
) -> impl Fn(u64, u64) -> Result<()> + Sync + 'a {
    let state = Mutex::new((progress, 0));
    move |done, total| {
        let mut state = state.lock().unwrap_or_else(PoisonError::into_inner);
        let (progress, most) = &mut *state;
        if done == 0 {
            progress.begin(total, unit);
        }
        *most = if done == 0 { 0 } else { done.max(*most) };
        progress.at(*most)?;
        if *most == total {
            progress.end();
        }
        Ok(())
    }
}
