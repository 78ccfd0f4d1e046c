//! PCD: the point clouds of PCL, version 0.7, binary.

use super::points::fields;
use dtof_data::events::aer_file::EventKind;

/// The header of a file of `points` points.
pub fn header(kind: EventKind, points: u64) -> String {
    let fields = fields(kind);
    let names = fields.map(|field| field.name).join(" ");
    let sizes = fields.map(|field| field.number.bytes.to_string()).join(" ");
    let types = fields.map(|field| field.number.pcd).join(" ");
    let counts = fields.map(|_| "1").join(" ");
    format!(
        "# .PCD v0.7 - Point Cloud Data file format\n\
         VERSION 0.7\n\
         FIELDS {names}\n\
         SIZE {sizes}\n\
         TYPE {types}\n\
         COUNT {counts}\n\
         WIDTH {points}\n\
         HEIGHT 1\n\
         VIEWPOINT 0 0 0 1 0 0 0\n\
         POINTS {points}\n\
         DATA binary\n"
    )
}
