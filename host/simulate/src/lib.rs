#![doc = include_str!("../README.md")]
//! ## The model
//!
//! Background photons are Poisson distributed and spread evenly over the bins;
//! signal photons are Poisson distributed and normally distributed around the
//! pulse position (Eq. 1 to 3, one object). A signal photon outside the
//! histogram is not detected.
//!
//! This is the plain model, used unless there are [`Effects`](effects::Effects). With effects, the
//! same photons from the same random numbers take a longer path:
//!
//! ```text
//! arrivals (f64, bins after the laser fires)
//!   → light      second echo, cover glass, pulse tail, hot pixels
//!   → SPAD       dead time, afterpulsing
//!   → TDC        jitter, hits a laser cycle
//!   → TDC codes
//! ```
//!
//! Each effect has its own random numbers: switching one on does not change the others.

#![deny(clippy::print_stderr, clippy::print_stdout)]

mod array;
pub mod demo;
mod detector;
pub mod effects;
#[cfg(test)]
mod engine_tests;
mod pixel;
pub mod scene;
mod stream;

pub use self::array::{RatesFn, SimulatedArray};
pub use self::pixel::SimulatedPixel;
