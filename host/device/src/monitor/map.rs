//! The ranges of a device's pixels as a picture on a terminal, drawn in place.

mod picture;

use std::io::{self, Write};
use std::time::{Duration, Instant};

use dtof_core::{Array, EchoNumber};

use dtof_draw::picture::span;
use dtof_events::aer_file::Event;
use dtof_events::last_events::LastEvents;
use dtof_photons::ranges::Ranges;
use picture::{PLAIN, block, picture};

/// Shortest interval between two drawings of [`LiveMap::draw_when_due`].
const EVERY: Duration = Duration::from_millis(200);

const HIDE_CURSOR: &str = "\x1b[?25l";
/// Shows the cursor again, whichever way the program ends.
pub const SHOW_CURSOR: &str = "\x1b[?25h";
const CLEAR_REST: &str = "\x1b[K";
/// Clears the terminal and moves the cursor to the first line.
const CLEAR_ALL: &str = "\x1b[2J\x1b[H";

/// Gives the lines and columns of a terminal. It is called for each drawing, as windows change size.
pub type TerminalSize = Box<dyn Fn() -> (usize, usize)>;

/// A picture on a terminal. The cursor is hidden until this is dropped.
pub struct LiveMap {
    out: Box<dyn Write>,
    size: TerminalSize,
    array: Array,
    ranges: Vec<Option<f64>>,
    last_events: Vec<LastEvents>,
    /// The text below the picture.
    line: String,
    /// Lines of the last drawing, and the terminal's size then.
    lines: usize,
    last_size: (usize, usize),
    drawn: Option<Instant>,
}

impl LiveMap {
    /// A picture of the first `pixels` of `array` on `out`, a terminal of this `size`.
    #[must_use]
    pub fn new(out: Box<dyn Write>, size: TerminalSize, pixels: u16, array: Array) -> Self {
        let pixels = usize::from(pixels);
        Self {
            out,
            size,
            array,
            ranges: vec![None; pixels],
            last_events: vec![LastEvents::default(); pixels],
            line: String::new(),
            lines: 0,
            last_size: (0, 0),
            drawn: None,
        }
    }

    /// Adds events. An event of a block fills those of its pixels whose own event is not newer; see
    /// [`LastEvents`]. The first of several echoes is shown.
    pub fn add(&mut self, events: &[Event], ranges: &Ranges) {
        for event in events {
            if event.echo() > EchoNumber::FIRST {
                continue;
            }
            let range = ranges.of(event.pixel(), event.level(), event.position());
            let range_mm = range.to_num();
            for pixel in self.array.pixels_of(event.pixel(), event.level()) {
                let pixel = usize::from(pixel.raw());
                let (Some(range), Some(last_events)) =
                    (self.ranges.get_mut(pixel), self.last_events.get_mut(pixel))
                else {
                    continue;
                };
                if last_events.record_event(event) {
                    *range = Some(range_mm);
                }
            }
        }
    }

    /// Sets the text below the picture.
    pub fn set_line(&mut self, line: String) {
        self.line = line;
    }

    /// Draws unless the last drawing is less than 200 ms old.
    ///
    /// # Errors
    /// Fails if the terminal cannot be written.
    pub fn draw_when_due(&mut self) -> io::Result<()> {
        if self.drawn.is_some_and(|drawn| drawn.elapsed() < EVERY) {
            return Ok(());
        }
        self.draw()
    }

    /// Draws over the last drawing.
    ///
    /// # Errors
    /// Fails if the terminal cannot be written.
    pub fn draw(&mut self) -> io::Result<()> {
        let size = (self.size)();
        // Three lines are for the text below the picture and the cursor. The last column stays
        // free: a line that reaches it would be cleared there, or wrap.
        let (lines, columns) = (size.0.saturating_sub(3), size.1.saturating_sub(1));
        let mut text = picture(&self.ranges, self.array.columns() as usize, lines, columns);
        text.push(legend(&self.ranges));
        text.push(self.line.clone());
        let back = match self.lines {
            0 => HIDE_CURSOR.to_owned(),
            // The terminal may have wrapped lines anew.
            _ if size != self.last_size => CLEAR_ALL.to_owned(),
            lines => format!("\r\x1b[{lines}A"),
        };
        self.out.write_all(back.as_bytes())?;
        for line in &text {
            writeln!(self.out, "{}{CLEAR_REST}", cut(line, columns))?;
        }
        self.lines = text.len();
        self.last_size = size;
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

/// The first `columns` characters of `line`, with all of its colour codes.
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
