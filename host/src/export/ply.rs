//! PLY: a cloud of vertices, binary, little-endian.

use std::fmt::Write;

use super::points::{Number, fields};
use crate::events::aer_file::EventKind;

/// The header of a file of so many points.
pub fn header(kind: EventKind, points: u64) -> String {
    let mut header = format!(
        "ply\n\
         format binary_little_endian 1.0\n\
         comment metres, x to the right, y down, z forward\n\
         element vertex {points}\n"
    );
    for field in fields(kind) {
        // Writing to a String does not fail.
        let _ = writeln!(header, "property {} {}", name(field.number), field.name);
    }
    header + "end_header\n"
}

fn name(number: Number) -> &'static str {
    match number {
        Number::U8 => "uchar",
        Number::U32 => "uint",
        Number::F32 => "float",
        Number::F64 => "double",
    }
}
