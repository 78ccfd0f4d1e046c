//! Messages for Foxglove: the points of a slice of time and its statistics, in an MCAP file and
//! live.

use anyhow::{Context, Result};
use dtof_core::{BlockLevel, Flags};
use foxglove::messages::{PackedElementField, PointCloud, Pose, Quaternion, Timestamp, Vector3};
use foxglove::{Encode, Schema};
use serde::Serialize;
use serde_json::{Value, json};

use super::points::fields;
use dtof_data::events::aer_file::{Event, EventKind};

/// The most points of a message.
pub const MOST_POINTS: usize = 1 << 16;

/// The coordinate frame of the points.
pub const FRAME: &str = "dtof_optical";

/// A topic and the type of its messages.
pub struct Channel {
    /// Its name.
    pub topic: &'static str,
    /// The encoding of its messages.
    pub encoding: &'static str,
    /// The encoding of its messages.
    pub schema: Schema,
}

impl Channel {
    /// Points of a slice of time.
    ///
    /// # Errors
    /// Never fails: the messages have a schema.
    pub fn events() -> Result<Self> {
        Self::protobuf::<PointCloud>("/events")
    }

    /// Statistics of the same slice.
    ///
    /// # Errors
    /// Never fails: the messages are objects.
    pub fn statistics() -> Result<Self> {
        Self::json("/statistics", "Statistics", &Statistics::default())
    }

    /// Messages of Foxglove's own types.
    ///
    /// # Errors
    /// Fails if they have no schema.
    pub fn protobuf<T: Encode>(topic: &'static str) -> Result<Self> {
        let schema = T::get_schema();
        Ok(Self {
            topic,
            encoding: "protobuf",
            schema: schema.with_context(|| format!("{topic} has no schema"))?,
        })
    }

    /// JSON messages of this project, all with the fields of `sample`.
    ///
    /// # Errors
    /// Fails if `sample` is not an object.
    pub fn json(topic: &'static str, name: &str, sample: &impl Serialize) -> Result<Self> {
        let fields = serde_json::to_value(sample)?;
        let fields = fields.as_object().context("a message has fields")?;
        let kind = |of: &str| json!({ "type": of });
        let properties = fields.iter().map(|(name, value)| {
            let schema = match value {
                // The only object is a time.
                Value::Object(_) => json!({
                    "type": "object",
                    "title": "time",
                    "properties": { "sec": kind("integer"), "nsec": kind("integer") },
                }),
                Value::String(_) => kind("string"),
                Value::Number(number) if number.is_u64() => kind("integer"),
                _ => kind("number"),
            };
            (name.clone(), schema)
        });
        let name = format!("dtof.{name}");
        let schema = json!({
            "title": name,
            "type": "object",
            "properties": properties.collect::<serde_json::Map<_, _>>(),
        });
        Ok(Self {
            topic,
            encoding: "json",
            schema: Schema::new(name, "jsonschema", schema.to_string().into_bytes()),
        })
    }
}

/// Counts of a slice of time.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Statistics {
    /// When the slice begins.
    timestamp: Time,
    /// The length in seconds. In a file, the last slice ends with the last event.
    duration_s: f64,
    /// Events.
    events: u64,
    /// Events a second; null for a slice of length 0, whose events are late ones of the slice
    /// before.
    events_per_s: f64,
    /// Pixels with an event.
    pixels: u64,
    /// Events with any flag.
    flagged: u64,
    /// Events whose peak counter was full.
    saturated: u64,
    /// Events whose depth window was cut by the range gate, or whose position was limited to two
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
    /// Events from the start of the file, or of the program, to the end of the slice.
    events_so_far: u64,
}

impl Statistics {
    /// Fills in the time: the slice began at `time` and lasted `duration_ns`, and `events_so_far`
    /// events came up to its end.
    #[must_use]
    pub fn over(self, time: u64, duration_ns: u64, events_so_far: u64) -> Self {
        let duration_s = duration_ns as f64 / 1e9;
        Self {
            timestamp: Time::from_nanoseconds(time),
            duration_s,
            // JSON has no infinity: null.
            events_per_s: self.events as f64 / duration_s,
            events_so_far,
            ..self
        }
    }
}

/// A time in Foxglove's JSON format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Time {
    sec: u32,
    nsec: u32,
}

impl Time {
    /// `nanoseconds` must be less than 2^32 s.
    #[allow(clippy::cast_possible_truncation, reason = "checked by the clock")]
    #[must_use]
    pub fn from_nanoseconds(nanoseconds: u64) -> Self {
        Self {
            sec: (nanoseconds / 1_000_000_000) as u32,
            nsec: (nanoseconds % 1_000_000_000) as u32,
        }
    }

    /// The same as a timestamp of a message.
    #[must_use]
    pub fn stamp(self) -> Option<Timestamp> {
        Timestamp::new_checked(self.sec, self.nsec)
    }
}

/// Counts the events of each slice.
#[derive(Debug)]
pub struct Tally {
    now: Statistics,
    /// The slice of each pixel's last event, counted from 1.
    last_slice: Vec<u64>,
    so_far: u64,
}

impl Tally {
    /// Starts without events, for so many pixels.
    #[must_use]
    pub fn new(pixels: usize) -> Self {
        Self {
            now: Statistics::default(),
            last_slice: vec![0; pixels],
            so_far: 0,
        }
    }

