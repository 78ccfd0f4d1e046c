//! The live data for Foxglove: what is sent, to whom, and what clients cannot do.

mod client;
mod clients;
mod nonsense;
mod protobuf;
mod sent;

use crate::common::Scratch;
use crate::common::aer::{HEADER, depth, file};
use client::Data;
use dtof_data::events::aer_file::{Event, Header};
use dtof_live::{Feed, Playback};
use protobuf::field;

/// 2026-01-02 03:04:05 UTC, in microseconds.
const START_US: i64 = 1_767_323_045_000_000;

/// Two seconds at one laser cycle a millisecond, which begin later than a client needs to
/// subscribe.
fn recording() -> (Header, Vec<Event>) {
    let header = Header {
        laser_millihertz: 1_000_000,
        start_us: START_US,
        ..HEADER
    };
    let events =
        (0..200).map(|number| depth(number, 1000 + 5 * u64::from(number), 40 + number % 50));
    (header, events.collect())
}

fn play(scratch: &Scratch, name: &str, header: &Header, events: &[Event]) -> Feed {
    let path = scratch.file(name, file(header, events));
    Feed::Playback(Playback::new(path, None, 1.0).unwrap())
}

/// All points of point clouds, 31 bytes each.
fn points<'a>(clouds: impl Iterator<Item = &'a [u8]>) -> Vec<Vec<u8>> {
    let records = clouds.flat_map(|cloud| {
        assert_eq!(field(cloud, 2).text(), "dtof_optical");
        assert_eq!(field(cloud, 4).number(), 31);
        let data = field(cloud, 6);
        data.bytes()
            .chunks(31)
            .map(<[u8]>::to_vec)
            .collect::<Vec<_>>()
    });
    records.collect()
}

fn of<'a>(all: &'a [Data], topic: &'a str) -> impl Iterator<Item = &'a Data> {
    all.iter().filter(move |data| data.topic == topic)
}
