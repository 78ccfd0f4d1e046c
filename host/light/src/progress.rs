//! Progress of a long calculation.

use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::Result;

/// Takes how many items of a part of the calculation are done, and how many there are. Each part begins with
/// 0. Many threads call it, so a call may come after one with a higher number. An error ends the calculation.
pub type Progress<'a> = &'a (dyn Fn(u64, u64) -> Result<()> + Sync);

/// Shows nothing.
pub const NONE: Progress = &|_, _| Ok(());

/// A part of a calculation. Its items are done on any number of threads.
pub struct Part<'a> {
    progress: Progress<'a>,
    done: AtomicU64,
    total: u64,
}

impl<'a> Part<'a> {
    /// A part of `total` items.
    ///
    /// # Errors
    /// Fails if `progress` ends the calculation.
    pub fn new(progress: Progress<'a>, total: u64) -> Result<Self> {
        progress(0, total)?;
        Ok(Self {
            progress,
            done: AtomicU64::new(0),
            total,
        })
    }

    /// Reports what is done so far, in the middle of a long item.
    ///
    /// # Errors
    /// Fails if `progress` ends the calculation.
    pub fn check(&self) -> Result<()> {
        (self.progress)(self.done.load(Ordering::Relaxed), self.total)
    }

    /// Another item is done.
    ///
    /// # Errors
    /// Fails if `progress` ends the calculation.
    pub fn next(&self) -> Result<()> {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        (self.progress)(done, self.total)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    #[test]
    fn a_part_reports_what_is_done_and_ends_if_it_is_told_to() {
        let told = Mutex::new(Vec::new());
        let progress = |done: u64, total: u64| {
            told.lock().unwrap().push((done, total));
            anyhow::ensure!(done < 2, "ended");
            Ok(())
        };
        let part = Part::new(&progress, 5).unwrap();
        part.check().unwrap();
        part.next().unwrap();
        assert!(part.next().is_err() && part.check().is_err());
        let expected = [(0, 5), (0, 5), (1, 5), (2, 5), (2, 5)];
        assert_eq!(*told.lock().unwrap(), expected);
    }
}
