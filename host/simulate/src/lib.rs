#![doc = include_str!("../README.md")]
//! ## The model
//!
//! Background photons are Poisson distributed and spread evenly over the bins;
//! signal photons are Poisson distributed and normally distributed around the
//! pulse position (Eq. 1 to 3, one object). A signal photon outside the
//! histogram is not detected.
//!
//! That is the plain model, and all there is unless [`Effects`](effects::Effects) say otherwise.
//! With effects the same photons, drawn from the same random numbers, take a
//! longer way:
//!
//! ```text
//! arrivals (f64, bins after the laser fires)
//!   → light      second echo, cover glass, pulse tail, hot pixels
//!   → SPAD       dead time, afterpulsing
//!   → TDC        jitter, hits a laser cycle
//!   → TDC codes
//! ```
//!
//! Each effect has random numbers of its own: switching one on leaves those of
//! all others as they were.

#![deny(clippy::print_stderr, clippy::print_stdout)]

mod array;
mod arrival;
pub mod demo;
mod detector;
pub mod effects;
#[cfg(test)]
mod engine_tests;
mod pixel;
pub mod scene;
mod stream;

pub use self::array::{RatesAt, SimulatedArray};
pub use self::pixel::SimulatedPixel;
