//! A snapshot of the state, for messages to Foxglove.

use super::pending::PendingEvents;
use super::pixels::PixelState;
use super::{Connection, Hub, Losses};
use dtof_data::events::aer_file::{Event, Header};
use dtof_data::photons::ranges::Ranges;
use dtof_engine::settings::RaySettings;
use dtof_run::export::foxglove::Statistics;

/// The current state.
pub struct Snapshot {
    /// Changes with array and settings.
    pub version: u64,
    pub name: String,
    /// `None` before laser cycles begin.
    pub header: Option<Header>,
    pub ranges: Option<Ranges>,
    pub rays: RaySettings,
    pub connection: Connection,
    pub losses: Losses,
    /// Why recording has ended by itself.
    pub recording_error: String,
    /// Playback time of a recording.
    pub seconds: f64,
    /// Events since the start, and events of masked pixels.
    pub arrived: u64,
    pub masked: u64,
    /// Events since the last snapshot, the counts of all events, and the number of dropped ones.
    pub events: Vec<Event>,
    pub statistics: Statistics,
    pub dropped: u64,
    /// All pixels, and the number of their last change.
    pub pixels: Option<(Vec<PixelState>, u64)>,
}

impl Hub {
    /// Takes a snapshot. With `collects_events` the next one has the events until then. It has the
    /// pixels if their last change is not `known_change`; with `None` it has none.
    pub(crate) fn snapshot(&self, collects_events: bool, known_change: Option<u64>) -> Snapshot {
        let mut state = self.state();
        let state = &mut *state;
        let (events, statistics, dropped) = match &mut state.pending {
            Some(pending) => pending.take(),
            None => <_>::default(),
        };
        if !collects_events {
            state.pending = None;
        } else if state.pending.is_none() {
            state.pending = Some(PendingEvents::new(state.pixels.len()));
        }
        let file = match &state.settings {
            Some((file, _)) => file,
            None => &state.requested,
        };
        let changes = state.pixels.changes();
        let pixels = known_change.filter(|&known| known != changes);
        Snapshot {
            version: state.version,
            name: state.name.clone(),
            header: state.header.clone(),
            ranges: state.ranges.clone(),
            rays: file.rays.clone(),
            connection: state.connection.clone(),
            losses: state.losses.clone(),
            recording_error: state.recording.error.clone(),
            seconds: state.playhead.seconds,
            arrived: state.events,
            masked: state.masked,
            events,
            statistics,
            dropped,
            pixels: pixels.map(|_| (state.pixels.all().to_vec(), changes)),
        }
    }
}
