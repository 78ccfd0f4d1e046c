//! The events of a run, to turn and to look at in time: what the script of the page
//! is given, and the script.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde_json::json;

use crate::events::sample::Sample;
use crate::input::source::Geometry;
use crate::rows::grouped;
use dtof_core::PixelAddress;
use dtof_draw::{palette, picture};

/// The events of a run.
#[derive(Clone, Copy, Debug)]
pub struct Cloud<'a> {
    /// The array.
    pub geometry: Geometry,
    /// The names of its columns and rows.
    pub sides: [&'a str; 2],
    /// Laser cycles of the run.
    pub cycles: u64,
    /// The events, or evenly some of them.
    pub sample: &'a Sample,
    /// Pixels whose spikes are shown first.
    pub pixels: &'a [PixelAddress],
    /// Their name: one of them, and several.
    pub called: [&'static str; 2],
}

/// The only script of the page, between its tags. A module: it has names of its own.
pub(super) const SCRIPT: &str = concat!(
    "\n",
    include_str!("helpers.js"),
    "\n",
    include_str!("events.js"),
    "\n",
    include_str!("projection.js"),
    "\n",
    include_str!("cloud.js"),
    "\n",
    include_str!("spikes.js"),
    "\n",
    include_str!("turn.js"),
    "\n",
    include_str!("controls.js"),
);

/// The elements of the script, hidden until it runs.
const CARDS: &str = include_str!("cloud.html");

impl Cloud<'_> {
    /// The cards with the events and the spikes, nothing if there are no events.
    pub(super) fn html(&self) -> String {
        if self.sample.events().len() == 0 {
            return String::new();
        }
        let data = self.data();
        let note = self.note();
        let [_, events] = self.called;
        format!(
            "<p class=\"notice\" id=\"unscripted\">Without scripting the {events} cannot be \
             turned; the maps below show them pixel by pixel.</p>\n\
             {}<script type=\"application/json\" id=\"data\">{data}</script>\n\
             <script type=\"module\">{SCRIPT}</script>\n",
            CARDS
                .replace("{{how many}}", &note)
                .replace("{{events}}", events)
                .replace("{{Events}}", &capital(events))
        )
    }

    /// How many events there are, and how many of them are shown.
    fn note(&self) -> String {
        let seen = grouped(self.sample.seen());
        let [_, events] = self.called;
        match self.sample.one_of() {
            1 => format!("All {seen} {events} are shown."),
            k => format!(
                "<strong>1 of {} {events} shown</strong>: {} of {seen}, evenly spread.",
                grouped(k),
                grouped(self.sample.events().len() as u64)
            ),
        }
    }

    /// One JSON object, safe between tags: it holds numbers and base64 alone.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a unit is chosen that fits"
    )]
    fn data(&self) -> serde_json::Value {
        // Laser cycles of a run beyond 2³² are told in a larger unit.
        let unit = (self.cycles >> 32) + 1;
        let mut records = Vec::with_capacity(self.sample.events().len() * RECORD);
        for event in self.sample.events() {
            records.extend(((event.cycle / unit) as u32).to_le_bytes());
            records.extend(event.range_mm.to_le_bytes());
            records.extend(event.pixel.0.to_le_bytes());
            records.push(event.level.raw() << 4 | event.echo.raw());
        }
        let colours: String = (0..=u8::MAX)
            .map(|level| {
                let [red, green, blue] = palette::level(level);
                format!("{red:02x}{green:02x}{blue:02x}")
            })
            .collect();
        let ranges: Vec<_> = self
            .sample
            .events()
            .map(|event| Some(event.range_mm.into()))
            .collect();
        let (low, high) = picture::span(&ranges).unwrap_or_default();
        let spikes: Vec<u16> = self.pixels.iter().map(|pixel| pixel.0).collect();
        json!({
            "columns": self.geometry.columns,
            "rows": self.geometry.rows,
            "sides": self.sides,
            "cycles": self.cycles,
            "unit": unit,
            "oneOf": self.sample.one_of(),
            "low": low,
            "high": high,
            "colours": colours,
            "spikes": spikes,
            "events": self.called[1],
            "records": BASE64.encode(records),
        })
    }
}

/// `word` at the start of a sentence.
fn capital(word: &str) -> String {
    let mut letters = word.chars();
    let first = letters.next().map(|first| first.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}

/// Bytes of an event: laser cycle, range in millimetres, pixel, all little-endian, then four
/// bits each for level and echo.
pub(super) const RECORD: usize = 4 + 4 + 2 + 1;
