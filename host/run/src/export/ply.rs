//! PLY: a cloud of vertices, binary, little-endian.

use std::fmt::Write;

use super::points::fields;
use dtof_data::events::aer_file::EventKind;

/// The header of a file of `points` points.
pub fn header(kind: EventKind, points: u64) -> String {
    let mut header = format!(
        "ply\n\
         format binary_little_endian 1.0\n\
         comment metres, x to the right, y down, z forward\n\
         element vertex {points}\n"
    );
    for field in fields(kind) {
        // Writing to a String does not fail.
        let _ = writeln!(header, "property {} {}", field.number.ply, field.name);
    }
    header + "end_header\n"
}
