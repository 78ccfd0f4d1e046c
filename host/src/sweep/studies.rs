//! The studies there are.

pub mod hit_rate;

use anyhow::{Context, Result};

use super::Study;

/// In the order of the paper.
pub const ALL: &[Study] = &[hit_rate::STUDY];

/// The study of that name.
///
/// # Errors
/// If there is none.
pub fn named(name: &str) -> Result<&'static Study> {
    let found = ALL.iter().find(|study| study.name == name);
    found.with_context(|| format!("no study `{name}`: `dtof sweep` lists them"))
}
