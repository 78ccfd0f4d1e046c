//! The events of a run, to turn and to look at in time: what the script of the page
//! is given, and the script.

use std::sync::LazyLock;

use serde_json::{Value, json};

use super::histograms::Decisions;
use super::{FEW, events, shared};
use dtof_core::{Array, PixelAddress};
use dtof_draw::{palette, picture};
use dtof_events::clock::LaserClock;
use dtof_events::sample::Sample;
use dtof_options::rows::grouped;

/// There are events even where figures leave no room for any.
const LEAST_EVENTS: usize = 4096;

/// The events of a run.
#[derive(Debug)]
pub struct Cloud<'a> {
    /// The array.
    pub array: Array,
    /// The names of its columns and rows.
    pub sides: [&'a str; 2],
    /// Laser cycles of the run.
    pub cycles: u64,
    /// Laser cycles a second, if that is known.
    pub laser_hz: Option<u64>,
    /// The events, or evenly some of them. Fewer if there is no room for all.
    pub sample: &'a mut Sample,
    /// Whether one echo of each exposure was chosen: then all of them are the range of a pixel,
    /// else the first.
    pub is_chosen: bool,
    /// Pixels whose spikes are shown first.
    pub pixels: &'a [PixelAddress],
    /// Their name: one of them, and several.
    pub called: [&'static str; 2],
    /// What the last events were decided from, if that was seen.
    pub decisions: Option<Decisions<'a>>,
}

/// The only script of the page, between its tags. A module: it has names of its own.
pub(super) static SCRIPT: LazyLock<String> = LazyLock::new(|| {
    let own = [
        include_str!("spikes.js"),
        include_str!("pixel.js"),
        include_str!("controls.js"),
    ];
    let script = shared::script(include_str!("events.js"), &own);
    format!("\n{script}")
});

/// The elements of the script, hidden until it runs.
const CARDS: &str = include_str!("cloud.html");

impl Cloud<'_> {
    /// The cards with the events and the spikes, nothing if there are no events. Events and
    /// histograms take at most so many bytes of `room`, unless the fewest events take more.
    pub(super) fn html(self, room: usize) -> String {
        if self.sample.events().len() == 0 {
            return String::new();
        }
        // A third of the room, at most.
        let histograms = self.decisions.map(|decisions| decisions.data(room / 3));
        let (histograms, taken) = histograms.unzip();
        let room = room.saturating_sub(taken.unwrap_or(0));
        let mut packed = events::packed(self.sample);
        let mut count = self.sample.events().len();
        while packed.len() > room && count > LEAST_EVENTS {
            self.sample.limit(count - 1);
            count = self.sample.events().len();
            packed = events::packed(self.sample);
        }
        let data = self.data(&packed.base64(), histograms.as_ref());
        let note = self.note();
        let ([_, events], script) = (self.called, &*SCRIPT);
        let instead = match self.is_few() {
            true => "the table below has each pixel",
            false => "the maps below show them pixel by pixel",
        };
        format!(
            "<p class=\"notice\" id=\"unscripted\">Without scripting the {events} cannot be \
             turned; {instead}.</p>\n\
             {}<script type=\"application/json\" id=\"data\">{data}</script>\n\
             <script type=\"module\">{script}</script>\n",
            CARDS
                .replace("{{how many}}", &note)
                .replace("{{laser}}", &self.laser())
                .replace("{{event}}", self.called[0])
                .replace("{{events}}", events)
                .replace("{{Events}}", &capital(events))
        )
    }

    /// Whether plots show more than a map.
    fn is_few(&self) -> bool {
        self.array.pixels() as usize <= FEW
    }

    /// Where times come from.
    fn laser(&self) -> String {
        match self.laser_hz.and_then(|hz| LaserClock::new(hz).ok()) {
            Some(laser) => format!("Times are those of a laser of {laser}."),
            None => format!(
                "<strong>The laser rate is not known</strong>: times are for {}, unless --laser-hz \
                 says another.",
                LaserClock::default()
            ),
        }
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

    /// One JSON object, safe between tags: it holds numbers, base64 and names of this program.
    fn data(&self, packed: &str, histograms: Option<&Value>) -> Value {
        let colours: String = (0..=u8::MAX)
            .map(|level| {
                let [red, green, blue] = palette::level(level);
                format!("{red:02x}{green:02x}{blue:02x}")
            })
            .collect();
        let ranges: Vec<_> = self
            .sample
            .events()
            .map(|event| Some(event.range_mm))
            .collect();
        let (low, high) = picture::span(&ranges).unwrap_or_default();
        let spikes: Vec<u16> = self.pixels.iter().map(|pixel| pixel.0).collect();
        json!({
            "columns": self.array.columns(),
            "rows": self.array.rows(),
            "sides": self.sides,
            "cycles": self.cycles,
            "laserHz": self.laser_hz.unwrap_or(LaserClock::PAPER_HZ),
            "oneOf": self.sample.one_of(),
            "isChosen": self.is_chosen,
            "isFew": self.is_few(),
            "low": low,
            "high": high,
            "colours": colours,
            "spikes": spikes,
            "event": self.called[0],
            "events": self.called[1],
            "count": self.sample.events().len(),
            "packed": packed,
            "histograms": histograms,
        })
    }
}

/// `word` at the start of a sentence.
fn capital(word: &str) -> String {
    let mut letters = word.chars();
    let first = letters.next().map(|first| first.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}
