//! A map as a document.

use anyhow::{Result, ensure};

use super::layout::{Bar, Frame, LINE, Layout};
use super::map::Map;
use super::scale::{Scale, levels};
use crate::palette::{NO_EVENT, hex, level};
use crate::svg::{Anchor, At, EDGE, Svg, TEXT, TITLE};

/// Draws `map` as a complete SVG document.
///
/// Row 0 is at the top. Pixels are square, unless the map is so long and thin
/// that it has to be stretched. A single row or column of more than 256 pixels is wrapped
/// into lines.
///
/// The colours span the 2nd to the 98th percentile of the values. If values lie beyond, the end
/// of the colour bar is marked `≤` or `≥`. If the two percentiles coincide although the values
/// differ, the colours span all values.
///
/// The same map always gives the same bytes.
///
/// # Errors
///
/// Fails if the map has no pixels or if `values` is not `columns * rows` long.
pub fn heat_map(map: &Map) -> Result<String> {
    ensure!(
        map.columns.checked_mul(map.rows) == Some(map.values.len()),
        "{} values for a map of {} columns and {} rows",
        map.values.len(),
        map.columns,
        map.rows
    );
    ensure!(!map.values.is_empty(), "a map without pixels");

    let scale = Scale::new(map.values);
    let levels = levels(map.values);
    let silent = levels.iter().filter(|level| level.is_none()).count();
    let layout = Layout::new(map, scale.as_ref(), silent);
    let mut svg = Svg::default();
    texts(&mut svg, &layout);
    axes(&mut svg, &layout);
    let corner = layout.plot.corner;
    cells(&mut svg, &levels, layout.columns, corner, layout.cell);
    if let Some(layout) = &layout.bar {
        bar(&mut svg, layout);
    }
    Ok(svg.document(layout.size, map.title))
}

/// Draws `levels`, `columns` in a line, from `corner` on as rectangles of the size `cell`. Each
/// colour has one path; neighbours of one colour in a line share a rectangle.
fn cells(
    svg: &mut Svg,
    levels: &[Option<u8>],
    columns: usize,
    corner: (f64, f64),
    cell: (f64, f64),
) {
    let mut paths = vec![String::new(); 1 + usize::from(u8::MAX) + 1];
    for (y, line) in levels.chunks(columns).enumerate() {
        let mut x = 0;
        for run in line.chunk_by(|a, b| a == b) {
            let path = run[0].map_or(0, |level| 1 + usize::from(level));
            let width = run.len();
            paths[path] += &format!("M{x} {y}h{width}v1h-{width}z");
            x += width;
        }
    }
    let (x, y, (width, height)) = (At(corner.0), At(corner.1), cell);
    svg.raw(&format!(
        "<g transform=\"translate({x} {y})scale({width} {height})\" shape-rendering=\"crispEdges\">"
    ));
    let colours = std::iter::once(NO_EVENT).chain((0..=u8::MAX).map(level));
    for (shape, colour) in paths.iter().zip(colours) {
        if !shape.is_empty() {
            svg.raw(&format!("<path fill=\"{}\" d=\"{shape}\"/>", hex(colour)));
        }
    }
    svg.raw("</g>");
}

/// Draws title and notes.
fn texts(svg: &mut Svg, layout: &Layout) {
    let start = (EDGE, EDGE);
    svg.lines("ink title", start, TITLE, Anchor::Start, &layout.title);
    let mut y = layout.notes_y + LINE / 2.0;
    for (index, note) in layout.notes.iter().enumerate() {
        let mut x = EDGE;
        if layout.has_silent && index == 0 {
            let (left, top, fill) = (At(x), At(y - 7.0), hex(NO_EVENT));
            svg.raw(&format!(
                "<rect fill=\"{fill}\" x=\"{left}\" y=\"{top}\" width=\"14\" height=\"14\"/>"
            ));
            x += 22.0;
        }
        svg.text("soft", (x, y), TEXT, Anchor::Start, note);
        y += LINE;
    }
}

/// Draws numbers and names of the axes. The name of the rows stands above the map.
fn axes(svg: &mut Svg, layout: &Layout) {
    let ((x, y), (width, height)) = (layout.plot.corner, layout.plot.size);
    let [below, beside] = &layout.axes;
    let bottom = y + height + 1.0;
    for (at, number) in &below.numbers {
        svg.line("edge", (x + at, bottom), (x + at, bottom + 5.0));
        let place = (x + at, bottom + 15.0);
        svg.text("soft", place, TEXT, Anchor::Middle, number);
    }
    let middle = (x + width / 2.0, bottom + 36.0);
    svg.text("soft", middle, TEXT, Anchor::Middle, &below.name);
    for (at, number) in &beside.numbers {
        svg.line("edge", (x - 6.0, y + at), (x - 1.0, y + at));
        svg.text("soft", (x - 9.0, y + at), TEXT, Anchor::End, number);
    }
    let above = (EDGE, y - 8.0 - LINE / 2.0);
    svg.text("soft", above, TEXT, Anchor::Start, &beside.name);
}

/// Draws the colour bar with its marks and unit.
fn bar(svg: &mut Svg, bar: &Bar) {
    let Frame {
        corner: (x, y),
        size: (width, height),
    } = bar.frame;
    let cell = (width, height / bar.levels.len() as f64);
    cells(svg, &bar.levels, 1, (x, y), cell);
    let right = x + width + 1.0;
    for mark in &bar.marks {
        let at = y + height * (1.0 - mark.position);
        svg.line("edge", (right, at), (right + 5.0, at));
        svg.text("soft", (right + 9.0, at), TEXT, Anchor::Start, &mark.label);
    }
    let above = (x, y - 8.0 - LINE / 2.0);
    svg.text("soft", above, TEXT, Anchor::Start, &bar.unit);
}
