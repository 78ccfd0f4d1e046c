//! A small writer of SVG documents: shapes and text in the styles of the
//! [palette](crate::palette).
//!
//! A document is self-contained: no font files, scripts or external style sheets. It defines no
//! identifiers, so any number of documents can be embedded in one page.
//! The same calls always give the same bytes.

use std::fmt::{self, Write as _};

use crate::palette::{Mark, SHEET};

/// A string near the start of every document.
pub const MARK: &str = "class=\"dtof\"";

/// Widths of the characters from space to `~` in Helvetica and Arial, in 1/1000 of the
/// size.
const WIDTHS: [u16; 95] = [
    278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278, // to /
    556, 556, 556, 556, 556, 556, 556, 556, 556, 556, 278, 278, 584, 584, 584, 556, // to ?
    1015, 667, 667, 722, 722, 667, 611, 778, 722, 278, 500, 667, 556, 833, 722, 778, // to O
    667, 778, 722, 667, 611, 722, 667, 944, 667, 667, 611, 278, 278, 278, 469, 556, // to _
    333, 556, 556, 500, 556, 556, 278, 556, 556, 222, 222, 500, 222, 833, 556, 556, // to o
    556, 556, 333, 500, 278, 556, 500, 722, 500, 500, 500, 334, 260, 334, 584, // to ~
];
/// The width of any other character.
const OTHER: u16 = 620;
/// The factor by which other fonts may be wider.
const SLACK: f64 = 1.1;
/// The factor by which bold letters are wider, also those of wide fonts.
pub const BOLD: f64 = 1.17;

/// An upper estimate of the width of `text` at a font size of `size`.
#[must_use]
pub fn text_width(text: &str, size: f64) -> f64 {
    let width = |c: char| {
        let index = u32::from(c).checked_sub(u32::from(' '));
        let index = index.and_then(|index| usize::try_from(index).ok());
        f64::from(*index.and_then(|index| WIDTHS.get(index)).unwrap_or(&OTHER))
    };
    text.chars().map(width).sum::<f64>() / 1000.0 * size * SLACK
}

/// `text` in lines of at most `width`, wrapped between words. A longer word gets its own line.
#[must_use]
pub fn wrapped(text: &str, size: f64, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if text_width(&format!("{line} {word}"), size) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// `text` on one line, without characters that XML does not allow.
#[must_use]
pub fn one_line(text: &str) -> String {
    let text = text.replace(
        |c: char| c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}'),
        " ",
    );
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// `text` as content or attribute value of an XML or HTML element.
#[must_use]
pub fn escape(text: &str) -> String {
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

/// The margin around every picture.
pub const EDGE: f64 = 14.0;
/// Font size and line height of a title.
pub const TITLE: (f64, f64) = (20.0, 25.0);
/// Font size of all other text.
pub const TEXT: f64 = 14.5;

/// A coordinate: at most one digit after the point.
#[derive(Clone, Copy, Debug)]
pub struct At(pub f64);

impl fmt::Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Never -0.
        let tenths = (self.0 * 10.0).round() + 0.0;
        write!(f, "{}", tenths / 10.0)
    }
}

/// The part of a text that lies at its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// Its start.
    Start,
    /// Its middle.
    Middle,
    /// Its end.
    End,
}

/// A document that is being written.
#[derive(Clone, Debug, Default)]
pub struct Svg {
    body: String,
}

impl Svg {
    /// Adds an element verbatim.
    pub fn raw(&mut self, element: &str) {
        self.body.push_str(element);
        self.body.push('\n');
    }

    /// Adds a straight line.
    pub fn line(&mut self, class: &str, from: (f64, f64), to: (f64, f64)) {
        let [x1, y1, x2, y2] = [from.0, from.1, to.0, to.1].map(At);
        self.raw(&format!(
            "<path class=\"{class}\" d=\"M{x1} {y1}L{x2} {y2}\"/>"
        ));
    }

