//! The contents of a plot: lines, intervals, dots and names.

use super::names::{Area, Label, Line, Place, Spot, Taken, beside, spread};
use super::parts::{Key, Panel, Point, Series, Style};
use super::scale::Scale;
use crate::svg::{Anchor, At, Svg, TEXT, text_width, wrapped};

/// The height of a line.
pub(super) const LINE: f64 = 18.0;
/// Gap between a plot and its names.
pub(super) const TO_NAME: f64 = 16.0;
/// Gap between two names.
const NAME_GAP: f64 = 3.0;
/// A curve that ends beyond this share of the axis has its name beside the plot.
const RIGHT: f64 = 0.9;
/// A name within the plot is wrapped at the first of these widths at which there is a place for it.
const INNER_NAME_WIDTHS: [f64; 2] = [150.0, 90.0];
/// Radius of a ring.
pub(super) const RING: f64 = 7.0;

/// The space for the names beside a column of plots.
#[derive(Clone, Copy, Debug)]
pub(super) struct Names {
    /// Their width in the picture.
    pub width: f64,
    /// The height of those of a panel that has most.
    pub height: f64,
    /// Names are wrapped at this width.
    max_width: f64,
}

impl Names {
    /// For the names of curves that end at the right end of `x`.
    pub fn new<'a>(panels: impl Iterator<Item = &'a Panel>, x: &Scale, max_width: f64) -> Self {
        let mut names = Self {
            width: 0.0,
            height: 0.0,
            max_width,
        };
        for panel in panels {
            let mut height = 0.0;
            for series in &panel.series {
                let mut ends = series.points.iter().rev();
                let end = ends.find(|point| x.contains(point.x));
                let is_right = end.is_some_and(|end| x.position(end.x) > RIGHT);
                let name = series.name.as_ref();
                let name = name.filter(|_| is_right && series.style != Style::Ring);
                let Some(name) = name else { continue };
                let lines = wrapped(name, TEXT, max_width);
                let widths = lines.iter().map(|line| text_width(line, TEXT) + TO_NAME);
                names.width = widths.fold(names.width, f64::max);
                height += height_of(&lines);
            }
            names.height = names.height.max(height);
        }
        names
    }
}

/// The height of a name beside the plot.
fn height_of(lines: &[String]) -> f64 {
    LINE * lines.len() as f64 - 2.0 + NAME_GAP
}

