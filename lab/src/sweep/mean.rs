//! Means and errors from integer sums.
//!
//! Sums are 64-bit integers, differences are calculated in 128 bits, so there is no cancellation:
//! means and variances are rounded once, to 53 bits.

use super::{PointTally, Tally};
use dtof_draw::chart;
use dtof_light::counts::binomial;

/// Standard deviations of an interval that holds 99 %.
pub const Z_99: f64 = 2.575_829_303_548_9;

/// Adds `amount` to the count `what` of `name`.
pub fn add(tally: &mut Tally, name: &str, what: &str, amount: u64) {
    add_count(tally, &format!("{name} {what}"), amount);
}

/// Adds `amount` to a count.
pub fn add_count(tally: &mut Tally, name: &str, amount: u64) {
    let sum = tally.entry(name.to_owned()).or_default();
    *sum = sum.saturating_add(amount);
}

/// Adds a value of `name`: its count, sum and sum of squares. Sums saturate at 2^64 - 1, and
/// [`super::Part::add`] then fails.
pub fn add_value(tally: &mut Tally, name: &str, value: i64) {
    let size = value.unsigned_abs();
    let side = if value < 0 { "below 0" } else { "above 0" };
    add(tally, name, "values", 1);
    add(tally, name, side, size);
    add(tally, name, "squares", size.saturating_pow(2));
}

/// Adds an error of `name`, for its root mean square: a value, and its fourth power. 16 million
/// errors of up to 1,000 fit.
pub fn add_error(tally: &mut Tally, name: &str, error: i64) {
    add_value(tally, name, error);
    let fourth = error.unsigned_abs().saturating_pow(4);
    add(tally, name, "fourths", fourth);
}

/// A number with its 99 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// The best estimate.
    pub value: f64,
    /// Its 99 % interval.
    pub interval: (f64, f64),
}

/// The mean of `values` integers from their `sum` and sum of `squares`, and half the width of its
/// 99 % interval by the central limit theorem.
fn mean_and_half(values: u128, sum: i128, squares: u128) -> (f64, f64) {
    // values² times the variance; never below 0 (Cauchy and Schwarz).
    let spread = (values * squares).saturating_sub(sum.unsigned_abs().pow(2));
    let count = values as f64;
    let variance = spread as f64 / count / count;
    let half = Z_99 * (variance / (count - 1.0).max(1.0)).sqrt();
    (sum as f64 / count, half)
}

impl Measured {
    /// With an interval of `half` on either side.
    #[must_use]
    pub const fn plus_minus(value: f64, half: f64) -> Self {
        Self {
            value,
            interval: (value - half, value + half),
        }
    }

    /// The share of `successes` in `trials`, with the Clopper-Pearson interval (at least 99 %) of
    /// the probability.
    #[must_use]
    pub fn share(successes: u64, trials: u64) -> Self {
        Self {
            value: successes as f64 / trials as f64,
            interval: binomial::interval(successes, trials, 0.005),
        }
    }

    /// Whether the interval contains `value`.
    #[must_use]
    pub fn contains(&self, value: f64) -> bool {
        (self.interval.0..=self.interval.1).contains(&value)
    }

    /// A point of a chart at `x`.
    #[must_use]
    pub const fn at(&self, x: f64) -> chart::Point {
        chart::Point {
            x,
            y: self.value,
            interval: Some(self.interval),
        }
    }

    /// Value and interval with `digits` decimals: three cells of a CSV table.
    #[must_use]
    pub fn cells(&self, digits: usize) -> String {
        let (low, high) = self.interval;
        format!("{:.digits$},{low:.digits$},{high:.digits$}", self.value)
    }

    /// The mean of the values of `name`, by the central limit theorem. NaN without values.
    #[must_use]
    pub fn mean(point: &PointTally, name: &str) -> Self {
        let count = |what: &str| point.count(&format!("{name} {what}"));
        let sum = i128::from(count("above 0")) - i128::from(count("below 0"));
        let (value, half) = mean_and_half(count("values").into(), sum, count("squares").into());
        Self::plus_minus(value, half)
    }

    /// The root mean square of the errors of `name`. NaN without errors.
    #[must_use]
    pub fn root_mean_square(point: &PointTally, name: &str) -> Self {
        let sum = |what: &str| u128::from(point.count(&format!("{name} {what}")));
        Self::root_of_squares(sum("values"), sum("squares"), sum("fourths"))
    }

    /// The root mean square of `values` errors, from the sums of their `squares` and `fourths`
    /// powers (each below 2^64), by the central limit theorem for the squares. NaN without errors.
    #[must_use]
    pub fn root_of_squares(values: u128, squares: u128, fourths: u128) -> Self {
        let sum = i128::try_from(squares).unwrap_or(i128::MAX);
        let (square, half) = mean_and_half(values, sum, fourths);
        Self {
            value: square.sqrt(),
            interval: ((square - half).max(0.0).sqrt(), (square + half).sqrt()),
        }
    }

    /// Value and interval multiplied by `factor`.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            interval: (self.interval.0 * factor, self.interval.1 * factor),
        }
    }

    /// The ratio to `other`, for independent values with small intervals.
    #[must_use]
    pub fn over(self, other: Self) -> Self {
        let share = |part: Self| (part.interval.1 - part.interval.0) / 2.0 / part.value;
        let value = self.value / other.value;
        Self::plus_minus(value, value * share(self).hypot(share(other)))
    }

    /// Value and half of the interval with `digits` decimals, as text.
    #[must_use]
    pub fn with_half(&self, digits: usize) -> String {
        let half = (self.interval.1 - self.interval.0) / 2.0;
        format!("{:.digits$} ±{half:.digits$}", self.value)
    }

    /// Value and interval with `digits` decimals, as text.
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

    #[test]
    fn the_mean_and_the_root_mean_square_of_known_values() {
        let mut tally = Tally::new();
        for value in [-3, 1, 4, 10] {
            add_error(&mut tally, "a", value);
        }
        let point = tally.into();
        let mean = Measured::mean(&point, "a");
        assert!((mean.value - 3.0).abs() < 1e-12);
        // Squared deviations 36 + 4 + 1 + 49, over 4 and 3.
        let half = Z_99 * (90.0_f64 / 12.0).sqrt();
        assert!((mean.interval.1 - 3.0 - half).abs() < 1e-9);
        let rms = Measured::root_mean_square(&point, "a");
        assert!((rms.value - 31.5_f64.sqrt()).abs() < 1e-12);
        assert!((mean.over(mean).value - 1.0).abs() < 1e-12);
    }

    /// Fourth powers near 2^62 that differ in their last bits: in `f64` their
    /// difference would be 0 or noise.
    #[test]
    fn nothing_cancels() {
        let error = |error: u128| [1, error.pow(2), error.pow(4)];
        let (a, b) = (error(46_340), error(46_341));
        let [values, squares, fourths] = std::array::from_fn(|index| a[index] + b[index]);
        let rms = Measured::root_of_squares(values, squares, fourths);
        // Squares differ by 92,681: the deviation of each from their mean is half.
        let half = Z_99 * 92_681.0 / 2.0;
        let mean = (46_340.0_f64.powi(2) + 46_341.0_f64.powi(2)) / 2.0;
        assert!((rms.interval.1 - (mean + half).sqrt()).abs() < 1e-9);
    }

    #[test]
    fn no_value_has_no_mean() {
        assert!(Measured::mean(&Tally::new().into(), "a").value.is_nan());
    }
}
