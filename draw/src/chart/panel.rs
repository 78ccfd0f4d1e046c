//! The contents of a plot: lines, intervals, dots and names.

use super::names::{Area, Label, beside, spread};
use super::parts::{Panel, Point, Series, Style};
use super::scale::Scale;
use crate::palette::Mark;
use crate::svg::{Anchor, At, Svg, TEXT, text_width, wrapped};

/// The height of a line.
pub(super) const LINE: f64 = 18.0;
/// Gap between a plot and its names.
const TO_NAME: f64 = 16.0;
/// Gap between two names.
const NAME_GAP: f64 = 3.0;
/// A curve that ends beyond this share of the axis has its name beside the plot.
const RIGHT: f64 = 0.9;
/// A name within the plot is wrapped at this width.
const INNER_NAME_WIDTH: f64 = 150.0;
/// Names avoid a line by boxes of this size along it.
const GRAIN: f64 = 6.0;

/// The space for the names beside a column of plots.
#[derive(Clone, Copy, Debug)]
pub(super) struct Names {
    /// Their width in the picture.
    pub width: f64,
    /// Names are wrapped at this width.
    max_width: f64,
}

impl Names {
    /// For the names of curves that end at the right end of `x`.
    pub fn new<'a>(series: impl Iterator<Item = &'a Series>, x: &Scale, max_width: f64) -> Self {
        let is_right = |series: &&Series| {
            let mut ends = series.points.iter().rev();
            let end = ends.find(|point| x.contains(point.x));
            end.is_some_and(|end| x.position(end.x) > RIGHT)
        };
        let names = series.filter(is_right);
        let names = names.filter_map(|series| series.name.as_deref());
        let lines = names.flat_map(|name| wrapped(name, TEXT, max_width));
        let widest = lines
            .map(|line| text_width(&line, TEXT))
            .fold(0.0, f64::max);
        Self {
            width: if widest > 0.0 { widest + TO_NAME } else { 0.0 },
            max_width,
        }
    }
}

/// Draws a line through `points`.
pub(super) fn line(svg: &mut Svg, style: Style, points: &[(f64, f64)]) {
    let pen = match style {
        Style::Line => "stroke-width=\"2.4\"",
        Style::Dashed => "stroke-width=\"1.7\" stroke-dasharray=\"6 4\"",
        Style::JoinedDots => "stroke-width=\"1.5\"",
        Style::Dots => return,
    };
    let points = points.iter().map(|&(x, y)| format!("{},{}", At(x), At(y)));
    let points = points.collect::<Vec<_>>().join(" ");
    svg.raw(&format!(
        "<polyline class=\"stroke\" {pen} points=\"{points}\"/>"
    ));
}

/// Draws an interval from `low` to `high`.
pub(super) fn interval(svg: &mut Svg, low: (f64, f64), high: (f64, f64)) {
    let [x, left, right] = [low.0, low.0 - 3.0, low.0 + 3.0].map(At);
    let (low, high) = (At(low.1), At(high.1));
    svg.raw(&format!(
        "<path class=\"stroke\" stroke-width=\"1.3\" d=\"M{x} {low}V{high}M{left} {low}H{right}M{left} {high}H{right}\"/>"
    ));
}

/// Draws a dot, filled or open.
pub(super) fn dot(svg: &mut Svg, mark: Mark, (x, y): (f64, f64), radius: f64, is_filled: bool) {
    let class = if is_filled { "fill" } else { "open" };
    let path = |places: &[(f64, f64)]| {
        let place = |&(across, down): &(f64, f64)| {
            format!("{} {}", At(x + across * radius), At(y + down * radius))
        };
        let places: Vec<String> = places.iter().map(place).collect();
        format!("<path class=\"{class}\" d=\"M{}z\"/>", places.join("L"))
    };
    let element = match mark {
        Mark::Circle => {
            let [x, y, radius] = [x, y, radius].map(At);
            format!("<circle class=\"{class}\" cx=\"{x}\" cy=\"{y}\" r=\"{radius}\"/>")
        }
        Mark::Square => path(&[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)]),
        Mark::Diamond => path(&[(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)]),
        Mark::Up => path(&[(0.0, -1.2), (1.2, 0.9), (-1.2, 0.9)]),
        Mark::Down => path(&[(0.0, 1.2), (1.2, -0.9), (-1.2, -0.9)]),
        Mark::Cross => {
            let [left, right, top, bottom] =
                [x - radius, x + radius, y - radius, y + radius].map(At);
            format!(
                "<path class=\"stroke\" stroke-width=\"2.2\" d=\"M{left} {top}L{right} {bottom}M{left} {bottom}L{right} {top}\"/>"
            )
        }
    };
    svg.raw(&element);
}

