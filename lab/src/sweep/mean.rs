//! Means and errors of whole numbers that add up.
//!
//! Sums are whole numbers of 64 bits, and what is subtracted from each other is
//! worked out in 128 bits, so that nothing cancels: a mean and a variance are
//! rounded once, to a part in 2^52.

use super::{PointTally, Tally};
use dtof_draw::chart;
use dtof_theory::counts::binomial;

/// Standard deviations of an interval that holds 99 %.
pub const Z_99: f64 = 2.575_829_303_548_9;

/// Adds `amount` to a count.
pub fn add(tally: &mut Tally, name: &str, what: &str, amount: u64) {
    let sum = tally.entry(format!("{name} {what}")).or_default();
    *sum = sum.saturating_add(amount);
}

/// Adds one value of `name`: how many there are, their sum and that of their
/// squares. A sum that does not fit stays at 2^64 - 1, and no other seed adds to
/// it: [`super::Part::add`] is an error then.
pub fn add_value(tally: &mut Tally, name: &str, value: i64) {
    let size = value.unsigned_abs();
    let side = if value < 0 { "below 0" } else { "above 0" };
    add(tally, name, "values", 1);
    add(tally, name, side, size);
    add(tally, name, "squares", size.saturating_pow(2));
}

/// Adds one error of `name`, whose root mean square is asked for: a value, and
/// its fourth power. 16 million errors of up to 1,000 fit.
pub fn add_error(tally: &mut Tally, name: &str, error: i64) {
    add_value(tally, name, error);
    let fourth = error.unsigned_abs().saturating_pow(4);
    add(tally, name, "fourths", fourth);
}

/// A number with the 99 % interval it lies in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// The best estimate.
    pub value: f64,
    /// From where to where.
    pub interval: (f64, f64),
}

/// The mean of `values` whole numbers of this `sum` and sum of `squares`, and half
/// the width of its 99 % interval by the central limit theorem.
fn mean_and_half(values: u128, sum: i128, squares: u128) -> (f64, f64) {
    // values² times the variance; never below 0 (Cauchy and Schwarz).
    let spread = (values * squares).saturating_sub(sum.unsigned_abs().pow(2));
    let count = values as f64;
    let variance = spread as f64 / count / count;
    let half = Z_99 * (variance / (count - 1.0).max(1.0)).sqrt();
    (sum as f64 / count, half)
}

impl Measured {
    /// The share of `successes` in `trials`, with the interval (Clopper and Pearson's, never
    /// less sure than 99 %) in which the probability lies.
    #[must_use]
    pub fn share(successes: u64, trials: u64) -> Self {
        Self {
            value: successes as f64 / trials as f64,
            interval: binomial::interval(successes, trials, 0.005),
        }
    }

    /// Whether the interval holds `value`.
    #[must_use]
    pub fn holds(&self, value: f64) -> bool {
        (self.interval.0..=self.interval.1).contains(&value)
    }

    /// A point of a chart, above `x`.
    #[must_use]
    pub const fn at(&self, x: f64) -> chart::Point {
        chart::Point {
            x,
            y: self.value,
            interval: Some(self.interval),
        }
    }

    /// With `digits` after the point, and from where to where: three cells of a CSV table.
    #[must_use]
    pub fn cells(&self, digits: usize) -> String {
        let (low, high) = self.interval;
        format!("{:.digits$},{low:.digits$},{high:.digits$}", self.value)
    }

    /// The mean of the values of `name`, by the central limit theorem. NaN
    /// without a value.
    #[must_use]
    pub fn mean(point: &PointTally, name: &str) -> Self {
        let count = |what: &str| point.count(&format!("{name} {what}"));
        let sum = i128::from(count("above 0")) - i128::from(count("below 0"));
        let (value, half) = mean_and_half(count("values").into(), sum, count("squares").into());
        Self {
            value,
            interval: (value - half, value + half),
        }
    }

    /// The root mean square of the errors of `name`. NaN without an error.
    #[must_use]
    pub fn root_mean_square(point: &PointTally, name: &str) -> Self {
        let sum = |what: &str| u128::from(point.count(&format!("{name} {what}")));
        Self::root_of_squares(sum("values"), sum("squares"), sum("fourths"))
    }

    /// The root mean square of `values` errors whose `squares` and `fourths` powers
    /// add up to these, below 2^64 each, by the central limit theorem for the
    /// squares. NaN without an error.
    #[must_use]
    pub fn root_of_squares(values: u128, squares: u128, fourths: u128) -> Self {
        let sum = i128::try_from(squares).unwrap_or(i128::MAX);
        let (square, half) = mean_and_half(values, sum, fourths);
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
