//! The studies there are.

pub mod depth_error;
pub mod depth_step;
pub mod dynamic_depth;
pub mod event_depth;
pub mod failures;
pub mod false_events;
pub mod false_rate;
pub mod fan_motion;
pub mod gaussian_error;
pub mod hit_rate;
pub mod hyperparameters;
pub mod latency;
mod mixed;
mod one_pixel;
pub mod paper_setting;
pub mod passage;
pub mod radial_motion;
mod ranks;
pub mod roc;
pub mod static_scene;
pub mod time_to_detect;

use anyhow::{Context, Result};

use super::Study;

/// In the order of the paper; then what it does not have.
pub const ALL: &[Study] = &[
    hit_rate::STUDY,
    gaussian_error::STUDY,
    roc::STUDY,
    false_events::STUDY,
    hyperparameters::STUDY,
    static_scene::STUDY,
    depth_step::STUDY,
    radial_motion::STUDY,
    fan_motion::STUDY,
    dynamic_depth::STUDY,
    latency::STUDY,
    false_rate::STUDY,
    time_to_detect::STUDY,
    depth_error::STUDY,
    event_depth::STUDY,
    failures::STUDY,
];

/// The study of that name.
///
/// # Errors
/// If there is none.
pub fn named(name: &str) -> Result<&'static Study> {
    let found = ALL.iter().find(|study| study.name == name);
    found.with_context(|| format!("no study `{name}`: `dtof sweep` lists them"))
}
