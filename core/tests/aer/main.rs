//! Words against the tables and golden vectors of `docs/aer-format.md`, which
//! are read from the document itself.

#![allow(
    clippy::cast_possible_truncation,
    reason = "fields as wide as their types"
)]

mod any_bytes;
mod depth_event;
mod document;
mod golden;
#[path = "../common/parallel.rs"]
mod parallel;
