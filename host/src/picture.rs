//! Pictures of per-pixel values: heat maps as SVG documents.
//!
//! A document needs nothing beside itself: no font files, scripts or outside
//! style sheets. It defines no identifiers, so that any number of them can be
//! placed in one page. Its background follows the light or dark colour scheme
//! of the viewer, and is white where a viewer knows no such thing.

mod axis;
mod cells;
mod draw;
mod layout;
mod scale;
#[cfg(test)]
mod tests;

use anyhow::{Result, ensure};

use plotters::prelude::{RGBColor, ViridisRGB};

use layout::Layout;
use scale::Scale;

/// Every document has it near its start.
pub(crate) const MARK: &str = "class=\"heat-map\"";

/// One value a pixel, row by row from the top.
///
/// `None` stands for a pixel that never reported; a value that is not finite is
/// treated the same.
#[derive(Clone, Copy, Debug)]
pub struct Map<'a> {
    /// What the values are; drawn above the map.
    pub title: &'a str,
    /// Unit of the values; drawn above the colour bar.
    pub unit: &'a str,
    /// What columns and rows are; written along the sides.
    pub sides: [&'a str; 2],
    /// Number of pixels in a row.
    pub columns: usize,
    /// Number of rows.
    pub rows: usize,
    /// The values, `columns * rows` of them.
    pub values: &'a [Option<f64>],
}

/// Draws `map` as a complete SVG document.
///
/// Row 0 is at the top. Pixels are square, unless the map is so long and thin
/// that it has to be stretched to be seen. A single row or column too long to
/// be drawn in one piece is wrapped into lines, as text is.
///
/// The colours span the 2nd to the 98th percentile of the values; where values
/// lie beyond, the end of the colour bar is marked `≤` or `≥`. Should the two
/// percentiles coincide although the values differ, the colours span all values.
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
    draw::document(&layout, &levels)
}

/// What the colours of a map span, lowest and highest; `None` without values.
pub(crate) fn span(values: &[Option<f64>]) -> Option<(f64, f64)> {
    Scale::new(values).map(|scale| scale.span())
}

/// The places of `values` in the colours, as a map shows them.
pub(crate) fn levels(values: &[Option<f64>]) -> Vec<Option<u8>> {
    let scale = Scale::new(values);
    let level = |value: &Option<f64>| Some(scale.as_ref()?.level(finite(*value)?));
    values.iter().map(level).collect()
}

/// The colour of a level: red, green and blue.
pub(crate) fn colour(level: u8) -> (u8, u8, u8) {
    let RGBColor(red, green, blue) = ViridisRGB::get_color(f64::from(level) / f64::from(u8::MAX));
    (red, green, blue)
}

/// The value of a pixel that has one.
fn finite(value: Option<f64>) -> Option<f64> {
    value.filter(|value| value.is_finite())
}

/// `text` on one line, without characters that XML does not allow.
pub(crate) fn one_line(text: &str) -> String {
    let text = text.replace(
        |c: char| c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}'),
        " ",
    );
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// `text` as content or attribute value of an XML or HTML element.
pub(crate) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            c => escaped.push(c),
        }
    }
    escaped
}
