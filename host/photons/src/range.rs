//! The limits of the numbers in a file.

use std::ops::RangeInclusive;

use anyhow::{Result, ensure};

/// Is `value` in `range`? Infinity and what is not a number never are.
///
/// # Errors
/// A line that names the key, the value and the range.
pub fn within(key: &str, value: f64, range: RangeInclusive<f64>) -> Result<()> {
    let (least, most) = (range.start(), range.end());
    ensure!(
        range.contains(&value),
        "{key} {value}: must be from {least} to {most}"
    );
    Ok(())
}
