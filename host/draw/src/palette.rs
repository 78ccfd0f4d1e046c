//! The colours of all pictures: one thing has the same colour and mark in each of them.
//!
//! Marks distinguish things without colour. Every colour has two shades, for a light and a dark
//! background; the style sheet follows the reader's colour scheme.

/// A colour of [`SHEET`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colour {
    /// For text.
    Ink,
    /// For less important parts.
    Soft,
    /// `c0`.
    Blue,
    /// `c1`.
    Orange,
    /// `c2`.
    Green,
    /// `c3`.
    Purple,
    /// `c4`.
    Pink,
    /// `c5`.
    Gold,
}

impl Colour {
    /// Its class in [`SHEET`].
    #[must_use]
    pub const fn class(self) -> &'static str {
        match self {
            Self::Ink => "ink",
            Self::Soft => "soft",
            Self::Blue => "c0",
            Self::Orange => "c1",
            Self::Green => "c2",
            Self::Purple => "c3",
            Self::Pink => "c4",
            Self::Gold => "c5",
        }
    }
}

/// The shape of a dot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// Round.
    Circle,
    /// A square.
    Square,
    /// A square on its corner.
    Diamond,
    /// A triangle that points up.
    Up,
    /// A triangle that points down.
    Down,
    /// Two crossed strokes.
    Cross,
}

/// The look of a series in a chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pen {
    /// Its colour.
    pub colour: Colour,
    /// The shape of its dots.
    pub mark: Mark,
}

const fn pen(colour: Colour, mark: Mark) -> Pen {
    Pen { colour, mark }
}

/// The paper's rule, and its centroid.
pub const PAPER: Pen = pen(Colour::Orange, Mark::Square);
/// The paper's rule over the average of all bins.
pub const AVERAGE: Pen = pen(Colour::Ink, Mark::Diamond);
/// Events in comparison with frames, and a single measured series.
pub const EVENTS: Pen = pen(Colour::Blue, Mark::Circle);
/// The centred window for the pulse.
pub const CENTRED: Pen = pen(Colour::Blue, Mark::Circle);
/// A reference: a bound, a frontier, a target.
pub const REFERENCE: Pen = pen(Colour::Soft, Mark::Cross);

/// A series without others of its kind.
pub const NEUTRAL: Pen = pen(Colour::Ink, Mark::Circle);

/// Pens for ascending values of a parameter.
pub const STEPS: [Pen; 7] = [
    pen(Colour::Gold, Mark::Up),
    pen(Colour::Green, Mark::Diamond),
    pen(Colour::Blue, Mark::Circle),
    pen(Colour::Purple, Mark::Down),
    pen(Colour::Pink, Mark::Cross),
    pen(Colour::Orange, Mark::Square),
    pen(Colour::Ink, Mark::Diamond),
];

/// A window rule, or a window, of this many bins: 1, 2, 3, 5 or 7.
#[must_use]
pub const fn window(bins: u8) -> Pen {
    STEPS[match bins {
        0 | 1 => 0,
        2 => 1,
        3 => 2,
        4 | 5 => 3,
        _ => 4,
    }]
}

/// A threshold of the paper's rule: 2, 3, 4, 5, 6 or 8. The paper uses 8.
#[must_use]
pub const fn alpha(alpha: u32) -> Pen {
    STEPS[match alpha {
        0..=2 => 0,
        3 => 1,
        4 => 4,
        5 => 3,
        6 | 7 => 6,
        _ => 5,
    }]
}

/// Frames of this many laser cycles: 100, 500, 1000 or 2000.
#[must_use]
pub const fn frames(cycles: u64) -> Pen {
    match cycles {
        0..=100 => STEPS[0],
        101..=500 => STEPS[1],
        501..=1000 => STEPS[3],
        _ => pen(Colour::Soft, Mark::Square),
    }
}

/// The colours of maps, from the lowest value to the highest: every seventh of viridis.
const VIRIDIS: [[u8; 3]; 8] = [
    [68, 1, 84],
    [70, 50, 127],
    [54, 92, 141],
    [39, 127, 143],
    [31, 162, 136],
    [74, 194, 110],
    [160, 219, 57],
    [254, 232, 37],
];

/// The colour of a level of a map: red, green and blue.
#[must_use]
pub fn level(level: u8) -> [u8; 3] {
    // Interpolates between 8 colours in integers.
    let place = u32::from(level) * 7;
    let (index, part) = (place / 255, place % 255);
    let at = |index: u32| VIRIDIS[(index as usize).min(VIRIDIS.len() - 1)];
    let (from, to) = (at(index), at(index + 1));
    std::array::from_fn(|channel| {
        let mixed = u32::from(from[channel]) * (255 - part) + u32::from(to[channel]) * part;
        u8::try_from((mixed + 127) / 255).unwrap_or(u8::MAX)
    })
}

/// The colour of pixels without an event.
pub const NO_EVENT: [u8; 3] = [0x84, 0x89, 0x90];

/// A colour as `#rrggbb`.
#[must_use]
pub fn hex([red, green, blue]: [u8; 3]) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// The style sheet of all pictures. The root element has the class `dtof`.
pub const SHEET: &str = include_str!("palette.css");

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance of a colour, 0 to 1.
    fn luminance(hex: &str) -> f64 {
        let channel = |at: usize| {
            let value = u8::from_str_radix(&hex[at..at + 2], 16).unwrap();
            let value = f64::from(value) / 255.0;
            if value <= 0.04045 {
                value / 12.92
            } else {
                ((value + 0.055) / 1.055).powf(2.4)
            }
        };
        0.2126 * channel(1) + 0.7152 * channel(3) + 0.0722 * channel(5)
    }

    /// WCAG requires a contrast of 3 for lines and dots, and 4.5 for text.
    #[test]
    fn every_colour_has_enough_contrast() {
        let (light, dark) = SHEET.split_once("@media").unwrap();
        for (sheet, paper) in [(light, "#ffffff"), (dark, "#0d1117")] {
            assert!(sheet.contains(&format!(".paper{{fill:{paper}}}")));
            let mut colours = 0;
            for rule in sheet
                .split(".dtof .")
                .filter(|rule| rule.contains("{color:"))
            {
                let hex = &rule[rule.find('#').unwrap()..][..7];
                let (a, b) = (luminance(hex), luminance(paper));
                let contrast = (a.max(b) + 0.05) / (a.min(b) + 0.05);
                assert!(contrast > 4.5, "{rule}: {contrast:.1}");
                colours += 1;
            }
            assert_eq!(colours, 8);
        }
    }

    #[test]
    fn levels_go_from_end_to_end() {
        assert_eq!(level(0), VIRIDIS[0]);
        assert_eq!(level(255), VIRIDIS[7]);
        assert_eq!(hex(level(127)), "#23908c");
    }
}
