//! Line charts as SVG documents: what was measured as dots with the interval it
//! lies in, what was worked out as lines.

mod legend;

use anyhow::{Result, ensure};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;

use self::legend::Legend;
use crate::picture::one_line;

/// Of the picture above the legend.
const SIZE: (u32, u32) = (760, 480);
/// Told apart by people who see colours differently, too: those of Okabe and Ito.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0x56, 0xb4, 0xe9),
    RGBColor(0x00, 0x00, 0x00),
];
const FONT: (&str, u32) = ("sans-serif", 15);

/// A chart.
#[derive(Clone, Debug)]
pub struct Chart<'a> {
    /// Drawn above it.
    pub title: &'a str,
    /// What runs to the right.
    pub x: Axis<'a>,
    /// What runs upwards.
    pub y: Axis<'a>,
    /// What is drawn, in this order.
    pub series: Vec<Series>,
}

/// An axis.
#[derive(Clone, Copy, Debug)]
pub struct Axis<'a> {
    /// What it is, with its unit.
    pub label: &'a str,
    /// Whether equal steps are equal factors.
    pub logarithmic: bool,
    /// From where to where; by the points where not given.
    pub range: Option<(f64, f64)>,
}

impl<'a> Axis<'a> {
    /// Equal steps are equal distances, all points fit.
    #[must_use]
    pub const fn linear(label: &'a str) -> Self {
        Self {
            label,
            logarithmic: false,
            range: None,
        }
    }

    /// From 0 to 1.
    #[must_use]
    pub const fn share(label: &'a str) -> Self {
        Self {
            range: Some((0.0, 1.0)),
            ..Self::linear(label)
        }
    }

    /// Equal factors are equal distances, all points fit.
    #[must_use]
    pub const fn logarithmic(label: &'a str) -> Self {
        Self {
            logarithmic: true,
            ..Self::linear(label)
        }
    }
}

/// Points that belong together.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its name in the legend; none for one that continues the one before.
    pub name: Option<String>,
    /// Which of seven colours, counted from 0; then from the first again.
    pub colour: usize,
    /// How it is drawn.
    pub style: Style,
    /// In order of x.
    pub points: Vec<Point>,
}

impl Series {
    fn colour(&self) -> RGBAColor {
        COLOURS[self.colour % COLOURS.len()].to_rgba()
    }
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Worked out: a line.
    Line,
    /// Worked out, of less weight: a thin line.
    Thin,
    /// Measured: dots with their intervals.
    Dots,
    /// Measured: dots with their intervals, joined.
    JoinedDots,
}

impl Style {
    /// In pixels, where there is a line.
    const fn line_width(self) -> Option<u32> {
        match self {
            Self::Line => Some(2),
            Self::Thin | Self::JoinedDots => Some(1),
            Self::Dots => None,
        }
    }

    const fn has_dots(self) -> bool {
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
}

/// The range of an axis whose points lie at `values`.
fn range(axis: &Axis, values: impl Iterator<Item = f64> + Clone) -> Result<(f64, f64)> {
    if let Some(range) = axis.range {
        return Ok(range);
    }
    let drawn = values.filter(|&value| value.is_finite() && (value > 0.0 || !axis.logarithmic));
    let low = drawn.clone().fold(f64::INFINITY, f64::min);
    let high = drawn.fold(f64::NEG_INFINITY, f64::max);
    ensure!(low <= high, "{}: nothing to draw", axis.label);
    Ok(match (axis.logarithmic, low < high) {
        (true, _) => (low / 1.2, high * 1.2),
        (false, true) => (low.min(0.0), high + (high - low) * 0.05),
        (false, false) => (low - 1.0, high + 1.0),
    })
}

/// Draws `chart` as a complete SVG document. The same chart always gives the same
/// bytes. What lies outside a given range is not drawn, nor is what a logarithmic
/// axis has no place for.
///
/// # Errors
/// If there is no point to draw.
pub fn line_chart(chart: &Chart) -> Result<String> {
    let points = chart.series.iter().flat_map(|series| &series.points);
    let heights = points.clone().flat_map(|point| {
        let (low, high) = point.interval.unwrap_or((point.y, point.y));
        [point.y, low, high]
    });
    let (left, right) = range(&chart.x, points.map(|point| point.x))?;
    let (low, high) = range(&chart.y, heights)?;
    let legend = Legend::of(&chart.series);
    let mut svg = String::new();
    {
        let size = (SIZE.0, SIZE.1 + legend.height());
        let whole = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        whole.fill(&WHITE)?;
        let (area, below) = whole.split_vertically(SIZE.1);
        match (chart.x.logarithmic, chart.y.logarithmic) {
            (false, false) => draw(&area, chart, left..right, low..high, low)?,
            (false, true) => draw(&area, chart, left..right, (low..high).log_scale(), low)?,
            (true, false) => draw(&area, chart, (left..right).log_scale(), low..high, low)?,
            (true, true) => draw(
                &area,
                chart,
                (left..right).log_scale(),
                (low..high).log_scale(),
                low,
            )?,
        }
        legend.draw(&below)?;
        whole.present()?;
    }
    Ok(svg)
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// `bottom` is where `y` starts.
fn draw<X, Y>(area: &Area, chart: &Chart, x: X, y: Y, bottom: f64) -> Result<()>
where
    X: AsRangedCoord<Value = f64>,
    X::CoordDescType: ValueFormatter<f64>,
    Y: AsRangedCoord<Value = f64>,
    Y::CoordDescType: ValueFormatter<f64>,
{
    let mut context = ChartBuilder::on(area)
        .caption(one_line(chart.title), ("sans-serif", 19))
        .margin(12)
        .x_label_area_size(46)
        .y_label_area_size(72)
        .build_cartesian_2d(x, y)?;
    context
        .configure_mesh()
        .x_desc(one_line(chart.x.label))
        .y_desc(one_line(chart.y.label))
        .x_label_formatter(&number)
        .y_label_formatter(&number)
        .label_style(FONT)
        .axis_desc_style(FONT)
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12))
        .draw()?;
    for series in &chart.series {
        let colour = series.colour();
        let points = || series.points.iter().filter(|point| is_drawn(chart, point));
        let at = |point: &Point| (point.x, point.y);
        if let Some(width) = series.style.line_width() {
            let line = LineSeries::new(points().map(at), colour.stroke_width(width));
            context.draw_series(line)?;
        }
        if series.style.has_dots() {
            context.draw_series(points().filter_map(|point| {
                let (low, high) = point.interval?;
                let ends = [low, high].map(|end| (point.x, clamped(&chart.y, end)));
                Some(PathElement::new(ends, colour))
            }))?;
            let limits = || series.points.iter().filter_map(|point| limit(chart, point));
            context.draw_series(limits().map(|limit| {
                let ends = [(limit.x, bottom), (limit.x, limit.y)];
                PathElement::new(ends, colour)
            }))?;
            context.draw_series(limits().map(|limit| Circle::new(at(&limit), 3, colour)))?;
            context
                .draw_series(points().map(|point| Circle::new(at(point), 3, colour.filled())))?;
        }
    }
    Ok(())
}