    /// Counts an event of slice number `slice`. Numbers must not decrease.
    ///
    /// # Errors
    /// Fails if the array has no such pixel. Nothing is counted then.
    pub fn add(&mut self, event: &Event, slice: u64) -> Result<()> {
        let last = self.last_slice.get_mut(usize::from(event.pixel().raw()));
        let last = last.context("the array has no such pixel")?;
        let now = &mut self.now;
        now.events += 1;
        now.pixels += u64::from(*last != slice + 1);
        *last = slice + 1;
        let flags = event.flags();
        for (count, flag) in [
            (&mut now.saturated, Flags::SATURATED),
            (&mut now.clipped, Flags::CLIPPED),
            (&mut now.deferred, Flags::DEFERRED),
            (&mut now.pile_up, Flags::PILE_UP),
            (&mut now.tail, Flags::TAIL),
        ] {
            *count += u64::from(flags.contains(flag));
        }
        now.blocks += u64::from(event.level() != BlockLevel::PIXEL);
        now.flagged += u64::from(flags != Flags::NONE);
        self.so_far += 1;
        Ok(())
    }

    /// Ends a slice and returns its counts.
    pub fn take(&mut self) -> Statistics {
        std::mem::take(&mut self.now)
    }

    /// All events.
    #[must_use]
    pub fn so_far(&self) -> u64 {
        self.so_far
    }
}

/// Packed points as a message.
///
/// # Errors
/// Fails if it cannot be encoded.
pub fn cloud(kind: EventKind, time: u64, data: Vec<u8>) -> Result<Vec<u8>> {
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
    encoded(&PointCloud {
        timestamp: Time::from_nanoseconds(time).stamp(),
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
    })
}

/// A message as bytes.
///
/// # Errors
/// Fails if it cannot be encoded.
pub fn encoded<T: Encode>(message: &T) -> Result<Vec<u8>>
where
    T::Error: Send + Sync + 'static,
{
    let mut bytes = Vec::new();
    message.encode(&mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use foxglove::Decode;
    use foxglove::messages::packed_element_field::NumericType;

    #[test]
    fn a_cloud_describes_its_points() {
        let data = vec![5; 62];
        let message = cloud(EventKind::DynamicDepth, 7_000_000_009, data.clone()).unwrap();
        let field = |(name, offset, number): (&str, _, NumericType)| PackedElementField {
            name: name.to_owned(),
            offset,
            r#type: number.into(),
        };
        let fields = [
            ("x", 0, NumericType::Float32),
            ("y", 4, NumericType::Float32),
            ("z", 8, NumericType::Float32),
            ("change", 12, NumericType::Float32),
            ("pixel", 16, NumericType::Uint32),
            ("flags", 20, NumericType::Uint8),
            ("level", 21, NumericType::Uint8),
            ("echo", 22, NumericType::Uint8),
            ("t_ns", 23, NumericType::Float64),
        ];
        let expected = PointCloud {
            timestamp: Some(Timestamp::new(7, 9)),
            frame_id: "dtof_optical".to_owned(),
            // Where the lens is.
            pose: Some(Pose {
                position: Some(Vector3 {
                    x: 0.0,
                    y: 0.0,
                    z: 0.0,
                }),
                orientation: Some(Quaternion {
                    x: 0.0,
                    y: 0.0,
                    z: 0.0,
                    w: 1.0,
                }),
            }),
            point_stride: 31,
            fields: fields.map(field).to_vec(),
            data: data.into(),
        };
        assert_eq!(PointCloud::decode(&message[..]).unwrap(), expected);
    }

    #[test]
    fn a_channel_of_json_has_the_type_of_each_field() {
        let sample = json!({
            "at": Time::default(), "text": "", "count": 3u64, "share": 0.5, "unknown": f64::NAN,
        });
        let channel = Channel::json("/all", "All", &sample).unwrap();
        assert_eq!((channel.topic, channel.encoding), ("/all", "json"));
        assert_eq!(
            (&*channel.schema.name, &*channel.schema.encoding),
            ("dtof.All", "jsonschema")
        );
        let schema: Value = serde_json::from_slice(&channel.schema.data).unwrap();
        let time = json!({
            "type": "object",
            "title": "time",
            "properties": { "sec": { "type": "integer" }, "nsec": { "type": "integer" } },
        });
        let expected = json!({
            "title": "dtof.All",
            "type": "object",
            "properties": {
                "at": time,
                "text": { "type": "string" },
                "count": { "type": "integer" },
                "share": { "type": "number" },
                "unknown": { "type": "number" },
            },
        });
        assert_eq!(schema, expected);
        let error = Channel::json("/all", "All", &3).err().unwrap();
        assert_eq!(error.to_string(), "a message has fields");
    }

    #[test]
    fn a_slice_of_length_0_has_no_rate() {
        let mut tally = Tally::new(2);
        let event = |pixel| Event::Depth(dtof_data::events::fixtures::event(pixel, 9, 60));
        tally.add(&event(1), 0).unwrap();
        let error = tally.add(&event(2), 0).unwrap_err();
        assert_eq!(error.to_string(), "the array has no such pixel");
        assert_eq!(tally.so_far(), 1);
        let statistics = tally.take().over(3_000_000_007, 0, tally.so_far());
        let json = serde_json::to_value(&statistics).unwrap();
        assert_eq!(json["timestamp"], json!({ "sec": 3, "nsec": 7 }));
        assert_eq!(
            (&json["events"], &json["duration_s"]),
            (&json!(1), &json!(0.0))
        );
        assert_eq!(json["events_per_s"], Value::Null);
    }
}
