//! The pixels of a picture, and the steps of its colour bar.

use std::fmt::Write as _;

use anyhow::Result;
use plotters::prelude::Color as _;

use super::colour;
use super::draw::NO_EVENT;
use super::layout::Frame;

/// Writes `levels`, `columns` in a line, into `frame` as rectangles of the size
/// `cell`. Neighbours in a line that look the same share one.
pub(super) fn write_cells(
    document: &mut String,
    levels: &[Option<u8>],
    columns: usize,
    frame: Frame,
    cell: (f64, f64),
) -> Result<()> {
    let mut paths = vec![String::new(); 1 + usize::from(u8::MAX) + 1];
    for (y, line) in levels.chunks(columns).enumerate() {
        let mut x = 0;
        for run in line.chunk_by(|a, b| a == b) {
            let path = run[0].map_or(0, |level| 1 + usize::from(level));
            let width = run.len();
            write!(paths[path], "M{x} {y}h{width}v1h-{width}z")?;
            x += width;
        }
    }

    let Frame { x, y, .. } = frame;
    let (width, height) = cell;
    writeln!(
        document,
        "<g transform=\"translate({x} {y})scale({width} {height})\" \
         shape-rendering=\"crispEdges\">"
    )?;
    for (path, shape) in paths.iter().enumerate() {
        if !shape.is_empty() {
            let level = path
                .checked_sub(1)
                .and_then(|level| u8::try_from(level).ok());
            let (r, g, b) = level.map_or_else(|| NO_EVENT.rgb(), colour);
            writeln!(
                document,
                "<path fill=\"#{r:02x}{g:02x}{b:02x}\" d=\"{shape}\"/>"
            )?;
        }
    }
    document.push_str("</g>\n");
    Ok(())
}
