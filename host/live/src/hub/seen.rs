//! What is known now, for messages to those who are no pages.

use dtof_core::RangeScale;

use super::pixels::Pixel;
use super::slice::Slice;
use super::{Connection, Hub, Losses};
use dtof_engine::settings::Rays;
use dtof_events::aer_file::{Event, Header};
use dtof_export::foxglove::Statistics;

/// What somebody wants to see.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wanted {
    /// Events, and counts of them.
    pub events: bool,
    /// Pixels, if they have changed since this change.
    pub pixels: Option<u64>,
}

/// What is known now.
pub struct Seen {
    /// Changes with array and settings.
    pub version: u64,
    pub name: String,
    /// None before laser cycles begin.
    pub header: Option<Header>,
    pub scale: Option<RangeScale>,
    pub rays: Rays,
    pub connection: Connection,
    pub losses: Losses,
    /// Why recording ended by itself.
    pub recording_error: String,
    /// Where a recording is.
    pub seconds: f64,
    /// All events since the beginning, and of these those of masked pixels.
    pub arrived: u64,
    pub masked: u64,
    /// Events since it was asked last, the counts of all, and how many were left out.
    pub events: Vec<Event>,
    pub statistics: Statistics,
    pub left_out: u64,
    /// All pixels, and the number of their last change.
    pub pixels: Option<(Vec<Pixel>, u64)>,
}

impl Hub {
    /// What is known now. Events are kept for the next time as long as they are wanted.
    pub(crate) fn seen(&self, wanted: Wanted) -> Seen {
        let mut state = self.state();
        let state = &mut *state;
        let (events, statistics, left_out) = match &mut state.slice {
            Some(slice) => slice.take(),
            None => <_>::default(),
        };
        if !wanted.events {
            state.slice = None;
        } else if state.slice.is_none() {
            state.slice = Some(Slice::new(state.pixels.len()));
        }
        let said = match &state.settings {
            Some((said, _)) => said,
            None => &state.said,
        };
        let changes = state.pixels.changes();
        let pixels = wanted.pixels.filter(|&known| known != changes);
        Seen {
            version: state.version,
            name: state.name.clone(),
            header: state.header,
            scale: state.scale,
            rays: said.rays.clone(),
            connection: state.connection.clone(),
            losses: state.losses.clone(),
            recording_error: state.recorded.error.clone(),
            seconds: state.seconds,
            arrived: state.events,
            masked: state.masked,
            events,
            statistics,
            left_out,
            pixels: pixels.map(|_| (state.pixels.all().to_vec(), changes)),
        }
    }
}