    /// Adds a dot, filled or open.
    pub fn dot(&mut self, mark: Mark, (x, y): (f64, f64), radius: f64, is_filled: bool) {
        let class = if is_filled { "fill" } else { "open" };
        let path = |places: &[(f64, f64)]| {
            let place = |&(across, down): &(f64, f64)| {
                format!("{} {}", At(x + across * radius), At(y + down * radius))
            };
            let places: Vec<String> = places.iter().map(place).collect();
            format!("<path class=\"{class}\" d=\"M{}z\"/>", places.join("L"))
        };
        let element = match mark {
            Mark::Circle => {
                let [x, y, radius] = [x, y, radius].map(At);
                format!("<circle class=\"{class}\" cx=\"{x}\" cy=\"{y}\" r=\"{radius}\"/>")
            }
            Mark::Square => path(&[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)]),
            Mark::Diamond => path(&[(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)]),
            Mark::Up => path(&[(0.0, -1.2), (1.2, 0.9), (-1.2, 0.9)]),
            Mark::Down => path(&[(0.0, 1.2), (1.2, -0.9), (-1.2, -0.9)]),
            Mark::Cross => {
                let [left, right, top, bottom] =
                    [x - radius, x + radius, y - radius, y + radius].map(At);
                format!(
                    "<path class=\"stroke\" stroke-width=\"2.2\" d=\"M{left} {top}L{right} {bottom}M{left} {bottom}L{right} {top}\"/>"
                )
            }
        };
        self.raw(&element);
    }

    /// Adds a line of text, vertically centred on `place`.
    pub fn text(&mut self, class: &str, place: (f64, f64), size: f64, anchor: Anchor, text: &str) {
        let [x, y] = [At(place.0), At(place.1 + 0.36 * size)];
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        let text = escape(&one_line(text));
        self.raw(&format!(
            "<text class=\"{class}\" x=\"{x}\" y=\"{y}\" font-size=\"{size}\"{anchor}>{text}</text>"
        ));
    }

    /// Adds lines of text from `(x, y)` on, `height` apart. Returns the y below the last.
    pub fn lines(
        &mut self,
        class: &str,
        (x, mut y): (f64, f64),
        (size, height): (f64, f64),
        anchor: Anchor,
        lines: &[String],
    ) -> f64 {
        for line in lines {
            self.text(class, (x, y + height / 2.0), size, anchor, line);
            y += height;
        }
        y
    }

    /// The document, with this `size` and `title` (for screen readers).
    #[must_use]
    pub fn document(self, size: (f64, f64), title: &str) -> String {
        let [width, height] = [size.0, size.1].map(|side| At(side.ceil()));
        let title = escape(&one_line(title));
        let mut document = String::new();
        let head = write!(
            document,
            "<svg width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             xmlns=\"http://www.w3.org/2000/svg\" {MARK} role=\"img\"><title>{title}</title>\
             <style>{SHEET}</style>\n\
             <rect class=\"paper\" width=\"{width}\" height=\"{height}\"/>\n"
        );
        debug_assert!(head.is_ok(), "a string takes everything");
        document + &self.body + "</svg>\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_as_wide_as_its_letters() {
        assert!((text_width("10", 10.0) - 2.0 * 5.56 * SLACK).abs() < 1e-9);
        assert!(text_width("iii", 10.0) < text_width("mmm", 10.0) / 3.0);
        assert!(text_width("α", 10.0) > text_width("i", 10.0));
    }

    #[test]
    fn lines_are_broken_between_words() {
        let width = text_width("one two", 10.0);
        assert_eq!(wrapped("one two three", 10.0, width), ["one two", "three"]);
        assert_eq!(wrapped("incomprehensible", 10.0, 1.0), ["incomprehensible"]);
    }

    #[test]
    fn coordinates_are_short_and_never_minus_zero() {
        let texts = [1.0, 0.26, -0.04, -1.5].map(|value| At(value).to_string());
        assert_eq!(texts, ["1", "0.3", "0", "-1.5"]);
    }

    #[test]
    fn texts_are_escaped() {
        let mut svg = Svg::default();
        svg.text("ink", (0.0, 0.0), 10.0, Anchor::Start, "a <b>\u{1}& c");
        let document = svg.document((1.0, 1.0), "<t>");
        assert!(
            document.contains(">a &lt;b&gt; &amp; c</text>"),
            "{document}"
        );
        assert!(document.contains("<title>&lt;t&gt;</title>"));
    }
}
