//! The parts of a chart.

use crate::palette::{NEUTRAL, Pen};

/// A chart.
#[derive(Clone, Debug)]
pub struct Chart {
    /// The finding: a sentence without a full stop.
    pub finding: String,
    /// Whether the data support the finding.
    pub holds: bool,
    /// What dots, lines and intervals mean; drawn below the chart.
    pub note: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// The legend for kinds of dots and lines, the same for every curve; drawn above the panels.
    pub key: Vec<Key>,
    /// Panels in a row.
    pub columns: usize,
    /// The panels, at least one, row by row.
    pub panels: Vec<Panel>,
}

impl Chart {
    /// The title: the finding, or that the data do not show it.
    #[must_use]
    pub fn title(&self) -> String {
        if self.holds {
            self.finding.clone()
        } else {
            format!("These data do not show: {}", self.finding)
        }
    }
}

/// An entry of the legend: a kind of dots or lines.
#[derive(Clone, Debug)]
pub struct Key {
    /// Colour and mark.
    pub pen: Pen,
    /// How it is drawn.
    pub style: Style,
    /// Its meaning.
    pub text: String,
}

impl Key {
    /// An entry for dots or lines of this look.
    #[must_use]
    pub fn new(pen: Pen, style: Style, text: impl Into<String>) -> Self {
        Self {
            pen,
            style,
            text: text.into(),
        }
    }

    /// Entries for simulated, exact and printed values.
    #[must_use]
    pub fn simulated(printed: &str) -> Vec<Self> {
        vec![
            Self::new(NEUTRAL, Style::Dots, "simulated"),
            Self::new(NEUTRAL, Style::Line, "exact"),
            Self::new(NEUTRAL, Style::Dashed, printed),
        ]
    }
}

/// A part of a chart. All panels of a chart have the same axes.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Drawn above the panel; empty if there is only one.
    pub title: String,
    /// The series, in drawing order.
    pub series: Vec<Series>,
}

impl Panel {
    /// The only panel of a chart.
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
    /// Quantity and unit.
    pub label: String,
    /// Whether values are shares that are labelled in percent.
    pub is_percent: bool,
    /// Whether the axis is logarithmic.
    pub logarithmic: bool,
    /// Its range. `None` fits all points; a linear axis then includes 0.
    pub range: Option<(f64, f64)>,
}

impl Axis {
    /// A linear axis that includes 0 and fits all points.
    #[must_use]
    pub fn linear(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            is_percent: false,
            logarithmic: false,
            range: None,
        }
    }

    /// A logarithmic axis that fits all points.
    #[must_use]
    pub fn logarithmic(label: impl Into<String>) -> Self {
        Self {
            logarithmic: true,
            ..Self::linear(label)
        }
    }

    /// Labels shares in percent.
    #[must_use]
    pub const fn percent(mut self) -> Self {
        self.is_percent = true;
        self
    }

    /// Limits the range to `low` to `high`.
    #[must_use]
    pub const fn within(mut self, low: f64, high: f64) -> Self {
        self.range = Some((low, high));
        self
    }
}

/// A series of points.
#[derive(Clone, Debug)]
pub struct Series {
    /// The name, drawn at the end of the curve or beside one of its dots; in a legend below the panels if
    /// there is no free place.
    pub name: Option<String>,
    /// Colour and mark.
    pub pen: Pen,
    /// How it is drawn.
    pub style: Style,
    /// The points in order of x.
    pub points: Vec<Point>,
}

impl Series {
    /// A series with a name.
    #[must_use]
    pub fn named(name: impl Into<String>, pen: Pen, style: Style, points: Vec<Point>) -> Self {
        Self {
            name: Some(name.into()),
            pen,
            style,
            points,
        }
    }

    /// A series without a name, which goes with another one.
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
    /// Calculated: a line.
    Line,
    /// Calculated, less important: a dashed line.
    Dashed,
    /// Measured: dots with their intervals.
    Dots,
    /// Measured: dots with their intervals, joined.
    JoinedDots,
    /// A ring around a point that was chosen. Its name stands beside it.
    Ring,
}

impl Style {
    pub(super) const fn has_line(self) -> bool {
        !matches!(self, Self::Dots | Self::Ring)
    }

    pub(super) const fn has_dots(self) -> bool {
        matches!(self, Self::Dots | Self::JoinedDots)
    }
}

/// A point, with an interval if it was measured. A value of 0 on a logarithmic axis is drawn as
/// an upper limit: an open dot at the upper end of the interval, with a line down.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// The horizontal value.
    pub x: f64,
    /// The vertical value.
    pub y: f64,
    /// The confidence interval of `y`.
    pub interval: Option<(f64, f64)>,
}

impl Point {
    /// A calculated point.
    #[must_use]
    pub const fn exact(x: f64, y: f64) -> Self {
        Self {
            x,
            y,
            interval: None,
        }
    }

    /// A curve: `of` at each of `xs`.
    pub fn curve(xs: impl IntoIterator<Item = f64>, of: impl Fn(f64) -> f64) -> Vec<Self> {
        let points = xs.into_iter().map(|x| Self::exact(x, of(x)));
        points.collect()
    }

    /// Moves the point to the right by `steps` tenths on a logarithmic axis, so that points with
    /// the same x do not hide each other.
    #[must_use]
    pub fn aside(mut self, steps: f64) -> Self {
        self.x *= 1.1f64.powf(steps);
        self
    }
}
