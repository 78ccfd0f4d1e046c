#![doc = include_str!("../README.md")]
#![deny(clippy::print_stderr, clippy::print_stdout)]

pub mod axes;
mod bins;
mod capture_log;
pub mod geometry;
pub mod histograms;
pub mod input;
pub mod list_checks;
pub mod masked;
pub mod npy;
pub mod open;
mod photon_csv;
mod photon_list;
pub mod pixel_counts;
pub mod range;
pub mod ranges;
pub mod recorded;
pub mod source;
pub mod tmf8820;
pub mod tmf8829;
pub mod warnings;

/// Millimetres of range a picosecond, half the speed of light.
pub const MM_PER_PS: f64 = 0.149_896_229;
