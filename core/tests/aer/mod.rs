//! Words against the tables and golden vectors of `docs/aer-format.md`, which
//! are read from the document itself.

mod any_bytes;
mod depth_event;
mod document;
mod golden;
