//! Where everything in a picture is, in pixels from its top left corner.

use super::axis::{Axis, Lines};
use super::scale::{Mark, Scale};
use super::{Map, one_line};

/// The room for the pixels of a map.
const MOST_WIDTH: f64 = 512.0;
const MOST_HEIGHT: f64 = 800.0;
/// Side of the only pixel of a map.
const MOST_CELL: f64 = 64.0;
/// Thinner maps are stretched.
const LEAST_SIDE: f64 = 40.0;

const EDGE: i32 = 16;
const LEAST_CANVAS: i32 = 420;
/// Between the map and the colour bar.
const BAR_DISTANCE: i32 = 26;
const BAR_WIDTH: i32 = 18;
/// About what a character is wide, in text and in the title.
pub(super) const CHARACTER: i32 = 10;
const TITLE_CHARACTER: i32 = 11;
pub(super) const LINE_HEIGHT: i32 = 25;

/// A rectangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub x: i32,
    pub y: i32,
    pub width: i32,
    pub height: i32,
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

/// A line of text below the map.
#[derive(Debug)]
pub(super) struct Note {
    pub text: String,
    /// It explains the colour of the pixels without a value.
    pub no_event: bool,
}

/// A picture but for the values of its pixels.
#[derive(Debug)]
pub(super) struct Layout {
    pub size: (u32, u32),
    pub title: Vec<String>,
    pub plot: Frame,
    /// Number of pixels in a drawn line.
    pub columns: usize,
    /// Width and height of a pixel.
    pub cell: (f64, f64),
    /// The axis below the map and the one left of it.
    pub axes: [Axis; 2],
    pub bar: Option<Bar>,
    pub notes: Vec<Note>,
    /// Top of the first note.
    pub notes_y: i32,
}

impl Layout {
    /// The picture of `map`, of which `silent` pixels have no value.
    pub fn new(map: &Map, scale: Option<&Scale>, silent: usize) -> Self {
        let pixels = map.columns * map.rows;
        let lines = Lines::new(map.columns, map.rows, map.sides);
        let (columns, rows) = (lines.columns, lines.rows);

        let side = (MOST_WIDTH / columns as f64).min(MOST_HEIGHT / rows as f64);
        let side = if side < 1.0 {
            side
        } else {
            side.floor().min(MOST_CELL)
        };
        let length = |count: usize| (side * count as f64).round().max(LEAST_SIDE);
        let (width, height) = (length(columns), length(rows));
        let cell = (width / columns as f64, height / rows as f64);

        let axes = lines.axes(cell);
        let widest = axes[1].numbers.iter().map(|(_, number)| number.len()).max();
        let left = 42 + CHARACTER * count(widest.unwrap_or(0));

        let marks_length = height.clamp(160.0, 384.0);
        let unit = one_line(map.unit);
        let marks = scale.map_or_else(Vec::new, |scale| scale.marks(marks_length));
        let widest = marks.iter().map(|mark| mark.label.chars().count()).max();
        let right = widest.map_or(0, |most| {
            let marks = BAR_WIDTH + 10 + CHARACTER * count(most);
            BAR_DISTANCE + marks.max(CHARACTER * count(unit.chars().count()))
        });
        let canvas = (left + whole(width) + right + EDGE).max(LEAST_CANVAS);

        let room = (canvas - left - EDGE) / TITLE_CHARACTER;
        let title = wrapped(&one_line(map.title), usize::try_from(room).unwrap_or(1));
        // The line above the bar is for its unit.
        let top = EDGE + LINE_HEIGHT * (count(title.len()) + 1) + 4;
        let plot = Frame {
            x: left,
            y: top,
            width: whole(width),
            height: whole(height),
        };
        let bar = scale.map(|scale| Bar {
            frame: Frame {
                x: plot.x + plot.width + BAR_DISTANCE,
                width: BAR_WIDTH,
                height: whole(marks_length),
                ..plot
            },
            unit,
            marks,
            levels: scale.bar(),
        });

        let mut notes = Vec::new();
        if silent > 0 {
            let text = if silent == pixels {
                "no event in any pixel".into()
            } else {
                format!("no event: {silent} of {pixels} pixels")
            };
            notes.push(Note {
                text,
                no_event: true,
            });
        }
        notes.extend(scale.map(|scale| Note {
            text: scale.note().into(),
            no_event: false,
        }));
        let under_bar = bar.as_ref().map_or(0, |bar| top + bar.frame.height + 14);
        let notes_y = under_bar.max(top + plot.height + 62);
        let bottom = notes_y + LINE_HEIGHT * count(notes.len()) + EDGE - 4;

        Self {
            size: (canvas.unsigned_abs(), bottom.unsigned_abs()),
            title,
            plot,
            columns,
            cell,
            axes,
            bar,
            notes,
            notes_y,
        }
    }
}

/// `text` in lines of at most `width` characters, broken between words if possible.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut used = width;
    for word in text.split(' ') {
        let letters: Vec<_> = word.chars().collect();
        for (piece, letters) in letters.chunks(width.max(1)).enumerate() {
            let fits = piece == 0 && used + 1 + letters.len() <= width;
            match lines.last_mut() {
                Some(line) if fits => {
                    line.push(' ');
                    line.extend(letters);
                    used += 1 + letters.len();
                }
                _ => {
                    lines.push(letters.iter().collect());
                    used = letters.len();
                }
            }
        }
    }
    lines
}

/// `value` in whole pixels.
#[allow(clippy::cast_possible_truncation, reason = "saturates")]
pub(super) fn whole(value: f64) -> i32 {
    value.round() as i32
}

/// `number` among lengths in pixels.
pub(super) fn count(number: usize) -> i32 {
    i32::try_from(number).unwrap_or(i32::MAX)
}
