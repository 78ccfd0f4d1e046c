//! Ranges of numbers in files.

use std::ops::RangeInclusive;

use anyhow::{Result, ensure};

/// Checks that `value` is in `range`, and so finite.
///
/// # Errors
/// Names the key, the value and the range.
pub fn within(key: &str, value: f64, range: RangeInclusive<f64>) -> Result<()> {
    let (min, max) = (range.start(), range.end());
    ensure!(
        range.contains(&value),
        "{key} {value}: must be from {min} to {max}"
    );
    Ok(())
}