/// Draws a panel into its plot.
pub(super) fn draw(
    svg: &mut Svg,
    panel: &Panel,
    (x, y): (&Scale, &Scale),
    area: &Area,
    names: &Names,
) {
    let place = |at: f64, height: f64| {
        (
            area.left + (area.right - area.left) * x.position(at),
            area.bottom - (area.bottom - area.top) * y.position(height),
        )
    };
    let shown = |point: &Point| x.contains(point.x) && y.contains(point.y);
    let most = panel.series.iter().map(|series| series.points.len()).max();
    let radius = if most.unwrap_or(0) > 12 { 2.8 } else { 4.2 };
    let mut taken = Vec::new();
    for series in &panel.series {
        svg.raw(&format!("<g class=\"{}\">", series.pen.colour.class()));
        if series.style.has_line() {
            for part in series.points.chunk_by(|a, b| shown(a) == shown(b)) {
                let places = part.iter().filter(|point| shown(point));
                let places: Vec<_> = places.map(|point| place(point.x, point.y)).collect();
                if places.len() > 1 {
                    line(svg, series.style, &places);
                    taken.extend(
                        places
                            .windows(2)
                            .flat_map(|ends| boxes_along(ends[0], ends[1])),
                    );
                }
            }
        }
        let dots = series.points.iter().filter(|_| series.style.has_dots());
        for point in dots {
            let ends = point.interval.filter(|_| x.contains(point.x));
            let ends = ends.map(|(low, high)| (y.clamp(low), y.clamp(high)));
            if shown(point) {
                if let Some((low, high)) = ends {
                    let ends = (place(point.x, low), place(point.x, high));
                    interval(svg, ends.0, ends.1);
                    taken.push(Area::around(ends.0, ends.1, 3.0));
                }
                let at = place(point.x, point.y);
                dot(svg, series.pen.mark, at, radius, true);
                taken.push(Area::around(at, at, radius + 2.0));
            } else if let Some((_, high)) = ends.filter(|_| y.logarithmic && point.y <= 0.0) {
                let (foot, at) = (place(point.x, y.low), place(point.x, high));
                interval(svg, foot, at);
                dot(svg, series.pen.mark, at, radius, false);
            }
        }
        svg.raw("</g>");
    }
    let ends = panel.series.iter().filter_map(|series| {
        let limit = |point: &Point| Some(Point::exact(point.x, point.interval?.1));
        let mut ends = series.points.iter().rev().filter_map(|point| {
            let limit = limit(point).filter(|_| y.logarithmic && point.y <= 0.0);
            limit.or(Some(*point)).filter(|end| shown(end))
        });
        let end = ends.next()?;
        let is_right = x.position(end.x) > RIGHT;
        let name = Name {
            class: format!("{} halo", series.pen.colour.class()),
            text: series.name.as_deref()?,
            end: place(end.x, end.y),
        };
        Some((name, is_right))
    });
    let (right, within): (Vec<_>, Vec<_>) = ends.partition(|(_, is_right)| *is_right);
    let right: Vec<Name> = right.into_iter().map(|(name, _)| name).collect();
    names_beside_the_plot(svg, &right, area, names);
    let bounds = Area {
        top: area.top - LINE,
        right: area.right + 8.0,
        ..*area
    };
    for (name, _) in within {
        let lines = wrapped(name.text, TEXT, INNER_NAME_WIDTH);
        let widths = lines.iter().map(|line| text_width(line, TEXT));
        let size = (widths.fold(0.0, f64::max), LINE * lines.len() as f64);
        let (left, top) = beside(name.end, size, &bounds, &taken);
        taken.push(Area::around(
            (left, top),
            (left + size.0, top + size.1),
            2.0,
        ));
        let (x, anchor) = if left + size.0 < name.end.0 {
            (left + size.0, Anchor::End)
        } else {
            (left, Anchor::Start)
        };
        svg.lines(&name.class, (x, top), (TEXT, LINE), anchor, &lines);
    }
}

/// A name, and where its curve ends.
struct Name<'a> {
    class: String,
    text: &'a str,
    end: (f64, f64),
}

/// Boxes along a line.
fn boxes_along(from: (f64, f64), to: (f64, f64)) -> impl Iterator<Item = Area> {
    let steps = ((to.0 - from.0).hypot(to.1 - from.1) / GRAIN)
        .ceil()
        .max(1.0);
    let places = (0..1000)
        .map(f64::from)
        .take_while(move |step| *step <= steps);
    places.map(move |step| {
        let part = step / steps;
        let at = (
            from.0 + (to.0 - from.0) * part,
            from.1 + (to.1 - from.1) * part,
        );
        Area::around(at, at, GRAIN / 2.0)
    })
}

/// Draws each name, with a line to the end of its curve if that is not close.
fn names_beside_the_plot(svg: &mut Svg, ends: &[Name], area: &Area, names: &Names) {
    let texts = ends
        .iter()
        .map(|name| wrapped(name.text, TEXT, names.max_width));
    let texts: Vec<Vec<String>> = texts.collect();
    let labels = ends.iter().zip(&texts).map(|(name, lines)| Label {
        y: name.end.1,
        height: LINE * lines.len() as f64 - 2.0 + NAME_GAP,
    });
    let labels: Vec<Label> = labels.collect();
    let places = spread(&labels, area.top - LINE / 2.0, area.bottom + LINE / 2.0);
    for ((name, lines), middle) in ends.iter().zip(&texts).zip(places) {
        let (x, class) = (area.right + TO_NAME, &name.class);
        if (middle - name.end.1).abs() > 3.0 {
            let [x1, y1, x2, y2] = [name.end.0 + 7.0, name.end.1, x - 3.0, middle].map(At);
            svg.raw(&format!(
                "<g class=\"{class}\"><path class=\"stroke\" stroke-width=\"1\" d=\"M{x1} {y1}L{x2} {y2}\"/></g>"
            ));
        }
        let top = middle - LINE * lines.len() as f64 / 2.0;
        svg.lines(class, (x, top), (TEXT, LINE), Anchor::Start, lines);
    }
}
