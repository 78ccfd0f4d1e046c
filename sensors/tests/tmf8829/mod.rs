//! The driver of the TMF8829 beside a chip that is written from the data sheet.

mod errors;
mod faults;
mod frames;
mod settings;
