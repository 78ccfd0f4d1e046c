#![doc = include_str!("../README.md")]
#![deny(clippy::print_stderr, clippy::print_stdout)]

pub mod axes;
pub mod bins;
pub mod capture_log;
pub mod geometry;
pub mod masked;
pub mod medium;
pub mod npy;
pub mod open;
pub mod photon_csv;
pub mod photon_list;
pub mod range;
pub mod recorded;
pub mod source;
pub mod tmf8820;
pub mod tmf8829;
pub mod warnings;
