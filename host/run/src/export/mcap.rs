//! MCAP: one point cloud for each slice of time, for Foxglove with statistics, or for ROS 2.

use std::collections::BTreeMap;
use std::io::Write;

use ::foxglove::Schema;
use ::mcap::records::MessageHeader;
use anyhow::Result;
use dtof_core::Array;

use super::foxglove::{self, Channel, MOST_POINTS, Tally};
use super::points::{BYTES, fields, record};
use super::projection::Projection;
use super::reorder::{Reorder, WAITING};
use super::span::Span;
use super::{Finished, Out, Sink, ros2};
use dtof_data::events::aer_file::{Event, EventKind};

/// The length and the extent of slices.
#[derive(Clone, Copy, Debug)]
pub struct Slices {
    /// The time of all events, at whose end the last slice ends.
    pub span: Span,
    /// Nanoseconds of a slice, not 0.
    pub slice_ns: u64,
}

/// Puts events in order and collects them slice by slice.
pub struct Mcap {
    writer: ::mcap::Writer<Out>,
    points_channel: u16,
    /// `None` for ROS 2, which has no such message.
    statistics_channel: Option<u16>,
    sequence: u32,
    kind: EventKind,
    projection: Projection,
    order: Reorder<Event>,
    slices: Slices,
    /// The current slice: its number, its points that are not written yet, their time, and its
    /// counts.
    slice: Option<u64>,
    points: Vec<u8>,
    points_ns: u64,
    tally: Tally,
}

/// The length of slices of a run that ends at `end_ns`: 1/100 of it in whole microseconds, rounded
/// up, from 10 µs to 10 ms.
pub fn slice_of(end_ns: u64) -> u64 {
    (end_ns.div_ceil(100_000) * 1000).clamp(10_000, 10_000_000)
}

impl Mcap {
    /// Begins a file for Foxglove, or a bag of ROS 2.
    pub fn new(
        out: Out,
        projection: Projection,
        array: Array,
        kind: EventKind,
        slices: Slices,
        for_ros2: bool,
    ) -> Result<Self> {
        let library = concat!("dtof ", env!("CARGO_PKG_VERSION"));
        let mut options = ::mcap::WriteOptions::new()
            .compression(None)
            .library(library);
        if for_ros2 {
            options = options.profile(ros2::PROFILE);
        }
        let mut writer = options.create(out)?;
        let (points_channel, statistics_channel) = if for_ros2 {
            (channel_for_ros2(&mut writer)?, None)
        } else {
            let [points, statistics] = channels_for_foxglove(&mut writer)?;
            (points, Some(statistics))
        };
        Ok(Self {
            writer,
            points_channel,
            statistics_channel,
            sequence: 0,
            kind,
            projection,
            order: Reorder::new(WAITING),
            slices,
            slice: None,
            points: Vec::new(),
            points_ns: 0,
            tally: Tally::new(array.pixels() as usize),
        })
    }

    /// Adds the next event in order of time.
    fn gather(&mut self, event: &Event) -> Result<()> {
        let time = u64::try_from(self.projection.nanoseconds(event))?;
        let slice = time / self.slices.slice_ns;
        if self.slice != Some(slice) {
            self.end_slice()?;
            self.slice = Some(slice);
            self.points_ns = slice * self.slices.slice_ns;
        } else if self.points.is_empty() {
            // The slice has a message already. Viewers show only the last message of a time.
            self.points_ns = time;
        }
        self.points.write_all(&record(event, &self.projection)?)?;
        self.tally.add(event, slice)?;
        if self.points.len() >= MOST_POINTS * BYTES {
            self.write_points()?;
        }
        Ok(())
    }

    /// Writes the current slice.
    fn end_slice(&mut self) -> Result<()> {
        let Some(slice) = self.slice else {
            return Ok(());
        };
        let Slices { span, slice_ns } = self.slices;
        let begin = slice * slice_ns;
        if !self.points.is_empty() {
            self.write_points()?;
        }
        let end = begin.saturating_add(slice_ns).min(span.end_ns);
        let end = end.max(begin + 1);
        let time = span.start_ns + begin;
        let statistics = self.tally.take();
        let statistics = statistics.over(time, end - begin, self.tally.so_far());
        match self.statistics_channel {
            Some(channel) => self.write_message(channel, time, &serde_json::to_vec(&statistics)?),
            None => Ok(()),
        }
    }

    fn write_points(&mut self) -> Result<()> {
        let time = self.slices.span.start_ns + self.points_ns;
        let data = std::mem::take(&mut self.points);
        let message = match self.statistics_channel {
            Some(_) => foxglove::cloud(self.kind, time, data)?,
            None => ros2::cloud(&fields(self.kind), foxglove::FRAME, time, &data)?,
        };
        self.write_message(self.points_channel, time, &message)
    }

    fn write_message(&mut self, channel_id: u16, time: u64, data: &[u8]) -> Result<()> {
        let header = MessageHeader {
            channel_id,
            sequence: self.sequence,
            log_time: time,
            publish_time: time,
        };
        self.sequence = self.sequence.wrapping_add(1);
        Ok(self.writer.write_to_known_channel(&header, data)?)
    }
}

/// The channel of points.
fn channel_for_ros2(writer: &mut ::mcap::Writer<Out>) -> Result<u16> {
    let [name, encoding, definition] = ros2::SCHEMA;
    let schema = writer.add_schema(name, encoding, definition.as_bytes())?;
    let (key, value) = ros2::METADATA;
    let metadata = BTreeMap::from([(key.to_owned(), value.to_owned())]);
    Ok(writer.add_channel(schema, ros2::TOPIC, ros2::MESSAGES, &metadata)?)
}

/// The channels of points and of statistics.
fn channels_for_foxglove(writer: &mut ::mcap::Writer<Out>) -> Result<[u16; 2]> {
    let mut add = |channel: Channel| {
        let Schema {
            name,
            encoding,
            data,
        } = &channel.schema;
        let schema = writer.add_schema(name, encoding, data)?;
        let none = BTreeMap::new();
        anyhow::Ok(writer.add_channel(schema, channel.topic, channel.encoding, &none)?)
    };
    Ok([add(Channel::events()?)?, add(Channel::statistics()?)?])
}

impl Sink for Mcap {
    fn write(&mut self, event: &Event) -> Result<()> {
        match self.order.push(event.cycle().raw(), *event) {
            Some(next) => self.gather(&next),
            None => Ok(()),
        }
    }

    fn finish(mut self: Box<Self>) -> Result<Finished> {
        while let Some(event) = self.order.pop() {
            self.gather(&event)?;
        }
        self.end_slice()?;
        self.writer.finish()?;
        Ok(Finished {
            out: self.writer.into_inner(),
            written: self.tally.so_far(),
            late: self.order.late(),
        })
    }
}
