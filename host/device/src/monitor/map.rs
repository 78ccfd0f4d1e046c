//! The ranges of a device's pixels as a picture on a terminal, drawn in place.

mod picture;

use std::io::{self, Write};
use std::time::{Duration, Instant};

use dtof_core::{Array, EchoNumber, RangeScale};

use dtof_draw::picture::span;
use dtof_events::aer_file::Event;
use dtof_events::reports::LastReports;
use picture::{PLAIN, block, picture};

/// How often it is drawn.
const EVERY: Duration = Duration::from_millis(200);

const HIDE_CURSOR: &str = "\x1b[?25l";
/// Shows it again, however the program ends.
pub const SHOW_CURSOR: &str = "\x1b[?25h";
const CLEAR_REST: &str = "\x1b[K";
/// Everything gone, and the cursor in the first line.
const CLEAR_ALL: &str = "\x1b[2J\x1b[H";

/// Lines and columns of a terminal, asked for each time: its window may change.
pub type Room = Box<dyn Fn() -> (usize, usize)>;

/// The picture and where it is drawn. The cursor is hidden as long as it lives.
pub struct LiveMap {
    out: Box<dyn Write>,
    room: Room,
    array: Array,
    ranges: Vec<Option<f64>>,
    reports: Vec<LastReports>,
    /// The text below the picture.
    line: String,
    /// Lines that are there from the last time, and the room there was.
    lines: usize,
    before: (usize, usize),
    drawn: Option<Instant>,
}

impl LiveMap {
    /// A picture of the first `pixels` of `array` on `out`, a terminal with so much `room`.
    #[must_use]
    pub fn new(out: Box<dyn Write>, room: Room, pixels: u16, array: Array) -> Self {
        let pixels = usize::from(pixels);
        Self {
            out,
            room,
            array,
            ranges: vec![None; pixels],
            reports: vec![LastReports::default(); pixels],
            line: String::new(),
            lines: 0,
            before: (0, 0),
            drawn: None,
        }
    }

    /// Takes events in. That of a block fills those of its pixels that [`LastReports`] tells.
    /// Of several echoes the first is shown.
    pub fn add(&mut self, events: &[Event], scale: &RangeScale) {
        for event in events {
            if event.echo() > EchoNumber::FIRST {
                continue;
            }
            let range_mm = scale.range(event.position()).to_num();
            for pixel in self.array.pixels_of(event.pixel(), event.level()) {
                let pixel = usize::from(pixel.0);
                let (Some(range), Some(reports)) =
                    (self.ranges.get_mut(pixel), self.reports.get_mut(pixel))
                else {
                    continue;
                };
                if reports.take_event(event) {
                    *range = Some(range_mm);
                }
            }
        }
    }

    /// Sets the text below the picture.
    pub fn tell(&mut self, line: String) {
        self.line = line;
    }

    /// Draws if it is time to.
    ///
    /// # Errors
    /// Those of the terminal.
    pub fn draw_when_due(&mut self) -> io::Result<()> {
        if self.drawn.is_some_and(|drawn| drawn.elapsed() < EVERY) {
            return Ok(());
        }
        self.draw()
    }

    /// Draws over what was drawn before.
    ///
    /// # Errors
    /// Those of the terminal.
    pub fn draw(&mut self) -> io::Result<()> {
        let room = (self.room)();
        // Two lines below the picture, and the one of the cursor. The last column stays free:
        // a line that fills it would clear it, or go on in the next.
        let (lines, columns) = (room.0.saturating_sub(3), room.1.saturating_sub(1));
        let mut text = picture(&self.ranges, self.array.columns() as usize, lines, columns);
        text.push(legend(&self.ranges));
        text.push(self.line.clone());
        let back = match self.lines {
            0 => HIDE_CURSOR.to_owned(),
            // Lines may be broken in another way now.
            _ if room != self.before => CLEAR_ALL.to_owned(),
            lines => format!("\r\x1b[{lines}A"),
        };
        self.out.write_all(back.as_bytes())?;
        for line in &text {
            writeln!(self.out, "{}{CLEAR_REST}", cut(line, columns))?;
        }
        self.lines = text.len();
        self.before = room;
        self.drawn = Some(Instant::now());
        self.out.flush()
    }
}

impl Drop for LiveMap {
    fn drop(&mut self) {
        let _ = write!(self.out, "{PLAIN}{SHOW_CURSOR}");
        let _ = self.out.flush();
    }
}

/// The first `columns` characters of `line`, and all of its colours.
fn cut(line: &str, columns: usize) -> String {
    let (mut seen, mut in_code) = (0, false);
    let kept = line.chars().filter(|&character| {
        let visible = !in_code && character != '\x1b';
        if visible {
            seen += 1;
        } else {
            // A code ends with its first letter.
            in_code = !character.is_ascii_alphabetic();
        }
        !visible || seen <= columns
    });
    kept.collect()
}

/// The legend of the colours.
fn legend(ranges: &[Option<f64>]) -> String {
    let reporting = ranges.iter().flatten().count();
    let pixels = ranges.len();
    match span(ranges) {
        None => format!("no event yet of {pixels} pixels"),
        Some((low, high)) => {
            let (purple, yellow) = (block(Some(0), Some(0), 1), block(Some(255), Some(255), 1));
            format!(
                "{purple}{PLAIN} {low:.0} mm to {yellow}{PLAIN} {high:.0} mm, \
                 {reporting} of {pixels} pixels"
            )
        }
    }
}

#[cfg(test)]
mod tests;
