//! How far a long job is: the job tells it, whoever runs the job shows it.

use anyhow::Result;

/// Is told how far a long job is.
pub trait Progress {
    /// A part of the job begins: `total` things called `unit`.
    fn begin(&mut self, total: u64, unit: &str);

    /// So many of them are done.
    ///
    /// # Errors
    /// If nobody wants the rest.
    fn at(&mut self, done: u64) -> Result<()>;

    /// The part has ended.
    fn end(&mut self);
}

/// Nobody watches.
impl Progress for () {
    fn begin(&mut self, _total: u64, _unit: &str) {}

    fn at(&mut self, _done: u64) -> Result<()> {
        Ok(())
    }

    fn end(&mut self) {}
}
