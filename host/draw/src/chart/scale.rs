//! Maps the values of an axis to positions, and chooses labels that fit.

use anyhow::{Result, ensure};

use super::parts::Axis;

/// The smallest gap between two labels, in units of the picture.
pub(super) const GAP: f64 = 10.0;
/// The most labels of a linear axis.
const MAX_LABELS: usize = 8;

/// A label of an axis and its value.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    pub value: f64,
    pub label: String,
}

/// The range of an axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    pub low: f64,
    pub high: f64,
    pub logarithmic: bool,
    is_percent: bool,
}

impl Scale {
    /// The scale of `axis` for points at `values`.
    pub fn new(axis: &Axis, values: impl Iterator<Item = f64>) -> Result<Self> {
        let logarithmic = axis.logarithmic;
        let of = |(low, high)| Self {
            low,
            high,
            logarithmic,
            is_percent: axis.is_percent,
        };
        let drawn = values.filter(|&value| value.is_finite() && (value > 0.0 || !logarithmic));
        let (low, high) = drawn.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (value.min(low), value.max(high))
        });
        ensure!(low <= high, "{}: nothing to draw", axis.label);
        if let Some(range) = axis.range {
            return Ok(of(range));
        }
        Ok(of(match (logarithmic, low.min(0.0) < high.max(0.0)) {
            (true, _) => (low / 1.25, high * 1.25),
            (false, true) => {
                let (low, high) = (low.min(0.0), high.max(0.0));
                (low, high + (high - low) * 0.06)
            }
            (false, false) => (0.0, 1.0),
        }))
    }

    /// Whether `value` lies on the axis.
    pub fn contains(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value) && (value > 0.0 || !self.logarithmic)
    }

    /// The nearest value on the axis.
    pub fn clamp(&self, value: f64) -> f64 {
        value.clamp(self.low, self.high)
    }

    /// The position of `value`: 0 at the low end, 1 at the high end.
    pub fn position(&self, value: f64) -> f64 {
        let of = |value: f64| {
            if self.logarithmic {
                value.log10()
            } else {
                value
            }
        };
        (of(value) - of(self.low)) / (of(self.high) - of(self.low))
    }

    /// As many labels as fit on an axis of `length`. `size` is the size of a label along the axis.
    /// A label that extends beyond the low or the high end by more than `room` is left out.
    pub fn ticks(&self, length: f64, room: (f64, f64), size: impl Fn(&str) -> f64) -> Vec<Tick> {
        let mut candidates = if self.logarithmic {
            self.factors()
        } else {
            self.steps()
        };
        let span = |tick: &Tick| {
            let (middle, half) = (length * self.position(tick.value), size(&tick.label) / 2.0);
            (middle - half, middle + half)
        };
        for ticks in &mut candidates {
            ticks.retain(|tick| {
                let (start, end) = span(tick);
                start >= -room.0 && end <= length + room.1
            });
        }
        candidates.retain(|ticks| !ticks.is_empty());
        let fits = |ticks: &Vec<Tick>| {
            let spans: Vec<(f64, f64)> = ticks.iter().map(span).collect();
            spans.windows(2).all(|pair| pair[0].1 + GAP <= pair[1].0)
        };
        let several = candidates
            .iter()
            .find(|ticks| ticks.len() > 1 && fits(ticks));
        let found = several.or_else(|| candidates.iter().find(|ticks| fits(ticks)));
        // A single label always fits.
        let single = || candidates.last().map(|ticks| ticks[..1].to_vec());
        found.cloned().or_else(single).unwrap_or_default()
    }

    /// Candidate labels of a linear axis, the densest first.
    fn steps(&self) -> Vec<Vec<Tick>> {
        let span = self.high - self.low;
        let least = decade(span) - 1;
        let mut candidates = Vec::new();
        for power in least..=least + 2 {
            for factor in [1.0, 2.0, 5.0] {
                let ticks = self.multiples(factor * 10f64.powi(power));
                if ticks.len() <= MAX_LABELS {
                    candidates.push(ticks);
                }
            }
        }
        candidates
    }

    /// The multiples of `step` on the axis, at most 200.
    fn multiples(&self, step: f64) -> Vec<Tick> {
        let first = (self.low / step - 1e-9).ceil();
        let numbers = (0..200).map(|index| first + f64::from(index));
        let values = numbers.map(|number| number * step);
        let values = values.take_while(|value| *value <= self.high + step * 1e-9);
        values.map(|value| self.tick(value)).collect()
    }

    /// Candidate labels of a logarithmic axis, the densest first: 1, 2 and 5 of each decade, each
    /// decade, every second decade, and so on. Less than a decade has finer labels first.
    fn factors(&self) -> Vec<Vec<Tick>> {
        let (first, last) = (decade(self.low), decade(self.high));
        let of = |factors: &[f64], every: i32| {
            let powers = (first..=last).filter(|power| power.rem_euclid(every) == 0);
            let values = powers.flat_map(|power| {
                let factors = factors.iter();
                factors.map(move |factor| factor * 10f64.powi(power))
            });
            let values = values.filter(|&value| self.contains(value));
            values.map(|value| self.tick(value)).collect::<Vec<_>>()
        };
        let mut candidates = Vec::new();
        if self.high < 10.0 * self.low {
            candidates.push(of(&[1.0, 1.2, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0], 1));
            candidates.push(of(&[1.0, 1.5, 2.0, 3.0, 5.0, 7.0], 1));
            candidates.push(of(&[1.0, 2.0, 3.0, 5.0], 1));
            // A very small range may contain none of these.
            candidates.retain(|ticks| ticks.len() > 1);
            candidates.extend(self.steps());
        }
        candidates.push(of(&[1.0, 2.0, 5.0], 1));
        candidates.extend((1..=20).map(|every| of(&[1.0], every)));
        candidates
    }

    fn tick(&self, value: f64) -> Tick {
        let label = number(if self.is_percent {
            value * 100.0
        } else {
            value
        });
        Tick { value, label }
    }
}

/// The power of ten at or below `value`.
#[allow(clippy::cast_possible_truncation, reason = "-324 to 308")]
fn decade(value: f64) -> i32 {
    (value.log10() + 1e-9).floor() as i32
}

/// The label of a number: the fewest digits, with a comma before thousands.
pub(super) fn number(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e6).contains(&value.abs()) {
        let power = decade(value.abs());
        let factor = value / 10f64.powi(power);
        let exponent: String = power.to_string().chars().map(superscript).collect();
        let factor = (factor * 1e6).round() / 1e6;
        return match factor {
            1.0 => format!("10{exponent}"),
            _ => format!("{factor}·10{exponent}"),
        };
    }
    // Multiples of a tenth are not exact.
    let rounded = (value * 1e9).round() / 1e9 + 0.0;
    let text = rounded.to_string();
    let (whole, rest) = text.split_at(text.find('.').unwrap_or(text.len()));
    let digits = whole.trim_start_matches('-').len();
    if digits < 5 {
        return text.replace('-', "−");
    }
    let (head, tail) = whole.split_at(whole.len() - 3);
    format!("{head},{tail}{rest}").replace('-', "−")
}

/// A digit, or the minus sign, of an exponent in superscript.
fn superscript(c: char) -> char {
    let digit = c.to_digit(10).map(|digit| digit as usize);
    let superscript = digit.and_then(|digit| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(digit));
    superscript.unwrap_or('⁻')
}
