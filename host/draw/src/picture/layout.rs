//! The layout of a map.

use super::axis::{Axis, Lines};
use super::map::Map;
use super::scale::{Mark, Scale};
use crate::svg::{BOLD, EDGE, TEXT, TITLE, one_line, text_width, wrapped};

/// The largest size of a map.
const MAX_WIDTH: f64 = 400.0;
const MAX_HEIGHT: f64 = 640.0;
/// The largest side of a pixel.
const MAX_CELL: f64 = 64.0;
/// Thinner maps are stretched.
const MIN_SIDE: f64 = 40.0;

const MIN_CANVAS: f64 = 400.0;
/// Gap between the map and the colour bar.
const BAR_DISTANCE: f64 = 22.0;
const BAR_WIDTH: f64 = 16.0;
pub(super) const LINE: f64 = 22.0;

/// A rectangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub corner: (f64, f64),
    pub size: (f64, f64),
}

/// The colour bar.
#[derive(Debug)]
pub(super) struct Bar {
    pub frame: Frame,
    pub unit: String,
    pub marks: Vec<Mark>,
    /// Its levels from top to bottom.
    pub levels: Vec<Option<u8>>,
}

/// The layout of a map, without the values of its pixels.
#[derive(Debug)]
pub(super) struct Layout {
    pub size: (f64, f64),
    pub title: Vec<String>,
    pub plot: Frame,
    /// Number of pixels in a drawn line.
    pub columns: usize,
    /// Width and height of a pixel.
    pub cell: (f64, f64),
    /// The axis below the map and the one left of it.
    pub axes: [Axis; 2],
    pub bar: Option<Bar>,
    /// Lines of text below the map.
    pub notes: Vec<String>,
    /// Whether the first note explains the colour of pixels without a value.
    pub has_silent: bool,
    /// Top of the first note.
    pub notes_y: f64,
}

impl Layout {
    /// The layout of `map`, in which `silent` pixels have no value.
    pub fn new(map: &Map, scale: Option<&Scale>, silent: usize) -> Self {
        let lines = Lines::new(map.columns, map.rows, map.axis_names);
        let (columns, rows) = (lines.columns, lines.rows);
        let side = (MAX_WIDTH / columns as f64).min(MAX_HEIGHT / rows as f64);
        let side = if side < 1.0 {
            side
        } else {
            side.floor().min(MAX_CELL)
        };
        let length = |count: usize| (side * count as f64).round().max(MIN_SIDE);
        let (width, height) = (length(columns), length(rows));
        let cell = (width / columns as f64, height / rows as f64);

        let axes = lines.axes(cell);
        let numbers = axes[1].numbers.iter();
        let widest = numbers.map(|(_, number)| text_width(number, TEXT));
        let left = EDGE + widest.fold(0.0, f64::max).ceil() + 10.0;

        let marks_length = height.clamp(160.0, 384.0);
        let unit = one_line(map.unit);
        let marks = scale.map_or_else(Vec::new, |scale| scale.marks(marks_length));
        let widest = marks.iter().map(|mark| text_width(&mark.label, TEXT));
        let widest = widest.fold(0.0, f64::max);
        let right = if scale.is_some() {
            BAR_DISTANCE + (BAR_WIDTH + 10.0 + widest).max(text_width(&unit, TEXT))
        } else {
            0.0
        };
        let canvas = (left + width + right + EDGE).ceil().max(MIN_CANVAS);

        let title = wrapped(&one_line(map.title), BOLD * TITLE.0, canvas - 2.0 * EDGE);
        // The line above the map has the name of the rows and the unit of the bar.
        let top = EDGE + TITLE.1 * title.len() as f64 + LINE + 10.0;
        let plot = Frame {
            corner: (left, top),
            size: (width, height),
        };
        let bar = scale.map(|scale| Bar {
            frame: Frame {
                corner: (left + width + BAR_DISTANCE, top),
                size: (BAR_WIDTH, marks_length),
            },
            unit,
            marks,
            levels: scale.bar(),
        });
        let notes = notes(map, scale, silent);
        let under_bar = bar.as_ref().map_or(0.0, |_| top + marks_length + 14.0);
        let notes_y = under_bar.max(top + height + 60.0);
        let bottom = notes_y + LINE * notes.len() as f64 + EDGE - 4.0;
        Self {
            size: (canvas, bottom),
            title,
            plot,
            columns,
            cell,
            axes,
            bar,
            notes,
            has_silent: silent > 0,
            notes_y,
        }
    }
}

fn notes(map: &Map, scale: Option<&Scale>, silent: usize) -> Vec<String> {
    let mut notes = Vec::new();
    let (missing, pixels) = (map.missing, map.columns * map.rows);
    if silent > 0 {
        notes.push(if silent == pixels {
            format!("no {missing} in any pixel")
        } else {
            format!("no {missing}: {silent} of {pixels} pixels")
        });
    }
    notes.extend(scale.map(|scale| scale.note().to_owned()));
    notes
}
