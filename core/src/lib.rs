#![doc = include_str!("../README.md")]
//! ## From photon to word
//!
//! ```text
//! photon (TDC code)
//!   → Histogram     saturating counters, highest bin kept while counting
//!   → [every X laser cycles, once L1 < N < L2]
//!     DetectionRule the peak against the background: PaperRule, AverageRule, WindowRule, AnyRule
//!     DepthEstimator where in its bins the pulse lies: centroid, CentredWindow
//!   → DepthEvent    pixel, laser cycle, exposure, sub-bin depth, counts, flags
//!   → AerWord       128 bits
//!
//! of the events of a pixel: RunningMean, Reflectivity, DynamicDepthEvent
//! ```
//!
//! ## Modules
//!
//! Each module imports only from those above it.
//!
//! | module | what it has |
//! |---|---|
//! | `units`, `flags`, `array` | quantities as types; what is to be said against an event; pixels and blocks |
//! | `histogram` | counter widths, the range gate, the histogram, bins that are left out |
//! | `event` | the depth event |
//! | `depth` | where in its bins the pulse lies, and how far that is |
//! | `detect` | whether the peak stands clear: rules, thresholds, one decision |
//! | `config`, `statistics`, `pixel` | one configuration and one statistics, many pixels |
//! | `binning` | blocks of pixels that decide together |
//! | `events` | what comes of events: means, changes of depth, reflectivity |
//! | `aer` | events as words |
//!
//! ## Rules of the crate
//!
//! Data flows one way through the pipeline. Configuration and state are separate
//! types: one configuration, many pixels. Time is an argument. What is lost
//! (saturated, rejected, gated out) is counted. Nothing is logged.
//!
//! ## Glossary
//!
//! - **Macropixel**: SPADs that share a TDC and a histogram.
//! - **Laser cycle**: one laser pulse and the listening time after it.
//! - **TDC code**: the time of a photon in its laser cycle, in bins, as the
//!   time-to-digital converter gives it; not yet checked.
//! - **Bin**: one counter of a histogram and the time it stands for.
//! - **Exposure (N)**: laser cycles since the histogram was cleared.
//! - **Look**: the check of N every X laser cycles, with a decision if
//!   `L1 < N < L2`.
//! - **Background**: photons that a bin holds without a target.
//! - **Detection**: a peak that stands clear of the background.
//! - **False alarm**: a detection without a target.
//! - **CFAR**: a test with a constant false-alarm rate, whatever the background.
//! - **Peak event**, here *depth event*: a detection that a pixel reports.
//! - **Centroid**: the centre of the photons of some bins.
//! - **Dead time**, **pile-up**: the TDC takes one photon and misses those behind it.
//! - **Dynamic depth**: events of changes of depth only, with a polarity.
//! - **AER**: address-event representation; REQ and ACK are its handshake, REQ the paper's.

#![no_std]
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
mod binning;
mod check;
mod config;
mod depth;
mod detect;
mod event;
mod events;
mod flags;
mod histogram;
mod pixel;
mod pixel_processor;
mod statistics;
mod units;

/// The fixed-point numbers of α, bin width and range.
pub use fixed;

pub use aer::{AER_VERSION, AerDecoder, AerEncoder, AerError, AerRecord, AerWord};
pub use array::Array;
pub use binning::{
    Binning, Block, BlockPlace, Feed, count_in_blocks, end_laser_cycles_of_blocks,
    end_laser_cycles_of_blocks_seen,
};
pub use config::{ConfigError, PixelConfig, PixelConfigBuilder};
pub use depth::{CentredWindow, Depth, DepthEstimator, RangeScale, RangeScaleError, centroid};
pub use detect::{
    AnyRule, AverageRule, ComparatorTree, Detection, DetectionRule, HIGHEST_Z, PaperRule,
    Threshold, Tracking, WindowRule, WindowWidthError, detect, isqrt, quadrant_background,
    whole_background, z_for, z_for_levels,
};
pub use event::DepthEvent;
pub use events::{
    DynamicDepthConfig, DynamicDepthEvent, DynamicDepthPixel, Polarity, Reference, Reflectivity,
    RunningMean, ZeroThresholdError,
};
pub use flags::Flags;
pub use histogram::counter::{Count10, Count16, Count24, CounterWidth, PhotonCount};
pub use histogram::gate::{GateError, RangeGate};
pub use histogram::peeled::PeeledBins;
pub use histogram::{Histogram, Peak};
pub use pixel::{AsyncPixel, Decided, Look};
pub use pixel_processor::{ProcessorError, ProcessorEvent, ProcessorSettings};
pub use statistics::Statistics;
pub use units::{
    BinIndex, BinPosition, BlockLevel, Count, EchoNumber, LaserCycle, PixelAddress, SubBinOffset,
};
