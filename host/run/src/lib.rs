#![doc = include_str!("../README.md")]
#![deny(clippy::print_stderr, clippy::print_stdout)]

mod bright;
pub mod calibrate;
pub mod compare;
pub mod depth_map;
pub mod export;
pub mod given;
pub mod glass;
pub mod output;
pub mod recording;
pub mod replay;
pub mod report;
mod run;
pub mod simulate;
pub mod summary;
pub mod truth;
pub mod tune;

pub use run::{Reported, RunResult, Sink, run};
