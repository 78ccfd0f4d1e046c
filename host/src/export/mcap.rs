//! MCAP: point clouds, one for each slice of time, as Foxglove knows them, with statistics of
//! the slice; or as ROS 2 does.

use std::collections::BTreeMap;
use std::io::Write;

use ::mcap::records::MessageHeader;
use anyhow::{Context, Result};
use dtof_core::{BlockLevel, Flags};
use foxglove::Encode;
use foxglove::messages::{PackedElementField, PointCloud, Pose, Quaternion, Timestamp, Vector3};
use serde::Serialize;

use super::clock::Span;
use super::points::{BYTES, fields, record};
use super::projection::Projection;
use super::reorder::{Reorder, WAITING};
use super::{Finished, Out, Sink, ros2};
use crate::events::aer_file::{Event, EventKind};
use crate::input::source::Geometry;

/// Points of a message, at most: a slice with more has more than one message.
const MOST_POINTS: usize = 1 << 16;

/// The frame that points are in.
const FRAME: &str = "dtof_optical";

/// Counts of a slice of time.
#[derive(Clone, Debug, Default, Serialize)]
struct Statistics {
    /// When the slice begins.
    timestamp: Time,
    /// How long it is, in seconds. The last one ends with the last event.
    duration_s: f64,
    /// Events.
    events: u64,
    /// The same a second.
    events_per_s: f64,
    /// Pixels with an event.
    pixels: u64,
    /// Events with any flag.
    flagged: u64,
    /// Events whose peak counter was full.
    saturated: u64,
    /// Events whose depth window was cut by the range gate, or whose position was held two
    /// bins from the peak.
    clipped: u64,
    /// Events that had to wait for the link.
    deferred: u64,
    /// Events of exposures with so many photons that the TDC missed some.
    pile_up: u64,
    /// Echoes on the tail of another.
    tail: u64,
    /// Events of blocks of pixels.
    blocks: u64,
    /// Events from the start of the file to the end of the slice.
    events_so_far: u64,
}

/// As Foxglove has it in JSON.
#[derive(Clone, Copy, Debug, Default, Serialize)]
struct Time {
    sec: u32,
    nsec: u32,
}

impl Time {
    /// A time of less than 2^32 s.
    #[allow(clippy::cast_possible_truncation, reason = "checked by the clock")]
    fn of(nanoseconds: u64) -> Self {
        Self {
            sec: (nanoseconds / 1_000_000_000) as u32,
            nsec: (nanoseconds % 1_000_000_000) as u32,
        }
    }
}

/// The JSON schema of [`Statistics`].
fn schema() -> String {
    let kind = |of: &str| serde_json::json!({ "type": of });
    let time = serde_json::json!({
        "type": "object",
        "title": "time",
        "properties": { "sec": kind("integer"), "nsec": kind("integer") },
    });
    let whole =
        "events pixels flagged saturated clipped deferred pile_up tail blocks events_so_far";
    let whole = whole.split(' ').map(|name| (name, kind("integer")));
    let reals = ["duration_s", "events_per_s"].map(|name| (name, kind("number")));
    let all = whole.chain(reals).chain([("timestamp", time)]);
    let properties: BTreeMap<_, _> = all.collect();
    serde_json::json!({
        "title": "dtof.Statistics",
        "type": "object",
        "properties": properties,
    })
    .to_string()
}

/// When slices are, and how long.
#[derive(Clone, Copy, Debug)]
pub struct Slices {
    /// Of all events: the last slice ends with it, at the latest.
    pub span: Span,
    /// Not 0.
    pub slice_ns: u64,
}

/// Events put in order, gathered slice by slice.
pub struct Mcap {
    writer: ::mcap::Writer<Out>,
    points_channel: u16,
    /// None in a bag of ROS 2, which has no message for them.
    statistics_channel: Option<u16>,
    sequence: u32,
    kind: EventKind,
    projection: Projection,
    order: Reorder<Event>,
    slices: Slices,
    /// The slice that is being gathered: its number, its points that are not written and
    /// their time, what happened.
    slice: Option<u64>,
    points: Vec<u8>,
    points_ns: u64,
    statistics: Statistics,
    /// The slice in which each pixel had its last event, counted from 1.
    last_slice: Vec<u64>,
    written: u64,
}

/// Slices of a run that ends at `end_ns`: 1/100 of it in whole microseconds, rounded up,
/// from 10 µs to 10 ms.
pub fn slice_of(end_ns: u64) -> u64 {
    (end_ns.div_ceil(100_000) * 1000).clamp(10_000, 10_000_000)
}

