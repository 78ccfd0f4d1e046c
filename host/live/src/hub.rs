//! The current state, shared by all pages. Its memory is bounded.

mod frame;
mod pages;
mod pending;
mod pixels;
#[cfg(feature = "foxglove")]
mod snapshot;
#[cfg(test)]
mod tests;

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use serde::Serialize;

use dtof_data::events::aer_file::{Event, Header};
use dtof_data::photons::ranges::Ranges;
use dtof_device::{HistogramAnswer, Setup};
use dtof_engine::explain::explain;
use dtof_engine::settings::Settings;
use dtof_engine::settings::SettingsFile;

use super::outputs::RecordingStatus;
pub use frame::MOST_PIXELS;
use pages::Pages;
pub use pages::{MOST_EVENTS, MOST_PAGES, Page};
use pending::PendingEvents;
#[cfg(feature = "foxglove")]
pub use pixels::PixelState;
use pixels::Pixels;
#[cfg(feature = "foxglove")]
pub use snapshot::Snapshot;

/// Where events come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// A device, which takes commands and sends histograms.
    Device,
    /// A recording, which can be paused and played again.
    Recording,
}

/// The state of the source.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Connection {
    /// One of `opening`, `live`, `stopped`, `gone`, `playing`, `paused`, `ended`, `failed`.
    pub state: &'static str,
    /// The reason, if any.
    pub reason: String,
    /// How often the device has come back.
    pub returned: u64,
}

/// Losses and rates, from the device's reports.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Losses {
    /// Laser cycles since the settings were applied.
    pub cycles: u64,
    /// Photons since then.
    pub photons: u64,
    /// Photons a second.
    pub photon_rate: f64,
    /// Each loss with its name, also those of 0.
    pub counts: Vec<(&'static str, u64)>,
    /// The last error of the sensor.
    pub last_fault: Option<String>,
}

/// Where the playback of a recording is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Playhead {
    /// Seconds of the recording that have been played.
    pub seconds: f64,
    /// Seconds to its last event.
    pub length: f64,
    /// Times as fast as it was recorded.
    pub speed: f64,
    /// Events that have been played.
    pub events: u64,
    /// Events of the recording.
    pub all: u64,
}

/// The last histogram of a pixel that a page shows.
#[derive(Debug)]
struct LastHistogram {
    pixel: u16,
    json: String,
    number: u64,
}

struct State {
    name: String,
    kind: Kind,
    /// Changes with array and settings, which a page is sent once.
    version: u64,
    /// `None` before laser cycles begin.
    header: Option<Header>,
    settings: Option<(SettingsFile, Settings)>,
    /// The options, shown until settings are applied.
    requested: SettingsFile,
    ranges: Option<Ranges>,
    connection: Connection,
    pixels: Pixels,
    pages: Pages,
    /// Events for point clouds, if a client subscribes to them.
    pending: Option<PendingEvents>,
    /// Events since the start, and events of masked pixels.
    events: u64,
    masked: u64,
    rate: Rate,
    losses: Losses,
    recording: RecordingStatus,
    histograms: Vec<LastHistogram>,
    /// Histograms so far.
    histogram_number: u64,
    playhead: Playhead,
    /// A page or a client of Foxglove has come.
    is_visited: bool,
}

/// Events a second, over about a second.
struct Rate {
    since: Instant,
    events: u64,
    per_second: f64,
}

/// The current state. It is locked for a batch of events, or for a frame of a page.
pub struct Hub(Mutex<State>);

