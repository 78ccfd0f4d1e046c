//! Progress of long jobs on the terminal.

use std::time::{Duration, Instant};

use anyhow::Result;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::interrupt::is_interrupted;
use dtof_options::progress::Progress;

/// A progress bar. It appears a second after the job begins, and only on a terminal.
pub struct Bar {
    bar: ProgressBar,
    since: Instant,
    quiet: bool,
}

impl Bar {
    /// A progress bar that never appears if `quiet`.
    #[must_use]
    pub fn new(quiet: bool) -> Self {
        Self {
            bar: ProgressBar::hidden(),
            since: Instant::now(),
            quiet,
        }
    }
}

impl Progress for Bar {
    fn begin(&mut self, total: u64, unit: &str) {
        let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden());
        let template = format!("{{bar:40}} {{human_pos}} of {{human_len}} {unit}, {{eta}} left");
        let style = ProgressStyle::with_template(&template);
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        self.bar = bar;
    }

    fn at(&mut self, done: u64) -> Result<()> {
        let long = self.since.elapsed() > Duration::from_secs(1);
        if self.bar.is_hidden() && long && !self.quiet {
            // Stays hidden where standard error is not a terminal.
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
        self.bar.set_position(done);
        Ok(())
    }

    fn ends_early(&self) -> bool {
        is_interrupted()
    }

    fn end(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// A line with the current step of a long job.
pub struct Steps {
    bar: ProgressBar,
}

impl Steps {
    /// A line on a terminal, unless `quiet`.
    #[must_use]
    pub fn new(quiet: bool) -> Self {
        let bar = ProgressBar::new_spinner();
        if quiet {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        Self { bar }
    }

    /// Shows the next step.
    pub fn at(&self, step: &str) {
        self.bar.set_message(step.to_owned());
        self.bar.tick();
    }

    /// Removes the line.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
