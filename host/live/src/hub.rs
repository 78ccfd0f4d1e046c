//! What is known now, for all pages: bounded, however many events come.

mod frame;
mod pages;
mod pixels;
#[cfg(feature = "foxglove")]
mod seen;
mod slice;
#[cfg(test)]
mod tests;

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use serde::Serialize;

use dtof_core::RangeScale;
use dtof_device::{HistogramAnswer, Setup};
use dtof_engine::look::look;
use dtof_engine::settings::Settings;
use dtof_engine::settings::SettingsFile;
use dtof_events::aer_file::{Event, Header};

use super::outputs::Recorded;
pub use frame::MOST_PIXELS;
use pages::Pages;
pub use pages::{MOST_EVENTS, MOST_PAGES, Page};
#[cfg(feature = "foxglove")]
pub use pixels::Pixel;
use pixels::Pixels;
#[cfg(feature = "foxglove")]
pub use seen::{Seen, Wanted};
use slice::Slice;

/// Where events come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// A device, which takes commands and gives histograms.
    Device,
    /// A recording, which can be stopped and played again.
    Recording,
}

/// How the source is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Connection {
    /// In a word: `opening`, `live`, `stopped`, `gone`, `playing`, `paused`, `ended`, `failed`.
    pub state: &'static str,
    /// Why.
    pub reason: String,
    /// How often it has come back.
    pub returned: u64,
}

/// What was lost, and rates, as the device says.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Losses {
    /// Laser cycles since the settings are in force.
    pub cycles: u64,
    /// Photons since then.
    pub photons: u64,
    /// Photons a second.
    pub photon_rate: f64,
    /// Each loss by its name, also those that are 0.
    pub counts: Vec<(&'static str, u64)>,
    /// The last error of the sensor.
    pub last_fault: Option<String>,
}

/// A histogram for pages that look at its pixel.
#[derive(Debug)]
struct Shot {
    /// As JSON.
    text: String,
    number: u64,
}

struct State {
    name: String,
    kind: Kind,
    /// Changes with what [`frame`] tells once: array and settings.
    version: u64,
    /// None before laser cycles begin.
    header: Option<Header>,
    settings: Option<(SettingsFile, Settings)>,
    /// What was said of settings before any were in force.
    said: SettingsFile,
    scale: Option<RangeScale>,
    connection: Connection,
    pixels: Pixels,
    pages: Pages,
    /// For those who are sent points, if there are any.
    slice: Option<Slice>,
    /// Events since the beginning, and of these those of masked pixels.
    events: u64,
    masked: u64,
    rate: Rate,
    losses: Losses,
    recorded: Recorded,
    /// The last histogram of each pixel that a page looks at.
    shots: Vec<(u16, Shot)>,
    shot: u64,
    /// Laser cycle and second of a recording.
    seconds: f64,
}

/// Events a second, over about a second.
struct Rate {
    since: Instant,
    events: u64,
    per_second: f64,
}

/// What is known now. A lock is held for a batch of events, or for a frame of a page.
pub struct Hub(Mutex<State>);

