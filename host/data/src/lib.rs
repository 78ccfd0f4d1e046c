#![doc = include_str!("../README.md")]
#![deny(clippy::print_stderr, clippy::print_stdout)]

pub mod events;
pub mod options;
pub mod photons;
pub mod random;
