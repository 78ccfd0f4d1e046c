//! A chart as a document: the layout, and everything around the panels.

use anyhow::{Result, ensure};

use super::names::Area;
use super::panel::{self, LINE, Names, TO_NAME};
use super::parts::{Chart, Key, Panel, Style};
use super::scale::{GAP, Scale, Tick};
use crate::svg::{Anchor, BOLD, EDGE, Svg, TEXT, TITLE, text_width, wrapped};

/// Width of every chart. At 400 pixels the smallest letters are 10 pixels high.
const WIDTH: f64 = 560.0;
const INNER: f64 = WIDTH - 2.0 * EDGE;
/// Height of a plot: the only one, in a single row, in several rows.
const HEIGHTS: [f64; 3] = [300.0, 210.0, 165.0];
/// Gap between two rows of panels, besides titles and labels.
const ROW_GAP: f64 = 14.0;

/// Draws `chart` as a complete SVG document. The same chart always gives the same
/// bytes. Points outside the range of an axis are not drawn.
///
/// # Errors
/// Fails if there is no point to draw.
pub fn chart(chart: &Chart) -> Result<String> {
    let layout = Layout::new(chart)?;
    let mut svg = Svg::default();
    let title = chart.title();
    let lines = wrapped(&title, BOLD * TITLE.0, INNER);
    let mut y = svg.lines("ink title", (EDGE, EDGE), TITLE, Anchor::Start, &lines);
    y = key(&mut svg, &chart.key, y + 6.0);
    let soft = |svg: &mut Svg, y, text| {
        let lines = wrapped(text, TEXT, INNER);
        svg.lines("soft", (EDGE, y), (TEXT, LINE), Anchor::Start, &lines)
    };
    y = soft(&mut svg, y, &chart.y.label) + 8.0;
    let mut left_out: Vec<Key> = Vec::new();
    let rows: Vec<&[Panel]> = chart.panels.chunks(layout.columns).collect();
    for (row, panels) in rows.iter().enumerate() {
        let title_lines = panels.iter().enumerate();
        let title_lines = title_lines.map(|(column, panel)| layout.title(panel, column).len());
        let top = y + LINE * title_lines.max().unwrap_or(0) as f64;
        let below = rows.get(row + 1).map_or(0, |below| below.len());
        for (column, panel) in panels.iter().enumerate() {
            let area = layout.area(column, top);
            // Clear of a dot or ring at the upper edge of the plot.
            let (at, lines) = ((area.left, y - 7.5), layout.title(panel, column));
            svg.lines("ink panel", at, (TEXT, LINE), Anchor::Start, &lines);
            layout.frame(&mut svg, &area, column, column >= below);
            let scales = (&layout.x, &layout.y);
            let names = panel::draw(&mut svg, panel, scales, &area, &layout.names[column]);
            for name in names {
                if !left_out.iter().any(|other| other.text == name.text) {
                    left_out.push(name);
                }
            }
        }
        y = top + layout.height + ROW_GAP;
    }
    y += LINE - ROW_GAP + 6.0;
    let right = layout.area(layout.columns - 1, 0.0).right;
    let middle = (f64::midpoint(layout.left, right), y + LINE / 2.0);
    svg.text("soft", middle, TEXT, Anchor::Middle, &chart.x.label);
    y = key(&mut svg, &left_out, y + LINE + 8.0);
    y = soft(&mut svg, y, &chart.note);
    Ok(svg.document((WIDTH, y + EDGE - 4.0), &title))
}

/// Draws the legend. Returns its bottom.
fn key(svg: &mut Svg, keys: &[Key], mut y: f64) -> f64 {
    let mut x = EDGE;
    for key in keys {
        let width = 36.0 + text_width(&key.text, TEXT);
        if x > EDGE && x + width > WIDTH - EDGE {
            (x, y) = (EDGE, y + LINE);
        }
        let (line, middle) = ([(x, y + LINE / 2.0), (x + 28.0, y + LINE / 2.0)], x + 14.0);
        svg.raw(&format!("<g class=\"{}\">", key.pen.colour.class()));
        panel::line(svg, key.style, &line);
        if key.style.has_dots() {
            panel::interval(svg, (middle, y + 2.0), (middle, y + LINE - 2.0));
            svg.dot(key.pen.mark, (middle, y + LINE / 2.0), 4.2, true);
        }
        if key.style == Style::Ring {
            panel::ring(svg, (middle, y + LINE / 2.0));
        }
        svg.raw("</g>");
        let at = (x + 34.0, y + LINE / 2.0);
        svg.text("ink", at, TEXT, Anchor::Start, &key.text);
        x += width + 14.0;
    }
    if keys.is_empty() { y } else { y + LINE + 4.0 }
}

