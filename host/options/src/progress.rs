//! Progress of a long job: the job reports it, and its caller shows it.

use anyhow::Result;

/// Receives the progress of a long job.
pub trait Progress {
    /// A part of the job begins: `total` items called `unit`.
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
