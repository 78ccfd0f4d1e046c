#![doc = include_str!("../README.md")]
//! ## From photon to word
//!
//! ```text
//! photon (TDC code)
//!   → Histogram     saturating counters, highest bin kept while counting
//!   → [every X laser cycles, once L1 < N < L2]
//!     DetectionRule the peak against the background: PaperRule, AverageRule, WindowRule, AnyRule
//!     DepthEstimator the place of the pulse in its bins: centroid, CentredWindow
//!   → DepthEvent    pixel, laser cycle, exposure, sub-bin depth, counts, flags
//!   → AerWord       128 bits
//!
//! from the events of a pixel: RunningMean, Reflectivity, DynamicDepthEvent
//! ```
//!
//! ## Modules
//!
//! Each module imports only from those above it.
//!
//! | module | what it has |
//! |---|---|
//! | `units`, `flags`, `array` | quantities as types; the flags of events; pixels and blocks of an array |
//! | `histogram` | counter widths, the range gate, the histogram, excluded bins |
//! | `event` | the depth event |
//! | `depth` | the place of the pulse in its bins, and its range |
//! | `detect` | detection rules, thresholds, one decision |
//! | `config`, `statistics`, `pixel` | one configuration and one statistics, many pixels |
//! | `whole` | the decision on a whole histogram |
//! | [`binning`] | blocks of pixels that decide together |
//! | [`neighbours`] | pixels of an array that confirm each other |
//! | `pixel_array` | an array that is driven: photons in, events out |
//! | [`events`] | results from events: running mean, dynamic depth, reflectivity |
//! | `aer` | events as words |
//! | [`pixel_processor`] | registers and words of a pixel in programmable logic |
//! | [`paper`] | the paper's building blocks by themselves |
//! | [`rule`] | what a detection rule of your own needs |
//!
//! The items of the modules without a link are at the root.
//!
//! ## Many pixels
//!
//! [`PixelArray`] drives them: see the README above. Fill its room in place, with the crates `heapless` and
//! `static_cell`, as there. An array that is made first, as by `core::array::from_fn`, and then moved needs a stack frame
//! of its size. On a Cortex-M4F, with pixels of 128 bins:
//!
//! | pixels | frame at `opt-level` 3 or "s" | at 0 |
//! |---|---|---|
//! | 64 | 22 kB | 84 kB |
//! | 256 | 85 kB | 336 kB |
//!
//! On a Cortex-M0+, `static_cell` needs a feature of `portable-atomic`: `critical-section` or
//! `unsafe-assume-single-core`.
//!
//! ## Rules of the crate
//!
//! Data flows one way through the pipeline. Configuration and state are separate
//! types: one configuration, many pixels. Time is an argument. Every lost photon
//! (saturated, rejected, gated out) is counted. Nothing is logged.
//!
//! ## Glossary
//!
//! - **Macropixel**: SPADs that share a TDC and a histogram.
//! - **Laser cycle**: one laser pulse and the listening time after it.
//! - **TDC code**: the time of a photon in its laser cycle, in bins, from the
//!   time-to-digital converter; not checked yet.
//! - **Bin**: one counter of a histogram, and its interval of time.
//! - **Exposure (N)**: laser cycles since the histogram was cleared.
//! - **Look**: the check of N every X laser cycles, with a decision if
//!   `L1 < N < L2`.
//! - **Background**: the photons of a bin without a target.
//! - **Detection**: a peak that stands clear of the background.
//! - **False alarm**: a detection without a target.
//! - **CFAR**: a test with a constant false-alarm rate, whatever the background.
//! - **Peak event**, here *depth event*: a detection that a pixel reports.
//! - **Centroid**: the centre of the photons of some bins.
//! - **Dead time**: bins for which a TDC is blind after a photon; all of them if it takes the
//!   first photon of a laser cycle only. **Pile-up**: early photons hide late ones.
//! - **Live**: a bin is live in the laser cycles in which the TDC is not blind there.
//! - **Dynamic depth**: events of changes of depth only, with a polarity.
//! - **AER**: address-event representation; REQ and ACK are its handshake, REQ the paper's.

#![cfg_attr(not(test), no_std)]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]
#![deny(
    clippy::disallowed_types,
    clippy::expect_used,
    clippy::float_arithmetic,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used
)]

mod aer;
mod array;
pub mod binning;
mod check;
mod config;
mod depth;
mod detect;
mod event;
pub mod events;
mod flags;
mod histogram;
pub mod neighbours;
pub mod paper;
mod pixel;
mod pixel_array;
pub mod pixel_processor;
pub mod rule;
mod statistics;
#[cfg(test)]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::disallowed_types,
    clippy::expect_used,
    clippy::float_arithmetic,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "tests"
)]
mod tests;
mod units;
mod whole;

#[cfg(test)]
extern crate self as dtof_core;

/// The fixed-point numbers of α, bin width and range.
pub use fixed;

pub use aer::{AER_VERSION, AerDecoder, AerEncoder, AerError, AerRecord, AerWord};
pub use array::{Array, Neighbours};
pub use config::{PixelConfig, PixelConfigBuilder, PixelConfigError};
pub use depth::{CentredWindow, DepthEstimate, DepthEstimator, RangeScale, RangeScaleError};
pub use detect::{
    AnyRule, AverageRule, Detection, DetectionRule, PaperRule, WindowRule, WindowWidthError, z_for,
};
pub use event::DepthEvent;
pub use flags::Flags;
pub use histogram::counter::{Count8, Count10, Count16, Count20, Count24, CounterWidth};
pub use histogram::gate::{GateError, RangeGate};
pub use histogram::{Histogram, Peak};
pub use pixel::{AsyncPixel, Look, OncePerBin, PixelData};
pub use pixel_array::{ArrayConfig, ArrayError, ArrayLosses, ArrayState, PixelArray, PixelPlace};
pub use statistics::Statistics;
pub use units::{
    BinIndex, BinPosition, BlockLevel, Count, EchoNumber, LaserCycle, PixelAddress, SubBinOffset,
};
pub use whole::WholeHistogram;
