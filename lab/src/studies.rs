//! All studies.

pub mod analysis;
pub mod beyond;
pub mod failures;
pub mod methods;
pub mod scenes;

use anyhow::{Context, Result};

use self::analysis::{false_events, gaussian_error, hit_rate, roc};
use self::beyond::{
    binning_edges, binning_rate, binning_reports, binning_scenes, confirmed_depth, counters,
    dither, echo_wait, echoes, neighbours, tracking,
};
use self::methods::{depth_error, event_depth, false_rate, time_to_detect};
use self::scenes::{
    depth_step, dynamic_depth, fan_motion, hyperparameters, latency, radial_motion, static_scene,
};
use crate::sweep::Study;

/// In the order of the paper, then beyond the paper.
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
    binning_rate::STUDY,
    binning_reports::STUDY,
    binning_edges::STUDY,
    binning_scenes::STUDY,
    neighbours::STUDY,
    confirmed_depth::STUDY,
    tracking::STUDY,
    echoes::STUDY,
    echo_wait::STUDY,
    dither::STUDY,
    counters::STUDY,
    failures::STUDY,
];

/// The study named `name`.
///
/// # Errors
/// Fails if there is no such study.
pub fn named(name: &str) -> Result<&'static Study> {
    let found = ALL.iter().find(|study| study.name == name);
    found.with_context(|| format!("no study `{name}`: `cargo lab sweep` lists them"))
}
