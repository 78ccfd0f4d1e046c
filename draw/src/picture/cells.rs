//! The pixels of a picture, and the steps of its colour bar.

use crate::palette::{NO_EVENT, hex, level};
use crate::svg::{At, Svg};

/// Draws `levels`, `columns` in a line, from `corner` on as rectangles of the size `cell`. Each
/// colour has one path; neighbours of one colour in a line share a rectangle.
pub(super) fn draw(
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
