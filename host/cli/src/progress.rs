//! Progress of long jobs on the terminal.

use std::time::{Duration, Instant};

use anyhow::Result;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::interrupt::is_interrupted;
use dtof_data::options::progress::Progress;

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

/// The steps of a long job, with the share that is done and the time left. On a terminal only, and at once.
pub struct Steps {
    bar: ProgressBar,
    since: Instant,
}

impl Steps {
    /// A bar on a terminal, unless `quiet`.
    #[must_use]
    pub fn new(quiet: bool) -> Self {
        let bar = ProgressBar::new(1000);
        let style = ProgressStyle::with_template("{bar:30} {percent:>3} %, {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        if quiet {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        Self {
            bar,
            since: Instant::now(),
        }
    }

    /// Shows the current step, and the share of the whole that is done, 0 to 1.
    pub fn at(&self, step: &str, share: f64) {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "0 to 1"
        )]
        self.bar.set_position((share * 1000.0) as u64);
        let left = time_left(self.since.elapsed(), share);
        let left = left.map_or(String::new(), |left| format!("about {left} left, "));
        self.bar.set_message(format!("{left}{step}"));
        self.bar.tick();
    }

    /// Hides the bar while `print` writes lines.
    pub fn suspend(&self, print: impl FnOnce()) {
        self.bar.suspend(print);
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// The time that is left if the rest goes on at the same speed, in seconds, or in minutes from two on. None at
/// the very beginning.
fn time_left(elapsed: Duration, share: f64) -> Option<String> {
    let left = elapsed.as_secs_f64() * (1.0 - share) / share;
    match left {
        _ if share <= 0.0 => None,
        ..120.0 => Some(format!("{left:.0} s")),
        _ => Some(format!("{:.0} min", left / 60.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_that_of_the_share_that_is_left() {
        let of = |seconds, share| time_left(Duration::from_secs(seconds), share);
        assert_eq!(of(1, 0.0), None);
        assert_eq!(of(1, 0.02).as_deref(), Some("49 s"));
        assert_eq!(of(30, 0.1).as_deref(), Some("4 min"));
        assert_eq!(of(30, 1.0).as_deref(), Some("0 s"));
    }
}