impl Hub {
    /// The state of a source without events.
    #[must_use]
    pub fn new(name: String, kind: Kind) -> Self {
        Self(Mutex::new(State {
            name,
            kind,
            version: 1,
            header: None,
            settings: None,
            requested: SettingsFile::default(),
            ranges: None,
            connection: Connection {
                state: "opening",
                reason: String::new(),
                returned: 0,
            },
            pixels: Pixels::default(),
            pages: Pages::default(),
            pending: None,
            events: 0,
            masked: 0,
            rate: Rate {
                since: Instant::now(),
                events: 0,
                per_second: 0.0,
            },
            losses: Losses::default(),
            recording: RecordingStatus::default(),
            histograms: Vec::new(),
            histogram_number: 0,
            playhead: Playhead::default(),
            is_visited: false,
        }))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A panic leaves the state valid.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets the options, before settings are applied.
    pub(super) fn set_requested(&self, requested: &SettingsFile) {
        let mut state = self.state();
        state.version += 1;
        state.requested = requested.clone();
    }

    /// Begins with a new setup, at laser cycle 0.
    pub(super) fn begin(&self, setup: &Setup) {
        let mut state = self.state();
        state.begin(setup.header());
        state.settings = Some((setup.effective.clone(), setup.settings.clone()));
    }

    /// Begins to play a recording, at laser cycle 0.
    pub(super) fn begin_recording(&self, header: Header) {
        self.state().begin(header);
    }

    /// Sets the state of the source.
    pub(super) fn set_connection(&self, state: &'static str, reason: &str) {
        let mut all = self.state();
        let connection = &mut all.connection;
        connection.returned += u64::from(connection.state == "gone" && state == "live");
        connection.state = state;
        connection.reason = reason.to_owned();
    }

    /// Counts events of masked pixels.
    pub(super) fn add_masked(&self, events: u64) {
        self.state().masked += events;
    }

    /// Adds events.
    pub(super) fn add_events(&self, events: &[Event]) {
        let mut state = self.state();
        let state = &mut *state;
        state.events += events.len() as u64;
        let (Some(header), Some(ranges)) = (&state.header, &state.ranges) else {
            return;
        };
        for event in events {
            let range = ranges.of(event.pixel(), event.level(), event.position());
            let range_mm: f64 = range.to_num();
            #[allow(clippy::cast_possible_truncation, reason = "24 bits for a picture")]
            let range_mm = range_mm as f32;
            state.pixels.add(event, range_mm, header.array);
            state.pages.add(event, range_mm, header.array);
            if let Some(pending) = &mut state.pending {
                pending.add(event);
            }
        }
    }

    /// Sets where playback is.
    pub(super) fn set_playhead(&self, playhead: Playhead) {
        self.state().playhead = playhead;
    }

    /// Counts events a second anew from now on.
    pub(super) fn restart_rate(&self) {
        let mut state = self.state();
        (state.rate.since, state.rate.events) = (Instant::now(), state.events);
    }

    /// Returns whether a page or a client of Foxglove has come.
    pub(super) fn is_visited(&self) -> bool {
        self.state().is_visited
    }

    /// A page or a client of Foxglove has come.
    pub(super) fn set_visited(&self) {
        self.state().is_visited = true;
    }

    /// Sets losses and rates.
    pub(super) fn set_losses(&self, losses: Losses) {
        self.state().losses = losses;
    }

    /// Sets the status of the recorder.
    pub(super) fn set_recording(&self, recording: &RecordingStatus) {
        self.state().recording.clone_from(recording);
    }

    /// The pixels that pages show, each once.
    pub(super) fn watched(&self) -> Vec<u16> {
        self.state().pages.watched()
    }

    /// Adds the answer to a request for a histogram.
    pub(super) fn add_histogram(&self, answer: &HistogramAnswer) {
        let mut state = self.state();
        let state = &mut *state;
        let watched = state.pages.watched();
        let (pixel, json) = match answer {
            Ok(histogram) => {
                let settings = state.settings.as_ref();
                let look = settings.and_then(|(_, settings)| {
                    let head = &histogram.head;
                    explain(settings, &histogram.counts, head.exposure, head.is_whole)
                });
                let json = frame::histogram(histogram, look.as_ref());
                (histogram.head.pixel.raw(), json)
            }
            Err((pixel, none)) => (
                pixel.raw(),
                frame::no_histogram(pixel.raw(), &none.to_string()),
            ),
        };
        let histograms = &mut state.histograms;
        histograms.retain(|other| other.pixel != pixel && watched.contains(&other.pixel));
        if watched.contains(&pixel) {
            state.histogram_number += 1;
            let number = state.histogram_number;
            histograms.push(LastHistogram {
                pixel,
                json,
                number,
            });
        }
    }

    /// Opens a page that shows a pixel; `None` if [`MOST_PAGES`] are open.
    #[must_use]
    pub fn join(&self, pixel: u16) -> Option<Page> {
        self.set_visited();
        self.state().pages.join(pixel)
    }

    /// Makes a page show another pixel. Returns whether the page exists.
    pub fn watch(&self, page: u64, pixel: u16) -> bool {
        self.state().pages.watch(page, pixel)
    }

    /// Closes a page.
    pub fn leave(&self, page: &Page) {
        self.state().pages.leave(page);
    }

    /// The changes since a page's last frame, as JSON.
    #[must_use]
    pub fn frame(&self, page: &mut Page) -> String {
        self.state().frame(page)
    }

    /// Number of open pages.
    #[must_use]
    pub fn pages(&self) -> usize {
        self.state().pages.len()
    }

    /// Events since the start.
    #[must_use]
    pub fn arrived(&self) -> u64 {
        self.state().events
    }

    /// Numbers of pixels, of events that wait for pages, and of histograms in memory. All are
    /// bounded.
    #[must_use]
    pub fn memory(&self) -> [usize; 3] {
        let state = self.state();
        let [pixels, histograms] = [state.pixels.len(), state.histograms.len()];
        let events = state.pages.waiting() + state.pending.as_ref().map_or(0, PendingEvents::len);
        [pixels, events, histograms]
    }
}

impl State {
    fn begin(&mut self, header: Header) {
        self.version += 1;
        // Another device or other settings: earlier values do not hold.
        self.pixels = Pixels::new(header.array);
        self.pages.restart();
        if let Some(pending) = &mut self.pending {
            pending.restart(self.pixels.len());
        }
        self.ranges = header.ranges().ok();
        self.header = Some(header);
        self.losses = Losses::default();
        self.histograms.clear();
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