/// The positions of the panels, and their common axes.
struct Layout {
    columns: usize,
    x: Scale,
    y: Scale,
    x_ticks: Vec<Tick>,
    y_ticks: Vec<Tick>,
    /// Left edge of the first plot.
    left: f64,
    /// Gap between two plots of a row, besides names.
    gap: f64,
    /// Size of a plot.
    width: f64,
    height: f64,
    /// The names beside the plots of each column.
    names: Vec<Names>,
}

impl Layout {
    fn new(chart: &Chart) -> Result<Self> {
        let columns = chart.columns.clamp(1, chart.panels.len().max(1));
        ensure!(!chart.panels.is_empty(), "{}: no panels", chart.finding);
        let all = || chart.panels.iter().flat_map(|panel| &panel.series);
        let points = || all().flat_map(|series| &series.points);
        let x = Scale::new(&chart.x, points().map(|point| point.x))?;
        let heights = all().flat_map(|series| {
            let has_interval = series.style.has_dots();
            series.points.iter().flat_map(move |point| {
                let interval = point.interval.filter(|_| has_interval);
                let (low, high) = interval.unwrap_or((point.y, point.y));
                // A lower end near 0 would stretch a logarithmic axis without bound.
                let low = if chart.y.logarithmic {
                    low.max(point.y / 3.0)
                } else {
                    low
                };
                [point.y, low, high]
            })
        });
        let y = Scale::new(&chart.y, heights)?;
        let height = match (chart.panels.len(), chart.panels.len() > columns) {
            (1, _) => HEIGHTS[0],
            (_, false) => HEIGHTS[1],
            (_, true) => HEIGHTS[2],
        };
        let max_width = if columns == 1 { 165.0 } else { 105.0 };
        let names: Vec<Names> = (0..columns)
            .map(|column| {
                let panels = chart.panels.iter().skip(column).step_by(columns);
                Names::new(panels, &x, max_width)
            })
            .collect();
        // All names fit beside the plots.
        let height = names
            .iter()
            .map(|names| names.height - LINE)
            .fold(height, f64::max);
        let y_ticks = y.ticks(height, (TEXT, TEXT), |_| TEXT);
        let widest = |ticks: &[Tick]| {
            let widths = ticks.iter().map(|tick| text_width(&tick.label, TEXT));
            widths.fold(0.0, f64::max)
        };
        let left = EDGE + widest(&y_ticks) + 8.0;
        let beside: f64 = names.iter().map(|names| names.width).sum();
        let whole = WIDTH - left - EDGE - beside;
        let plot = |gap: f64| (whole - gap * (columns as f64 - 1.0)) / columns as f64;
        // Almost up to the edges of the picture.
        let beside_last = names.last().map_or(0.0, |names| names.width);
        let room = (left - 1.0, beside_last + EDGE - 1.0);
        let ticks = |gap| x.ticks(plot(gap), room, |label| text_width(label, TEXT));
        // The outermost labels extend beyond the plots by half of their widths.
        let gap = widest(&ticks(20.0)) + GAP;
        Ok(Self {
            columns,
            x_ticks: ticks(gap),
            x,
            y,
            y_ticks,
            left,
            gap,
            width: plot(gap),
            height,
            names,
        })
    }

    /// The plot in a `column`, from `top` on.
    fn area(&self, column: usize, top: f64) -> Area {
        let before: f64 = self.names[..column].iter().map(|names| names.width).sum();
        let left = self.left + column as f64 * (self.width + self.gap) + before;
        Area::around((left, top), (left + self.width, top + self.height), 0.0)
    }

    fn title(&self, panel: &Panel, column: usize) -> Vec<String> {
        let has_names = self.names.iter().any(|names| names.width > 0.0);
        let beside = if has_names {
            TO_NAME / 2.0
        } else if column + 1 == self.columns {
            EDGE - 1.0
        } else {
            self.gap / 2.0
        };
        wrapped(
            &panel.title,
            BOLD * TEXT,
            self.width + beside.min(self.gap / 2.0),
        )
    }

    /// Draws grid and axes of a plot. The first column has the labels of y; `has_x_labels` asks
    /// for the labels of x.
    fn frame(&self, svg: &mut Svg, area: &Area, column: usize, has_x_labels: bool) {
        for tick in &self.y_ticks {
            let y = area.bottom - self.height * self.y.position(tick.value);
            svg.line("grid", (area.left, y), (area.right, y));
            if column == 0 {
                svg.text("soft", (area.left - 7.0, y), TEXT, Anchor::End, &tick.label);
            }
        }
        for tick in &self.x_ticks {
            let x = area.left + self.width * self.x.position(tick.value);
            svg.line("edge", (x, area.bottom), (x, area.bottom + 5.0));
            if has_x_labels {
                let at = (x, area.bottom + 6.0 + LINE / 2.0);
                svg.text("soft", at, TEXT, Anchor::Middle, &tick.label);
            }
        }
        svg.line("edge", (area.left, area.bottom), (area.right, area.bottom));
    }
}