/// Draws a line through `points`.
pub(super) fn line(svg: &mut Svg, style: Style, points: &[(f64, f64)]) {
    let pen = match style {
        Style::Line => "stroke-width=\"2.4\"",
        Style::Dashed => "stroke-width=\"1.7\" stroke-dasharray=\"6 4\"",
        Style::JoinedDots => "stroke-width=\"1.5\"",
        Style::Dots | Style::Ring => return,
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

/// Draws a ring around a point.
pub(super) fn ring(svg: &mut Svg, (x, y): Place) {
    let [x, y, radius] = [x, y, RING].map(At);
    svg.raw(&format!(
        "<circle class=\"stroke\" stroke-width=\"2.2\" cx=\"{x}\" cy=\"{y}\" r=\"{radius}\"/>"
    ));
}

/// Draws a panel into its plot. Returns the names that have no place in or beside it.
pub(super) fn draw(
    svg: &mut Svg,
    panel: &Panel,
    (x, y): (&Scale, &Scale),
    area: &Area,
    names: &Names,
) -> Vec<Key> {
    let place = |at: f64, height: f64| {
        (
            area.left + (area.right - area.left) * x.position(at),
            area.bottom - (area.bottom - area.top) * y.position(height),
        )
    };
    let shown = |point: &Point| x.contains(point.x) && y.contains(point.y);
    let most = panel.series.iter().map(|series| series.points.len()).max();
    let radius = if most.unwrap_or(0) > 12 { 2.8 } else { 4.2 };
    let mut taken = Taken::default();
    let (mut beside_plot, mut within) = (Vec::new(), Vec::new());
    for series in &panel.series {
        svg.raw(&format!("<g class=\"{}\">", series.pen.colour.class()));
        if series.style.has_line() {
            for part in series.points.chunk_by(|a, b| shown(a) == shown(b)) {
                let places = part.iter().filter(|point| shown(point));
                let places: Vec<_> = places.map(|point| place(point.x, point.y)).collect();
                if places.len() > 1 {
                    line(svg, series.style, &places);
                    let lines = places.windows(2).map(|ends| (ends[0], ends[1]));
                    taken.lines.extend(lines);
                }
            }
        }
        let mut dots = Vec::new();
        for point in &series.points {
            let ends = point.interval.filter(|_| x.contains(point.x));
            let ends = ends.map(|(low, high)| (y.clamp(low), y.clamp(high)));
            let has_dots = series.style.has_dots();
            let at = if shown(point) {
                if let Some((low, high)) = ends.filter(|_| has_dots) {
                    let ends = (place(point.x, low), place(point.x, high));
                    interval(svg, ends.0, ends.1);
                    taken.dots.push(Area::around(ends.0, ends.1, 3.0));
                }
                let at = place(point.x, point.y);
                if has_dots {
                    svg.dot(series.pen.mark, at, radius, true);
                }
                at
            } else if let Some((_, high)) = ends.filter(|_| y.logarithmic && point.y <= 0.0) {
                let (foot, at) = (place(point.x, y.low), place(point.x, high));
                if has_dots {
                    interval(svg, foot, at);
                    svg.dot(series.pen.mark, at, radius, false);
                    taken.dots.push(Area::around(foot, at, 3.0));
                }
                at
            } else {
                continue;
            };
            let reach = match series.style {
                Style::Ring => {
                    ring(svg, at);
                    RING
                }
                _ if has_dots => 1.3 * radius,
                _ => 0.0,
            };
            taken.dots.push(Area::around(at, at, reach));
            dots.push(at);
        }
        svg.raw("</g>");
        dots.reverse();
        let Some(&(end, _)) = dots.first().filter(|_| series.name.is_some()) else {
            continue;
        };
        let is_right = (end - area.left) / (area.right - area.left) > RIGHT;
        if is_right && series.style != Style::Ring {
            beside_plot.push(Name { series, dots });
        } else {
            within.push(Name { series, dots });
        }
    }
    names_beside_the_plot(svg, &beside_plot, area, names, &mut taken);
    let bounds = Area {
        right: area.right + 8.0,
        ..*area
    };
    // A ring has only one place.
    within.sort_by_key(|name| name.series.style != Style::Ring);
    let mut left_out = Vec::new();
    for name in within {
        let spot = INNER_NAME_WIDTHS.iter().find_map(|&width| {
            let lines = wrapped(name.text(), TEXT, width);
            let widths = lines.iter().map(|line| text_width(line, TEXT));
            let size = (widths.fold(0.0, f64::max), LINE * lines.len() as f64);
            let spot = beside(&name.dots, size, &bounds, &taken)?;
            Some((spot, lines))
        });
        let Some((
            Spot {
                area,
                x,
                anchor,
                line,
            },
            lines,
        )) = spot
        else {
            left_out.push(Key::new(name.series.pen, name.series.style, name.text()));
            continue;
        };
        let class = name.class();
        if let Some(line) = line {
            line_to_name(svg, &class, line);
            taken.lines.push(line);
        }
        taken.names.push(area);
        svg.lines(&class, (x, area.top), (TEXT, LINE), anchor, &lines);
    }
    left_out
}

/// The name of a series, and where its dots lie, the last first.
struct Name<'a> {
    series: &'a Series,
    dots: Vec<Place>,
}

impl Name<'_> {
    fn text(&self) -> &str {
        self.series.name.as_deref().unwrap_or_default()
    }

    fn class(&self) -> String {
        format!("{} halo", self.series.pen.colour.class())
    }
}

/// Draws each name, with a line to the end of its curve if that is not close.
fn names_beside_the_plot(
    svg: &mut Svg,
    ends: &[Name],
    area: &Area,
    names: &Names,
    taken: &mut Taken,
) {
    let texts = ends
        .iter()
        .map(|name| wrapped(name.text(), TEXT, names.max_width));
    let texts: Vec<Vec<String>> = texts.collect();
    let labels = ends.iter().zip(&texts).map(|(name, lines)| Label {
        y: name.dots[0].1,
        height: height_of(lines),
    });
    let labels: Vec<Label> = labels.collect();
    let places = spread(&labels, area.top - LINE / 2.0, area.bottom + LINE / 2.0);
    for ((name, lines), middle) in ends.iter().zip(&texts).zip(places) {
        let (x, class, end) = (area.right + TO_NAME, &name.class(), name.dots[0]);
        if (middle - end.1).abs() > 3.0 {
            let line = ((end.0 + 7.0, end.1), (x - 3.0, middle));
            line_to_name(svg, class, line);
            taken.lines.push(line);
        }
        let top = middle - LINE * lines.len() as f64 / 2.0;
        taken.names.push(Area::around(
            (x, top),
            (x + names.width, top + LINE * lines.len() as f64),
            0.0,
        ));
        svg.lines(class, (x, top), (TEXT, LINE), Anchor::Start, lines);
    }
}

fn line_to_name(svg: &mut Svg, class: &str, (from, to): Line) {
    let [x1, y1, x2, y2] = [from.0, from.1, to.0, to.1].map(At);
    svg.raw(&format!(
        "<g class=\"{class}\"><path class=\"stroke\" stroke-width=\"1\" d=\"M{x1} {y1}L{x2} {y2}\"/></g>"
    ));
}
