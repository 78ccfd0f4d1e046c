//! Maps values to colours, and chooses the marks of the colour bar.

#[cfg(test)]
mod tests;

/// Steps between the ends of the colour map.
const TOP_LEVEL: u8 = u8::MAX;
/// The level of values that are all equal.
const MIDDLE_LEVEL: u8 = TOP_LEVEL / 2;
/// The smallest distance between two marks of the bar, in pixels.
const SPACING: f64 = 36.0;

/// The range of values that the colours span.
#[derive(Debug)]
pub(super) struct Scale {
    low: f64,
    high: f64,
    /// Whether values lie below `low`.
    below: bool,
    /// Whether values lie above `high`.
    above: bool,
    /// Whether all values are whole numbers.
    whole: bool,
}

/// A mark beside the colour bar.
#[derive(Debug, PartialEq)]
pub(super) struct Mark {
    /// Position: 0 at the low end, 1 at the high end.
    pub position: f64,
    pub label: String,
}

/// The lowest and the highest value of the colour range of a map; `None` without values.
#[must_use]
pub fn span(values: &[Option<f64>]) -> Option<(f64, f64)> {
    Scale::new(values).map(|scale| (scale.low, scale.high))
}

/// The colour level of each value, as a map shows it.
#[must_use]
pub fn levels(values: &[Option<f64>]) -> Vec<Option<u8>> {
    let scale = Scale::new(values);
    let level = |value: &Option<f64>| Some(scale.as_ref()?.level(finite(*value)?));
    values.iter().map(level).collect()
}

/// The value of a pixel that has one.
fn finite(value: Option<f64>) -> Option<f64> {
    value.filter(|value| value.is_finite())
}

impl Scale {
    /// The range for `values`, `None` if there are none.
    pub fn new(values: &[Option<f64>]) -> Option<Self> {
        let mut sorted: Vec<_> = values.iter().filter_map(|v| finite(*v)).collect();
        sorted.sort_by(f64::total_cmp);
        let (least, most) = (*sorted.first()?, *sorted.last()?);

        // Indices rounded outwards: a small set loses no value.
        let last = sorted.len() - 1;
        let skip = last * 2 / 100;
        let (mut low, mut high) = (sorted[skip], sorted[last - skip]);
        if low == high {
            (low, high) = (least, most);
        }
        Some(Self {
            low,
            high,
            below: least < low,
            above: high < most,
            whole: sorted.iter().all(|v| v.fract() == 0.0),
        })
    }

    /// The range of the colours, as text.
    pub fn note(&self) -> &'static str {
        if self.low == self.high {
            "all values are equal"
        } else if self.below || self.above {
            "colours: 2nd to 98th percentile"
        } else {
            "colours: lowest to highest value"
        }
    }

    /// The level of `value`, clamped to the ends.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and 255"
    )]
    pub fn level(&self, value: f64) -> u8 {
        if self.low == self.high {
            return MIDDLE_LEVEL;
        }
        let top = f64::from(TOP_LEVEL);
        (self.position(value) * top).round().clamp(0.0, top) as u8
    }

    /// The levels of the bar, from its top to its bottom.
    pub fn bar(&self) -> Vec<Option<u8>> {
        if self.low == self.high {
            return vec![Some(MIDDLE_LEVEL)];
        }
        (0..=TOP_LEVEL).rev().map(Some).collect()
    }

    /// Marks for a bar of `length` pixels: its ends and round values between.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and 12"
    )]
    pub fn marks(&self, length: f64) -> Vec<Mark> {
        let mark = |position, label| Mark { position, label };
        if self.low == self.high {
            let decimals = if self.whole { 0 } else { 3 };
            return vec![mark(0.5, self.number(self.low, decimals))];
        }

        let step = self.step(length);
        // The ends have one digit more than the step.
        let digits = (1.0 - step.log10().floor()).clamp(0.0, 12.0);
        let decimals = if self.whole { 0 } else { digits as usize };

        let end = |value, sign: Option<&str>| {
            let number = self.number(value, decimals);
            sign.map_or(number.clone(), |sign| format!("{sign} {number}"))
        };
        let mut marks = vec![
            mark(0.0, end(self.low, self.below.then_some("≤"))),
            mark(1.0, end(self.high, self.above.then_some("≥"))),
        ];
        let margin = 0.7 * SPACING / length;
        let first = (self.low / step).ceil();
        for index in 0..=u8::MAX {
            let value = (first + f64::from(index)) * step;
            let position = self.position(value);
            if (margin..=1.0 - margin).contains(&position) {
                marks.push(mark(position, self.number(value, decimals)));
            }
        }
        marks
    }

    /// The position of `value`: 0 at the low end, 1 at the high end.
    fn position(&self, value: f64) -> f64 {
        // Halved, because the difference may overflow.
        (value / 2.0 - self.low / 2.0) / (self.high / 2.0 - self.low / 2.0)
    }

    /// The smallest round step that keeps marks `SPACING` apart on `length`.
    fn step(&self, length: f64) -> f64 {
        let least = (self.high / length - self.low / length) * SPACING;
        let power = 10.0_f64.powf(least.log10().floor());
        let round = [1.0, 2.0, 5.0].map(|factor| factor * power);
        let step = round.into_iter().find(|step| *step >= least);
        let step = step.unwrap_or(10.0 * power);
        if self.whole { step.max(1.0) } else { step }
    }

    /// `value` in a few characters.
    fn number(&self, value: f64, decimals: usize) -> String {
        let largest = self.low.abs().max(self.high.abs());
        if largest != 0.0 && !(1e-3..1e7).contains(&largest) {
            return format!("{value:.2e}");
        }
        let text = format!("{value:.decimals$}");
        match text.strip_prefix('-') {
            Some(zero) if !zero.contains(|c| matches!(c, '1'..='9')) => zero.to_owned(),
            _ => text,
        }
    }
}