impl Hub {
    /// Nothing yet, of a source of this name.
    #[must_use]
    pub fn new(name: String, kind: Kind) -> Self {
        Self(Mutex::new(State {
            name,
            kind,
            version: 1,
            header: None,
            settings: None,
            said: SettingsFile::default(),
            scale: None,
            connection: Connection {
                state: "opening",
                reason: String::new(),
                returned: 0,
            },
            pixels: Pixels::default(),
            pages: Pages::default(),
            slice: None,
            events: 0,
            masked: 0,
            rate: Rate {
                since: Instant::now(),
                events: 0,
                per_second: 0.0,
            },
            losses: Losses::default(),
            recorded: Recorded::default(),
            shots: Vec::new(),
            shot: 0,
            seconds: 0.0,
        }))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Each change is whole before anything can fail.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Settings that are to be put in force.
    pub(super) fn said(&self, said: &SettingsFile) {
        let mut state = self.state();
        state.version += 1;
        state.said = said.clone();
    }

    /// Settings are in force: laser cycles begin at 0.
    pub(super) fn begin(&self, setup: &Setup) {
        let mut state = self.state();
        state.begin(setup.header());
        state.settings = Some((setup.said.clone(), setup.settings.clone()));
    }

    /// A recording begins.
    pub(super) fn begin_recording(&self, header: Header) {
        self.state().begin(header);
    }

    /// How the source is now.
    pub(super) fn connection(&self, state: &'static str, reason: &str) {
        let mut all = self.state();
        let connection = &mut all.connection;
        connection.returned += u64::from(connection.state == "gone" && state == "live");
        connection.state = state;
        connection.reason = reason.to_owned();
    }

    /// Takes all events in, of which so many more were of masked pixels.
    pub(super) fn events(&self, events: &[Event], masked: u64) {
        if events.is_empty() && masked == 0 {
            return;
        }
        let mut state = self.state();
        let state = &mut *state;
        state.events += events.len() as u64;
        state.masked += masked;
        let (Some(header), Some(scale)) = (&state.header, &state.scale) else {
            return;
        };
        for event in events {
            let range_mm: f64 = scale.range(event.position()).to_num();
            #[allow(clippy::cast_possible_truncation, reason = "24 bits for a picture")]
            let range_mm = range_mm as f32;
            state.pixels.add(event, range_mm, header.array);
            state.pages.add(event, range_mm, header.array);
            if let Some(slice) = &mut state.slice {
                slice.add(event);
            }
        }
    }

    /// Where a recording is.
    pub(super) fn at(&self, seconds: f64) {
        self.state().seconds = seconds;
    }

    pub(super) fn losses(&self, losses: Losses) {
        self.state().losses = losses;
    }

    pub(super) fn recorded(&self, recorded: &Recorded) {
        let mut state = self.state();
        if state.recorded != *recorded {
            state.recorded = recorded.clone();
        }
    }

    /// The pixels whose histograms somebody looks at, each once.
    pub(super) fn watched(&self) -> Vec<u16> {
        self.state().pages.watched()
    }

    /// The answer to a request for a histogram.
    pub(super) fn histogram(&self, answer: &HistogramAnswer) {
        let mut state = self.state();
        let state = &mut *state;
        let watched = state.pages.watched();
        state.shots.retain(|(pixel, _)| watched.contains(pixel));
        let (pixel, text) = match answer {
            Ok(histogram) => {
                let settings = state.settings.as_ref();
                let seen = settings.and_then(|(_, settings)| {
                    look(settings, &histogram.counts, histogram.head.is_whole)
                });
                let text = frame::histogram(histogram, seen.as_ref());
                (histogram.head.pixel.0, text)
            }
            Err((pixel, none)) => (pixel.0, frame::no_histogram(pixel.0, &none.to_string())),
        };
        if !watched.contains(&pixel) {
            return;
        }
        state.shot += 1;
        let number = state.shot;
        state.shots.retain(|(other, _)| *other != pixel);
        state.shots.push((pixel, Shot { text, number }));
    }

    /// A page opens, looking at a pixel; `None` if [`MOST_PAGES`] are open.
    #[must_use]
    pub fn join(&self, pixel: u16) -> Option<Page> {
        self.state().pages.join(pixel)
    }

    /// A page looks at another pixel. Says whether there is such a page.
    pub fn watch(&self, page: u64, pixel: u16) -> bool {
        self.state().pages.watch(page, pixel)
    }

    /// A page has closed.
    pub fn leave(&self, page: &Page) {
        self.state().pages.leave(page);
    }

    /// What has changed for a page since its last frame, as JSON.
    #[must_use]
    pub fn frame(&self, page: &mut Page) -> String {
        self.state().frame(page)
    }

    /// Pages that are open.
    #[must_use]
    pub fn pages(&self) -> usize {
        self.state().pages.len()
    }

    /// Events since the beginning.
    #[must_use]
    pub fn arrived(&self) -> u64 {
        self.state().events
    }

    /// Things that are kept for pages: pixels, then events and histograms that wait. All are
    /// bounded.
    #[must_use]
    pub fn kept(&self) -> [usize; 3] {
        let state = self.state();
        let [pixels, shots] = [state.pixels.len(), state.shots.len()];
        let events = state.pages.kept() + state.slice.as_ref().map_or(0, Slice::len);
        [pixels, events, shots]
    }
}

impl State {
    fn begin(&mut self, header: Header) {
        self.version += 1;
        // Of other settings or another device: nothing of before holds.
        self.pixels = Pixels::new(header.array);
        self.pages.restart();
        if let Some(slice) = &mut self.slice {
            slice.restart(self.pixels.len());
        }
        self.header = Some(header);
        self.scale = RangeScale::new(header.bin_width_ps, header.offset_mm).ok();
        self.losses = Losses::default();
        self.seconds = 0.0;
        self.shots.clear();
    }

    /// Events a second.
    fn rate(&mut self) -> f64 {
        let elapsed = self.rate.since.elapsed().as_secs_f64();
        if elapsed >= 1.0 {
            self.rate.per_second = (self.events - self.rate.events) as f64 / elapsed;
            self.rate.since = Instant::now();
            self.rate.events = self.events;
        }
        self.rate.per_second
    }
}
