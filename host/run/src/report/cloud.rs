//! The events of a run as an interactive cloud: its script and the data for it.

use std::sync::LazyLock;

use serde_json::{Value, json};

use super::histograms::Decisions;
use super::{FEW, capitalised, events, shared};
use dtof_core::{Array, PixelAddress};
use dtof_data::events::clock::LaserClock;
use dtof_data::events::sample::Sample;
use dtof_data::options::rows::grouped;
use dtof_draw::picture;

/// The fewest events of a page, even if figures leave no room for them.
const MIN_EVENTS: usize = 4096;

/// The events of a run.
#[derive(Debug)]
pub struct Cloud<'a> {
    /// The array.
    pub array: Array,
    /// The names of its columns and rows.
    pub axis_names: [&'a str; 2],
    /// Laser cycles of the run.
    pub cycles: u64,
    /// Laser cycles a second, if that is known.
    pub laser_hz: Option<u64>,
    /// The events, or an even sample. Thinned further if there is no room for all.
    pub sample: &'a mut Sample,
    /// Whether the sample has one echo of each exposure. Otherwise the first echo is the range of a pixel.
    pub is_chosen: bool,
    /// Pixels whose spikes are shown first.
    pub pixels: &'a [PixelAddress],
    /// The name of an event, and its plural.
    pub nouns: [&'static str; 2],
    /// The histograms of the last events, if they were kept.
    pub decisions: Option<Decisions<'a>>,
}

/// The modules of the page beside the shared ones.
const MODULES: [shared::Module; 8] = [
    module!("page/decisions.js"),
    module!("page/decode.js"),
    module!("page/events.js"),
    module!("page/history.js"),
    module!("page/main.js"),
    module!("page/pixel.js"),
    module!("page/run.js"),
    module!("page/spikes.js"),
];

/// The only script of the page, without its tags; a module.
pub(super) static SCRIPT: LazyLock<String> = LazyLock::new(|| {
    let modules = [&MODULES[..], &shared::MODULES].concat();
    let script = shared::bundle("run/src/report/page/main.js", &modules);
    format!("\n{}", script.expect("modules that fit together"))
});

/// The elements that the script fills, hidden until it runs.
const CARDS: &str = include_str!("cloud.html");

impl Cloud<'_> {
    /// The cards with the events and the spikes; empty without events. Events and histograms take at most
    /// `room` bytes, unless the fewest events take more.
    pub(super) fn html(self, room: usize) -> String {
        if self.sample.events().len() == 0 {
            return String::new();
        }
        // At most a third of the room.
        let histograms = self.decisions.map(|decisions| decisions.data(room / 3));
        let (histograms, taken) = histograms.unzip();
        let room = room.saturating_sub(taken.unwrap_or(0));
        let mut packed = events::packed(self.sample);
        let mut count = self.sample.events().len();
        while packed.len() > room && count > MIN_EVENTS {
            self.sample.limit(count - 1);
            count = self.sample.events().len();
            packed = events::packed(self.sample);
        }
        let data = self.data(&packed.base64(), histograms.as_ref());
        let note = self.note();
        let ([_, events], script) = (self.nouns, &*SCRIPT);
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
                .replace("{{event}}", self.nouns[0])
                .replace("{{events}}", events)
                .replace("{{Events}}", &capitalised(events))
        )
    }

    /// Whether there are so few pixels that plots show more than a map.
    fn is_few(&self) -> bool {
        self.array.pixels() as usize <= FEW
    }

    /// The laser rate that times are based on.
    fn laser(&self) -> String {
        match self.laser_hz.and_then(|hz| LaserClock::new(hz).ok()) {
            Some(laser) => format!("Times are those of a laser of {laser}."),
            None => format!(
                "<strong>The laser rate is not known</strong>: times are for {}, unless --laser-hz \
                 sets another.",
                LaserClock::default()
            ),
        }
    }

    /// The number of events, and how many are shown.
    fn note(&self) -> String {
        let seen = grouped(self.sample.seen());
        let [_, events] = self.nouns;
        match self.sample.one_of() {
            1 => format!("All {seen} {events} are shown."),
            k => format!(
                "<strong>1 of {} {events} shown</strong>: {} of {seen}, evenly spread.",
                grouped(k),
                grouped(self.sample.events().len() as u64)
            ),
        }
    }

    /// The data as a JSON object. It is safe between tags: numbers, base64 and names of this program.
    fn data(&self, packed: &str, histograms: Option<&Value>) -> Value {
        let ranges: Vec<_> = self
            .sample
            .events()
            .map(|event| Some(event.range_mm))
            .collect();
        let (low, high) = picture::span(&ranges).unwrap_or_default();
        let spikes: Vec<u16> = self.pixels.iter().map(|pixel| pixel.raw()).collect();
        json!({
            "columns": self.array.columns(),
            "rows": self.array.rows(),
            "sides": self.axis_names,
            "cycles": self.cycles,
            "laserHz": self.laser_hz.unwrap_or(LaserClock::PAPER_HZ),
            "oneOf": self.sample.one_of(),
            "isChosen": self.is_chosen,
            "isFew": self.is_few(),
            "low": low,
            "high": high,
            "spikes": spikes,
            "event": self.nouns[0],
            "events": self.nouns[1],
            "count": self.sample.events().len(),
            "packed": packed,
            "histograms": histograms,
        })
    }
}
