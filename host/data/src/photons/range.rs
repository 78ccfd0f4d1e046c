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

#[cfg(test)]
mod tests {
    use super::within;

    #[test]
    fn the_ends_are_within_and_what_is_no_number_is_not() {
        let check = |value| within("angle", value, -1.5..=2.0).map_err(|error| error.to_string());
        for value in [-1.5, 0.0, 2.0] {
            assert_eq!(check(value), Ok(()));
        }
        for value in [-1.6, 2.1, f64::INFINITY, f64::NAN] {
            let error = format!("angle {value}: must be from -1.5 to 2");
            assert_eq!(check(value), Err(error));
        }
    }
}
