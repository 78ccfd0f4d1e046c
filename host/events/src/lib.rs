#![doc = include_str!("../README.md")]
#![deny(clippy::print_stderr, clippy::print_stdout)]

pub mod aer_file;
pub mod clock;
pub mod dynamic;
pub mod echoes;
pub mod events_csv;
pub mod fixtures;
pub mod histories;
pub mod last_events;
pub mod sample;
