//! Point clouds as messages of ROS 2: `sensor_msgs/msg/PointCloud2` in CDR, as in bags.
//!
//! Sources: the MCAP profile `ros2`; the definitions of the package `sensor_msgs`; CDR of the
//! Object Management Group (DDSI-RTPS 2.3, section 10), which the first four bytes announce.

use anyhow::Result;
use byteorder::LittleEndian;
use serde::Serialize;

use super::points::Field;

/// The profile of the file.
pub const PROFILE: &str = "ros2";
/// The encoding of the messages.
pub const MESSAGES: &str = "cdr";
/// The topic.
pub const TOPIC: &str = "/dtof/points";
/// The type of the messages, the encoding of its definition, and the definition with those it
/// needs.
pub const SCHEMA: [&str; 3] = [
    "sensor_msgs/msg/PointCloud2",
    "ros2msg",
    "\
std_msgs/Header header
uint32 height
uint32 width
PointField[] fields
bool is_bigendian
uint32 point_step
uint32 row_step
uint8[] data
bool is_dense

================================================================================
MSG: sensor_msgs/PointField
uint8 INT8=1
uint8 UINT8=2
uint8 INT16=3
uint8 UINT16=4
uint8 INT32=5
uint8 UINT32=6
uint8 FLOAT32=7
uint8 FLOAT64=8
string name
uint32 offset
uint8 datatype
uint32 count

================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id

================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
",
];
/// Metadata of a channel. Bags need this key; with an empty value, players use their defaults.
pub const METADATA: (&str, &str) = ("offered_qos_profiles", "");

/// Little-endian CDR.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

#[derive(Serialize)]
struct Time {
    sec: i32,
    nanosec: u32,
}

#[derive(Serialize)]
struct Header<'a> {
    stamp: Time,
    frame_id: &'a str,
}

#[derive(Serialize)]
struct PointField<'a> {
    name: &'a str,
    offset: u32,
    datatype: u8,
    count: u32,
}

#[derive(Serialize)]
struct PointCloud2<'a> {
    header: Header<'a>,
    height: u32,
    width: u32,
    fields: Vec<PointField<'a>>,
    is_bigendian: bool,
    point_step: u32,
    row_step: u32,
    data: &'a [u8],
    is_dense: bool,
}

/// The message of packed points with these fields. `time_ns` since 1970 must be less than 2^31 s.
///
/// # Errors
/// Fails if there are more bytes than a message can have.
pub fn cloud(fields: &[Field], frame_id: &str, time_ns: u64, data: &[u8]) -> Result<Vec<u8>> {
    let mut point_step = 0;
    let fields = fields.iter().map(|field| {
        let offset = point_step;
        point_step += field.number.bytes;
        PointField {
            name: field.name,
            offset,
            datatype: field.number.ros2,
            count: 1,
        }
    });
    let fields = fields.collect();
    let row_step = u32::try_from(data.len())?;
    let cloud = PointCloud2 {
        header: Header {
            stamp: Time {
                sec: i32::try_from(time_ns / 1_000_000_000)?,
                nanosec: u32::try_from(time_ns % 1_000_000_000)?,
            },
            frame_id,
        },
        height: 1,
        width: row_step / point_step,
        fields,
        is_bigendian: false,
        point_step,
        row_step,
        data,
        is_dense: true,
    };
    let mut message = ENCAPSULATION.to_vec();
    message.extend(cdr_encoding::to_vec::<_, LittleEndian>(&cloud)?);
    Ok(message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::points::{BYTES, fields};
    use dtof_data::events::aer_file::EventKind;

    /// Written from the definition and the rules of CDR: numbers lie at multiples of their size
    /// from the end of the first four bytes, strings end with a zero, which counts.
    #[test]
    fn a_message_has_these_bytes() {
        let point: [u8; BYTES] = std::array::from_fn(|at| u8::try_from(at).unwrap());
        let cloud = cloud(&fields(EventKind::Depth), "ab", 7_000_000_009, &point).unwrap();
        let mut expected = vec![0, 1, 0, 0];
        expected.extend([7, 0, 0, 0, 9, 0, 0, 0]);
        // The frame, and padding before the next number.
        expected.extend([3, 0, 0, 0, b'a', b'b', 0, 0]);
        // Height, width, how many fields.
        expected.extend([1, 0, 0, 0, 1, 0, 0, 0, 9, 0, 0, 0]);
        for (name, offset, datatype) in [
            ("x", 0, 7),
            ("y", 4, 7),
            ("z", 8, 7),
            ("intensity", 12, 7),
            ("pixel", 16, 6),
            ("flags", 20, 2),
            ("level", 21, 2),
            ("echo", 22, 2),
            ("t_ns", 23, 8),
        ] {
            expected.extend([u8::try_from(name.len()).unwrap() + 1, 0, 0, 0]);
            expected.extend(name.bytes());
            expected.push(0);
            expected.resize(expected.len().next_multiple_of(4), 0);
            expected.extend([offset, 0, 0, 0, datatype, 0, 0, 0, 1, 0, 0, 0]);
        }
        // Byte order; the steps; the points; none is missing.
        expected.extend([0, 0, 0, 0, 31, 0, 0, 0, 31, 0, 0, 0, 31, 0, 0, 0]);
        expected.extend(point);
        expected.push(1);
        assert_eq!(cloud, expected);
    }

    #[test]
    fn a_time_that_the_message_cannot_hold_is_refused() {
        let fields = fields(EventKind::Depth);
        let at = |seconds: u64| cloud(&fields, "a", seconds * 1_000_000_000, &[]);
        assert!(at((1 << 31) - 1).is_ok() && at(1 << 31).is_err());
    }
}
