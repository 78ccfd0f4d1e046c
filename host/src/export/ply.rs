//! PLY: a cloud of vertices, binary, little-endian.

use std::fmt::Write;

use anyhow::Result;

use super::Out;
use super::points::{Number, Points, fields};
use super::projection::Projection;
use crate::events::aer_file::EventKind;

/// Begins a file of so many points.
pub fn begin(out: Out, projection: Projection, kind: EventKind, points: u64) -> Result<Points> {
    Points::new(out, projection, &header(kind, points))
}

fn header(kind: EventKind, points: u64) -> String {
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
