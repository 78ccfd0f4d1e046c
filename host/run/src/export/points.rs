//! Points as packed records, the same in PCD, PLY, MCAP and ROS 2.

use std::io::Write;

use anyhow::Result;
use foxglove::messages::packed_element_field::NumericType;

use super::projection::Projection;
use super::{Finished, Out, Sink};
use dtof_data::events::aer_file::{Event, EventKind};

/// The type of a field, little-endian, and its name in each format.
#[derive(Clone, Copy, Debug)]
pub struct Number {
    /// Its size in bytes.
    pub bytes: u32,
    /// In PCD.
    pub pcd: &'static str,
    /// In PLY.
    pub ply: &'static str,
    /// In MCAP.
    pub mcap: NumericType,
    /// A constant of `sensor_msgs/msg/PointField`.
    pub ros2: u8,
}

const U8: Number = number(1, "U", "uchar", NumericType::Uint8, 2);
const U32: Number = number(4, "U", "uint", NumericType::Uint32, 6);
const F32: Number = number(4, "F", "float", NumericType::Float32, 7);
const F64: Number = number(8, "F", "double", NumericType::Float64, 8);

const fn number(
    bytes: u32,
    pcd: &'static str,
    ply: &'static str,
    mcap: NumericType,
    ros2: u8,
) -> Number {
    Number {
        bytes,
        pcd,
        ply,
        mcap,
        ros2,
    }
}

/// A field of a record.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Its name, the same in all formats.
    pub name: &'static str,
    /// Its type.
    pub number: Number,
}

const fn field(name: &'static str, number: Number) -> Field {
    Field { name, number }
}

/// The fields of the points of an event, in this order, without gaps.
#[must_use]
pub fn fields(kind: EventKind) -> [Field; 9] {
    let value = match kind {
        // Viewers use this name for the brightness of points: the peak count.
        EventKind::Depth => "intensity",
        EventKind::DynamicDepth => "change",
    };
    [
        field("x", F32),
        field("y", F32),
        field("z", F32),
        field(value, F32),
        // Wider than an address, as Open3D skips 16-bit fields of PLY files.
        field("pixel", U32),
        field("flags", U8),
        // The point stands for 2^level pixels a side.
        field("level", U8),
        field("echo", U8),
        field("t_ns", F64),
    ]
}

/// Bytes of a record.
pub const BYTES: usize = 5 * 4 + 3 + 8;

/// The record of an event.
///
/// # Errors
/// Fails if the pixel of the event has no ray.
#[allow(
    clippy::cast_possible_truncation,
    reason = "a peak count has 24 bits, a time is less than 2^53 ns; a change is rounded"
)]
pub fn record(event: &Event, projection: &Projection) -> Result<[u8; BYTES]> {
    let [x, y, z] = projection.point(event)?;
    let value = match event {
        Event::Depth(event) => event.peak_count.raw() as f32,
        Event::DynamicDepth(event) => {
            let millimetres: f64 = projection.ranges.scale().distance(event.change()).to_num();
            (millimetres / 1000.0) as f32
        }
    };
    let mut record = [0; BYTES];
    for (place, number) in record.chunks_exact_mut(4).zip([x, y, z, value]) {
        place.copy_from_slice(&number.to_le_bytes());
    }
    record[16..20].copy_from_slice(&u32::from(event.pixel().raw()).to_le_bytes());
    record[20] = event.flags().bits();
    record[21] = event.level().raw();
    record[22] = event.echo().raw();
    let time = projection.nanoseconds(event) as f64;
    record[23..].copy_from_slice(&time.to_le_bytes());
    Ok(record)
}

/// Writes records after a header.
pub struct Points {
    out: Out,
    projection: Projection,
    write: fn(&mut Out, &Event, &Projection) -> Result<()>,
    written: u64,
}

impl Points {
    /// Writes `header`, and then each event with `write`.
    ///
    /// # Errors
    /// Fails if the header cannot be written.
    pub fn new(
        mut out: Out,
        projection: Projection,
        header: &str,
        write: fn(&mut Out, &Event, &Projection) -> Result<()>,
    ) -> Result<Self> {
        out.write_all(header.as_bytes())?;
        Ok(Self {
            out,
            projection,
            write,
            written: 0,
        })
    }

    /// Packed records below `header`.
    ///
    /// # Errors
    /// Fails if the header cannot be written.
    pub fn packed(out: Out, projection: Projection, header: &str) -> Result<Self> {
        Self::new(out, projection, header, |out, event, projection| {
            Ok(out.write_all(&record(event, projection)?)?)
        })
    }
}

impl Sink for Points {
    fn write(&mut self, event: &Event) -> Result<()> {
        (self.write)(&mut self.out, event, &self.projection)?;
        self.written += 1;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<Finished> {
        Ok(Finished {
            out: self.out,
            written: self.written,
            late: 0,
        })
    }
}