/// Whether the axes have a place for it.
fn is_drawn(chart: &Chart, point: &Point) -> bool {
    let fits = |axis: &Axis, value: f64| {
        value.is_finite()
            && (value > 0.0 || !axis.logarithmic)
            && axis
                .range
                .is_none_or(|(low, high)| (low..=high).contains(&value))
    };
    fits(&chart.x, point.x) && fits(&chart.y, point.y)
}

/// Where an axis without a place for 0 shows what is no more than the end of its interval.
fn limit(chart: &Chart, point: &Point) -> Option<Point> {
    let end = Point::exact(point.x, point.interval?.1);
    (chart.y.logarithmic && point.y == 0.0 && is_drawn(chart, &end)).then_some(end)
}

/// The end of an interval, drawn to the edge if it lies beyond.
fn clamped(axis: &Axis, end: f64) -> f64 {
    match axis.range {
        Some((low, high)) => end.clamp(low, high),
        None if axis.logarithmic => end.max(f64::MIN_POSITIVE),
        None => end,
    }
}

/// A number at an axis: no more digits than it takes.
fn number(value: &f64) -> String {
    // A grid of tenths is not exact.
    let rounded = (value * 1e9).round() / 1e9;
    if rounded != 0.0 && rounded.abs() < 1e-3 {
        return format!("{value:.0e}");
    }
    rounded.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(logarithmic: bool, points: Vec<Point>) -> Chart<'static> {
        let axis = |label| Axis {
            label,
            logarithmic,
            range: None,
        };
        Chart {
            title: "A <title> & more",
            x: axis("x"),
            y: axis("y"),
            series: vec![Series {
                name: Some("series".to_owned()),
                colour: 0,
                style: Style::JoinedDots,
                points,
            }],
        }
    }

    fn dots(svg: &str) -> usize {
        // One is the legend's.
        svg.matches("<circle").count() - 1
    }

    #[test]
    fn every_point_with_a_place_is_a_dot() {
        let points: Vec<Point> = [-1.0, 0.0, 1.0, 10.0, f64::NAN]
            .map(|value| Point::exact(value, value))
            .to_vec();
        let linear = line_chart(&chart(false, points.clone())).unwrap();
        let logarithmic = line_chart(&chart(true, points.clone())).unwrap();
        assert_eq!((dots(&linear), dots(&logarithmic)), (4, 2));
        assert!(linear.contains("A &lt;title&gt; &amp; more"));
        let mut narrow = chart(false, points);
        narrow.x.range = Some((0.5, 20.0));
        assert_eq!(dots(&line_chart(&narrow).unwrap()), 2);
    }

    #[test]
    fn zero_is_an_upper_limit_on_a_logarithmic_axis() {
        let zero = Point {
            interval: Some((0.0, 0.5)),
            ..Point::exact(2.0, 0.0)
        };
        let points = vec![Point::exact(1.0, 0.1), zero, Point::exact(3.0, 1.0)];
        let svg = line_chart(&chart(true, points)).unwrap();
        assert_eq!(dots(&svg), 3);
        let open = |line: &&str| line.starts_with("<circle") && line.contains("fill=\"none\"");
        assert_eq!(svg.lines().filter(open).count(), 1, "{svg}");
    }

    #[test]
    fn nothing_to_draw_is_an_error() {
        assert!(line_chart(&chart(false, vec![])).is_err());
        assert!(line_chart(&chart(true, vec![Point::exact(0.0, 1.0)])).is_err());
    }

    #[test]
    fn numbers_have_no_more_digits_than_they_need() {
        let texts = [0.0, 0.1 + 0.2, 20.0, 1e-4, -0.5].map(|value| number(&value));
        assert_eq!(texts, ["0", "0.3", "20", "1e-4", "-0.5"]);
    }
}
