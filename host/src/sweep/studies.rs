//! The studies there are.

pub mod depth_error;
pub mod false_events;
pub mod false_rate;
pub mod gaussian_error;
pub mod hit_rate;
pub mod hyperparameters;
pub mod paper_setting;
pub mod passage;
pub mod roc;
pub mod time_to_detect;

use anyhow::{Context, Result};

use super::Study;

/// In the order of the paper.
pub const ALL: &[Study] = &[
    hit_rate::STUDY,
    gaussian_error::STUDY,
    roc::STUDY,
    false_events::STUDY,
    hyperparameters::STUDY,
    false_rate::STUDY,
    time_to_detect::STUDY,
    depth_error::STUDY,
];

/// The study of that name.
///
/// # Errors
/// If there is none.
pub fn named(name: &str) -> Result<&'static Study> {
    let found = ALL.iter().find(|study| study.name == name);
    found.with_context(|| format!("no study `{name}`: `dtof sweep` lists them"))
}
