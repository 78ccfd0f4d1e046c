//! Parts of charts that most studies draw.

use super::mean::Measured;
use super::{Part, PointTally};
use dtof_draw::chart::{Key, Panel, Point, Series, Style};
use dtof_draw::palette::{Pen, REFERENCE};

/// A panel of `series`.
#[must_use]
pub fn panel(title: impl Into<String>, series: impl IntoIterator<Item = Series>) -> Panel {
    Panel {
        title: title.into(),
        series: series.into_iter().collect(),
    }
}

/// Measured points without a name: dots with their intervals, joined.
#[must_use]
pub fn joined(pen: Pen, dots: impl IntoIterator<Item = Point>) -> Series {
    Series::unnamed(pen, Style::JoinedDots, dots.into_iter().collect())
}

/// The entry of the legend for [`joined`] dots.
#[must_use]
pub fn joined_key(pen: Pen, text: impl Into<String>) -> Key {
    Key::new(pen, Style::JoinedDots, text)
}

/// A dashed line at the height `y` from the first of `xs` to the last, to compare with.
#[must_use]
pub fn level(xs: &[f64], y: f64) -> Series {
    let ends = xs.first().into_iter().chain(xs.last());
    let points = ends.map(|&x| Point::exact(x, y)).collect();
    Series::unnamed(REFERENCE, Style::Dashed, points)
}

/// The entry of the legend for a [`level`].
#[must_use]
pub fn level_key(text: impl Into<String>) -> Key {
    Key::new(REFERENCE, Style::Dashed, text)
}

impl Part {
    /// A dot for each point with the parameters `at`: `y` over the parameter `x`.
    pub fn dots<const N: usize>(
        &self,
        at: [(&str, f64); N],
        x: &str,
        y: impl Fn(&PointTally) -> Measured,
    ) -> Vec<Point> {
        let points = self.at(at);
        points
            .map(|point| y(point).at(point.parameter(x)))
            .collect()
    }
}
