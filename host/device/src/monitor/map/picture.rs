//! Ranges as lines of text with colours.
//!
//! A character shows two squares, one above the other: its ink colours the upper half, its
//! background the lower one. The colour scale is that of the maps and spans the shown ranges.

use dtof_draw::palette;
use dtof_draw::picture::levels;

pub(super) const PLAIN: &str = "\x1b[0m";

/// Draws `ranges` in mm, `columns` in a row, as at most `most_lines` lines of `most_columns`
/// characters. Pixels are drawn as large as fits. If all numbers fit, each pixel shows its range. If
/// there is too little room, only every second pixel of every second row is shown, or every third,
/// and so on. Pixels without a range are empty.
#[must_use]
pub(super) fn picture(
    ranges: &[Option<f64>],
    columns: usize,
    most_lines: usize,
    most_columns: usize,
) -> Vec<String> {
    let (columns, most_lines, most_columns) =
        (columns.max(1), most_lines.max(1), most_columns.max(1));
    let levels = levels(ranges);
    let step = columns
        .div_ceil(most_columns)
        .max(ranges.len().div_ceil(columns).div_ceil(2 * most_lines))
        .max(1);
    let firsts: Vec<usize> = (0..ranges.len()).step_by(columns).step_by(step).collect();
    let side = (most_columns / columns)
        .min((2 * most_lines).checked_div(firsts.len()).unwrap_or(1))
        .max(1);
    let numbers: Vec<String> = ranges
        .iter()
        .map(|range| range.map_or_else(String::new, |range| format!("{range:.0}")))
        .collect();
    let has_numbers = numbers.iter().all(|number| number.len() < side);

    let lines = (firsts.len() * side).div_ceil(2);
    let line = |line: usize| {
        let rows = [2 * line / side, (2 * line + 1) / side];
        let is_middle = (rows[0] * side + side / 2) / 2 == line;
        let cells = (0..columns).step_by(step).map(|column| {
            let pixel = |row: usize| {
                let first = firsts.get(row)?;
                (first + column < ranges.len()).then_some(first + column)
            };
            let level = |row| pixel(row).and_then(|pixel| levels[pixel]);
            match (level(rows[0]), pixel(rows[0])) {
                (Some(level), Some(pixel)) if has_numbers && is_middle => {
                    number(&numbers[pixel], level, side)
                }
                (upper, _) => block(upper, level(rows[1]), side),
            }
        });
        cells.collect::<String>() + PLAIN
    };
    (0..lines).map(line).collect()
}

/// `width` characters in the colours of an upper and a lower pixel.
pub(super) fn block(upper: Option<u8>, lower: Option<u8>, width: usize) -> String {
    match (upper, lower) {
        (None, None) => format!("{PLAIN}{}", " ".repeat(width)),
        (Some(upper), None) => format!("{PLAIN}{}{}", ink(upper), "▀".repeat(width)),
        (None, Some(lower)) => format!("{PLAIN}{}{}", ink(lower), "▄".repeat(width)),
        (Some(upper), Some(lower)) => {
            format!("{}{}{}", ink(upper), paper(lower), "▀".repeat(width))
        }
    }
}

/// A number centred in `width` characters, black or white on the pixel's colour.
fn number(number: &str, level: u8, width: usize) -> String {
    let [red, green, blue] = palette::level(level).map(u32::from);
    // ITU-R BT.601.
    let is_bright = 299 * red + 587 * green + 114 * blue > 127_500;
    let ink = if is_bright { 0 } else { 255 };
    format!(
        "\x1b[38;2;{ink};{ink};{ink}m{}{number:^width$}",
        paper(level)
    )
}

fn ink(level: u8) -> String {
    let [red, green, blue] = palette::level(level);
    format!("\x1b[38;2;{red};{green};{blue}m")
}

fn paper(level: u8) -> String {
    let [red, green, blue] = palette::level(level);
    format!("\x1b[48;2;{red};{green};{blue}m")
}
