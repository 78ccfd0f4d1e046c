#![doc = include_str!("../README.md")]
//! ## From photons to files
//!
//! ```text
//! simulation, recorded histograms, photon list   PhotonSource
//!   → Slice          some hundred laser cycles of photons, pixel by pixel
//!   → Engine         dtof-core, on this computer
//!   → DepthEvent
//!   → Output         events.csv, events.aer, summary.json, pictures, report
//! ```

#![deny(
    clippy::print_stderr,
    reason = "a closed standard error is no reason to stop"
)]

pub mod calibrate;
pub mod cli;
pub mod compare;
pub mod device;
pub mod engine;
pub mod events;
pub mod export;
pub mod files;
pub mod geometry;
pub mod input;
pub mod live;
pub mod numbers;
pub mod options;
pub mod progress;
pub mod report;
pub mod rows;
pub mod run;
pub mod settings;
pub mod simulate;
