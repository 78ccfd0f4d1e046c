//! The share of the work that is done.

use std::cell::Cell;

use anyhow::Result;

/// About so many shares are reported.
const REPORTS: f64 = 200.0;

/// What has been done and what is left, in any unit of work.
pub(super) struct Work<'a> {
    /// Takes the name of the step and the share.
    report: &'a dyn Fn(&str, f64) -> Result<()>,
    /// The name of the step.
    step: Cell<&'static str>,
    /// The work of the step.
    amount: Cell<f64>,
    /// The work before it.
    done: Cell<f64>,
    /// The work of the step and after it.
    left: Cell<f64>,
    /// The last share that was reported.
    last: Cell<f64>,
}

impl<'a> Work<'a> {
    pub fn new(report: &'a dyn Fn(&str, f64) -> Result<()>) -> Self {
        Self {
            report,
            step: Cell::new(""),
            amount: Cell::new(0.0),
            done: Cell::new(0.0),
            left: Cell::new(1.0),
            last: Cell::new(0.0),
        }
    }

    /// Begins `step`, which is `amount` of the work that is `left`.
    pub fn begin(&self, step: &'static str, amount: f64, left: f64) -> Result<()> {
        self.done.set(self.done.get() + self.amount.get());
        self.left.set(left.max(amount));
        self.amount.set(amount);
        self.step.set(step);
        self.show(0.0)
    }

    /// A part of the step is done, 0 to 1.
    pub fn at(&self, part: f64) -> Result<()> {
        let share = self.share(part);
        if share - self.last.get() < 1.0 / REPORTS {
            return Ok(());
        }
        self.show(part)
    }

    fn share(&self, part: f64) -> f64 {
        let done = self.done.get() + part * self.amount.get();
        let all = self.done.get() + self.left.get();
        // What is left is known better and better: the share may wait, but does not go back.
        (done / all.max(f64::MIN_POSITIVE)).clamp(self.last.get(), 1.0)
    }

    fn show(&self, part: f64) -> Result<()> {
        self.last.set(self.share(part));
        (self.report)(self.step.get(), self.last.get())
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;

    #[test]
    fn shares_grow_to_the_whole_and_are_not_too_many() {
        let seen = RefCell::new(Vec::new());
        let report = |step: &str, share: f64| {
            seen.borrow_mut().push((step.to_owned(), share));
            Ok(())
        };
        let work = Work::new(&report);
        // The second step turns out to be longer than was thought.
        for (step, amount, left) in [("a", 10.0, 100.0), ("b", 150.0, 190.0), ("c", 40.0, 40.0)] {
            work.begin(step, amount, left).unwrap();
            for part in 0..=1000 {
                work.at(f64::from(part) / 1000.0).unwrap();
            }
        }
        let seen = seen.into_inner();
        assert!(seen.is_sorted_by_key(|(_, share)| *share));
        assert_eq!(seen[0], ("a".to_owned(), 0.0));
        assert!(seen.last().unwrap().1 > 0.99, "{seen:?}");
        assert!((150..=210).contains(&seen.len()), "{}", seen.len());
        let first_c = seen.iter().find(|(step, _)| step == "c").unwrap();
        assert!((first_c.1 - 0.8).abs() < 1e-9, "{first_c:?}");
    }

    #[test]
    fn an_error_ends_the_work() {
        let work = Work::new(&|_, _| anyhow::bail!("stopped"));
        assert!(work.begin("a", 1.0, 1.0).is_err());
        assert!(work.at(1.0).is_err());
    }
}
