//! The driver of the TMF8829 beside a chip that is written from the data sheet.

#[path = "../common/mod.rs"]
mod common;
mod errors;
mod faults;
mod frames;
mod settings;
