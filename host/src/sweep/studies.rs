//! The studies there are.

pub mod false_events;
pub mod gaussian_error;
pub mod hit_rate;
pub mod hyperparameters;
pub mod paper_setting;
pub mod roc;

use anyhow::{Context, Result};

use super::Study;

/// In the order of the paper.
pub const ALL: &[Study] = &[
    hit_rate::STUDY,
    gaussian_error::STUDY,
    roc::STUDY,
    false_events::STUDY,
    hyperparameters::STUDY,
];

/// The study of that name.
///
/// # Errors
/// If there is none.
pub fn named(name: &str) -> Result<&'static Study> {
    let found = ALL.iter().find(|study| study.name == name);
    found.with_context(|| format!("no study `{name}`: `dtof sweep` lists them"))
}