impl Mcap {
    /// Begins a file for Foxglove, or a bag of ROS 2.
    pub fn new(
        out: Out,
        projection: Projection,
        array: Geometry,
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
            statistics: Statistics::default(),
            last_slice: vec![0; array.addresses()],
            written: 0,
        })
    }

    /// Takes the next event in time.
    fn gather(&mut self, event: &Event) -> Result<()> {
        let time = u64::try_from(self.projection.nanoseconds(event))?;
        let slice = time / self.slices.slice_ns;
        if self.slice != Some(slice) {
            self.end_slice()?;
            self.slice = Some(slice);
            self.points_ns = slice * self.slices.slice_ns;
        } else if self.points.is_empty() {
            // The slice has a message already. Of two of one time viewers show the last.
            self.points_ns = time;
        }
        self.points.write_all(&record(event, &self.projection)?)?;
        self.written += 1;
        let statistics = &mut self.statistics;
        statistics.events += 1;
        let last = self.last_slice.get_mut(usize::from(event.pixel().0));
        let last = last.context("an event of no pixel")?;
        statistics.pixels += u64::from(*last != slice + 1);
        *last = slice + 1;
        let flags = event.flags();
        for (count, flag) in [
            (&mut statistics.saturated, Flags::SATURATED),
            (&mut statistics.clipped, Flags::CLIPPED),
            (&mut statistics.deferred, Flags::DEFERRED),
            (&mut statistics.pile_up, Flags::PILE_UP),
            (&mut statistics.tail, Flags::TAIL),
        ] {
            *count += u64::from(flags.contains(flag));
        }
        statistics.blocks += u64::from(event.level() != BlockLevel::PIXEL);
        statistics.flagged += u64::from(flags != Flags::NONE);
        if self.points.len() >= MOST_POINTS * BYTES {
            self.write_points()?;
        }
        Ok(())
    }

    /// Writes what was gathered.
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
        let duration_s = (end - begin) as f64 / 1e9;
        let time = span.start_ns + begin;
        let statistics = Statistics {
            timestamp: Time::of(time),
            duration_s,
            events_per_s: self.statistics.events as f64 / duration_s,
            events_so_far: self.written,
            ..std::mem::take(&mut self.statistics)
        };
        match self.statistics_channel {
            Some(channel) => self.write_message(channel, time, &serde_json::to_vec(&statistics)?),
            None => Ok(()),
        }
    }

    fn write_points(&mut self) -> Result<()> {
        let time = self.slices.span.start_ns + self.points_ns;
        let data = std::mem::take(&mut self.points);
        let message = match self.statistics_channel {
            Some(_) => cloud_for_foxglove(self.kind, time, data)?,
            None => ros2::cloud(&fields(self.kind), FRAME, time, &data)?,
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
    let of_points = PointCloud::get_schema().context("a point cloud has a schema")?;
    let points = writer.add_schema(&of_points.name, &of_points.encoding, &of_points.data)?;
    let statistics = writer.add_schema("dtof.Statistics", "jsonschema", schema().as_bytes())?;
    let none = BTreeMap::new();
    let encoding = PointCloud::get_message_encoding();
    Ok([
        writer.add_channel(points, "/events", &encoding, &none)?,
        writer.add_channel(statistics, "/statistics", "json", &none)?,
    ])
}

/// Packed points as a message.
fn cloud_for_foxglove(kind: EventKind, time: u64, data: Vec<u8>) -> Result<Vec<u8>> {
    let Time { sec, nsec } = Time::of(time);
    let mut offset = 0;
    let mut fields_of_points = Vec::new();
    for field in fields(kind) {
        fields_of_points.push(PackedElementField {
            name: field.name.to_owned(),
            offset,
            r#type: field.number.mcap.into(),
        });
        offset += field.number.bytes;
    }
    let cloud = PointCloud {
        timestamp: Timestamp::new_checked(sec, nsec),
        frame_id: FRAME.to_owned(),
        pose: Some(Pose {
            position: Some(Vector3::default()),
            orientation: Some(Quaternion {
                w: 1.0,
                ..Quaternion::default()
            }),
        }),
        point_stride: offset,
        fields: fields_of_points,
        data: data.into(),
    };
    let mut message = Vec::new();
    cloud.encode(&mut message)?;
    Ok(message)
}

impl Sink for Mcap {
    fn write(&mut self, event: &Event) -> Result<()> {
        match self.order.push(event.cycle().0, *event) {
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
            written: self.written,
            late: self.order.late(),
        })
    }
}
