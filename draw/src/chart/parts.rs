//! What a chart is made of.

use crate::palette::{NEUTRAL, Pen};

/// A chart.
#[derive(Clone, Debug)]
pub struct Chart {
    /// What it shows: a sentence without its full stop.
    pub finding: String,
    /// Whether the data show it.
    pub holds: bool,
    /// What dots, lines and intervals are; drawn below it.
    pub note: String,
    /// What runs to the right.
    pub x: Axis,
    /// What runs upwards.
    pub y: Axis,
    /// What kinds of dots and lines mean, the same for every curve; drawn above it.
    pub key: Vec<Key>,
    /// Panels beside each other.
    pub columns: usize,
    /// At least one, row by row.
    pub panels: Vec<Panel>,
}

impl Chart {
    /// What stands above it: never what its points do not show.
    #[must_use]
    pub fn title(&self) -> String {
        if self.holds {
            self.finding.clone()
        } else {
            format!("These data do not show: {}", self.finding)
        }
    }
}

/// A kind of dots or lines.
#[derive(Clone, Debug)]
pub struct Key {
    /// Its colour and mark.
    pub pen: Pen,
    /// How it is drawn.
    pub style: Style,
    /// What it is.
    pub text: String,
}

impl Key {
    /// What dots or lines of this look are.
    #[must_use]
    pub fn new(pen: Pen, style: Style, text: impl Into<String>) -> Self {
        Self {
            pen,
            style,
            text: text.into(),
        }
    }

    /// Simulated, exact and as printed.
    #[must_use]
    pub fn simulated(printed: &str) -> Vec<Self> {
        vec![
            Self::new(NEUTRAL, Style::Dots, "simulated"),
            Self::new(NEUTRAL, Style::Line, "exact"),
            Self::new(NEUTRAL, Style::Dashed, printed),
        ]
    }
}

/// A part of a chart with axes of its own, the same as those of the others.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Drawn above it; empty for the only one.
    pub title: String,
    /// What is drawn, in this order.
    pub series: Vec<Series>,
}

impl Panel {
    /// The only one.
    #[must_use]
    pub const fn only(series: Vec<Series>) -> Self {
        Self {
            title: String::new(),
            series,
        }
    }
}

/// An axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// What it is, with its unit.
    pub label: String,
    /// Whether its numbers are shares, written as hundredths.
    pub is_percent: bool,
    /// Whether equal steps are equal factors.
    pub logarithmic: bool,
    /// From where to where; by the points where not given. A linear one has 0 then.
    pub range: Option<(f64, f64)>,
}

impl Axis {
    /// Equal steps are equal distances, from 0 to the last point.
    #[must_use]
    pub fn linear(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            is_percent: false,
            logarithmic: false,
            range: None,
        }
    }

    /// Equal factors are equal distances, all points fit.
    #[must_use]
    pub fn logarithmic(label: impl Into<String>) -> Self {
        Self {
            logarithmic: true,
            ..Self::linear(label)
        }
    }

    /// Its numbers are shares.
    #[must_use]
    pub const fn percent(mut self) -> Self {
        self.is_percent = true;
        self
    }

    /// From `low` to `high`.
    #[must_use]
    pub const fn within(mut self, low: f64, high: f64) -> Self {
        self.range = Some((low, high));
        self
    }
}

/// Points that belong together.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its name, at the end of its curve or beside its only dot.
    pub name: Option<String>,
    /// Its colour and mark.
    pub pen: Pen,
    /// How it is drawn.
    pub style: Style,
    /// In order of x.
    pub points: Vec<Point>,
}

impl Series {
    /// One with a name.
    #[must_use]
    pub fn named(name: impl Into<String>, pen: Pen, style: Style, points: Vec<Point>) -> Self {
        Self {
            name: Some(name.into()),
            pen,
            style,
            points,
        }
    }

    /// One that goes with another, which has the name.
    #[must_use]
    pub const fn unnamed(pen: Pen, style: Style, points: Vec<Point>) -> Self {
        Self {
            name: None,
            pen,
            style,
            points,
        }
    }
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Worked out: a line.
    Line,
    /// Worked out, of less weight: a dashed line.
    Dashed,
    /// Measured: dots with their intervals.
    Dots,
    /// Measured: dots with their intervals, joined.
    JoinedDots,
}

impl Style {
    pub(super) const fn has_line(self) -> bool {
        !matches!(self, Self::Dots)
    }

    pub(super) const fn has_dots(self) -> bool {
        matches!(self, Self::Dots | Self::JoinedDots)
    }
}

/// A point, with an interval if it was measured. One of 0 on a logarithmic axis is drawn
/// as an upper limit: an open dot at the end of its interval, with a line down.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// To the right.
    pub x: f64,
    /// Upwards.
    pub y: f64,
    /// The interval it lies in.
    pub interval: Option<(f64, f64)>,
}

impl Point {
    /// Worked out.
    #[must_use]
    pub const fn exact(x: f64, y: f64) -> Self {
        Self {
            x,
            y,
            interval: None,
        }
    }

    /// A curve, worked out at each of `xs`.
    pub fn curve(xs: impl IntoIterator<Item = f64>, of: impl Fn(f64) -> f64) -> Vec<Self> {
        let points = xs.into_iter().map(|x| Self::exact(x, of(x)));
        points.collect()
    }

    /// So many steps of a tenth to the right on a logarithmic axis, beside others that
    /// would hide it.
    #[must_use]
    pub fn aside(mut self, steps: f64) -> Self {
        self.x *= 1.1f64.powf(steps);
        self
    }
}
