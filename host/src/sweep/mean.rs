//! Means and errors of whole numbers that add up.

use super::results::Z_99;
use super::{PointTally, Tally};

/// Adds `amount` to a count.
pub fn add(tally: &mut Tally, name: &str, what: &str, amount: u64) {
    *tally.entry(format!("{name} {what}")).or_default() += amount;
}

/// Adds one value of `name`: how many there are, their sum and that of their
/// squares.
pub fn add_value(tally: &mut Tally, name: &str, value: i64) {
    let size = value.unsigned_abs();
    let side = if value < 0 { "below 0" } else { "above 0" };
    add(tally, name, "values", 1);
    add(tally, name, side, size);
    add(tally, name, "squares", size * size);
}

/// Adds one error of `name`, whose root mean square is asked for: a value, and
/// its fourth power. Errors to some thousand fit.
pub fn add_error(tally: &mut Tally, name: &str, error: i64) {
    add_value(tally, name, error);
    add(tally, name, "fourths", error.unsigned_abs().pow(4));
}

/// A number with the 99 % interval it lies in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// The best estimate.
    pub value: f64,
    /// From where to where.
    pub interval: (f64, f64),
}

#[allow(clippy::cast_precision_loss, reason = "far fewer than 2^52")]
impl Measured {
    /// The mean of the values of `name`, by the central limit theorem. NaN
    /// without a value.
    #[must_use]
    pub fn mean(point: &PointTally, name: &str) -> Self {
        let count = |what: &str| point.count(&format!("{name} {what}")) as f64;
        let values = count("values");
        let mean = (count("above 0") - count("below 0")) / values;
        let variance = (count("squares") / values - mean * mean).max(0.0);
        let half = Z_99 * (variance / (values - 1.0).max(1.0)).sqrt();
        Self {
            value: mean,
            interval: (mean - half, mean + half),
        }
    }

    /// The root mean square of the errors of all `names` together, by the central
    /// limit theorem for the squares. NaN without an error.
    #[must_use]
    pub fn root_mean_square(point: &PointTally, names: &[String]) -> Self {
        let sum = |what: &str| {
            let counts = names
                .iter()
                .map(|name| point.count(&format!("{name} {what}")));
            counts.sum::<u64>() as f64
        };
        let values = sum("values");
        let square = sum("squares") / values;
        let variance = (sum("fourths") / values - square * square).max(0.0);
        let half = Z_99 * (variance / (values - 1.0).max(1.0)).sqrt();
        Self {
            value: square.sqrt(),
            interval: ((square - half).max(0.0).sqrt(), (square + half).sqrt()),
        }
    }

    /// As many times as much.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            interval: (self.interval.0 * factor, self.interval.1 * factor),
        }
    }

    /// How many times `other` it is; the two are taken to be independent, and
    /// their intervals to be small.
    #[must_use]
    pub fn over(self, other: Self) -> Self {
        let share = |part: Self| (part.interval.1 - part.interval.0) / 2.0 / part.value;
        let value = self.value / other.value;
        let half = value * share(self).hypot(share(other));
        Self {
            value,
            interval: (value - half, value + half),
        }
    }

    /// With `digits` after the point, and its interval.
    #[must_use]
    pub fn text(&self, digits: usize) -> String {
        let (low, high) = self.interval;
        format!(
            "{:.digits$} ({low:.digits$} to {high:.digits$})",
            self.value
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::Point;

    fn point(tally: Tally) -> PointTally {
        PointTally {
            parameters: Point::new(),
            tally,
        }
    }

    #[test]
    fn the_mean_and_the_root_mean_square_of_known_values() {
        let mut tally = Tally::new();
        for value in [-3, 1, 4, 10] {
            add_error(&mut tally, "a", value);
        }
        let point = point(tally);
        let mean = Measured::mean(&point, "a");
        assert!((mean.value - 3.0).abs() < 1e-12);
        // Squared deviations 36 + 4 + 1 + 49, over 4 and 3.
        let half = Z_99 * (90.0_f64 / 12.0).sqrt();
        assert!((mean.interval.1 - 3.0 - half).abs() < 1e-9);
        let rms = Measured::root_mean_square(&point, &["a".to_owned()]);
        assert!((rms.value - 31.5_f64.sqrt()).abs() < 1e-12);
        assert!((mean.over(mean).value - 1.0).abs() < 1e-12);
    }

    #[test]
    fn no_value_has_no_mean() {
        assert!(Measured::mean(&point(Tally::new()), "a").value.is_nan());
    }
}
