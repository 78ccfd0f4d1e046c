//! Asynchronous peak detection for single-photon direct time-of-flight
//! histograms: integer-only, `no_std`, without heap, `unsafe` or a way to
//! panic.
//!
//! Each macropixel counts photons into a histogram and reports a depth event
//! the moment its peak stands clear of the background; then it starts over.
//! The method is that of Y. Liu et al., *An on-chip Pixel Processing Approach
//! with 2.4 µs latency for Asynchronous Read-out of SPAD-based dToF Flash
//! LiDARs*; sections, equations and algorithms cited in this crate are that
//! paper's.
//!
//! ```text
//! photon (TDC code)
//!   → Histogram     saturating counters, highest bin kept while counting
//!   → [every X laser cycles, once L1 < N < L2]
//!     Peak          the highest bin, the lowest index wins a tie
//!     background    smaller quadrant maximum of the half without the peak
//!     Threshold     background + α·√background
//!                   or another DetectionRule: WindowRule, AnyRule
//!   → DepthEvent    pixel, laser cycle, exposure, sub-bin depth, counts, flags
//!   → AerWord       128 bits, held by the pixel until the link takes it
//!
//! of the events of a pixel: RunningMean, Reflectivity, DynamicDepthEvent
//! ```
//!
//! # Example
//!
//! A macropixel with one signal photon a laser cycle in bin 60 and now and then
//! a background photon:
//!
//! ```
//! use dtof_core::fixed::types::{I24F8, U8F8, U16F16};
//! use dtof_core::*;
//!
//! let rule = PaperRule::new(const { U8F8::lit("8") }, Count::saturating(5));
//! let config = PixelConfig::<128>::new(10, 100, 2000, RangeGate::full(), rule)?;
//! let scale = RangeScale::new(const { U16F16::lit("250") }, I24F8::ZERO)?; // 250 ps bins
//! let mut pixel = AsyncPixel::<128>::new(PixelAddress(0));
//!
//! let mut event = None;
//! for cycle in 0..1000 {
//!     pixel.count(&config, 60);
//!     if cycle % 7 == 0 {
//!         pixel.count(&config, (cycle % 128) as u16);
//!     }
//!     pixel.end_laser_cycle(&config, LaserCycle(cycle));
//!     event = event.or(pixel.acknowledge());
//! }
//! let event = event.expect("a peak as clear as this is reported");
//! assert_eq!(event.exposure, 110); // the first look with N > 100
//! assert_eq!(scale.range(event.position()).round(), 2267); // 60.5 bins, in mm
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Rules of the crate
//!
//! Data flows one way through the pipeline. Configuration and state are separate
//! types: one configuration, many pixels. Time is an
//! argument. What is lost (saturated, rejected, gated out) is counted. Nothing
//! is logged.
//!
//! # Glossary
//!
//! - **Macropixel**: SPADs that share a TDC and a histogram.
//! - **Laser cycle**: one laser pulse and the listening time after it.
//! - **TDC code**: the time of a photon in its laser cycle, in bins, as the
//!   time-to-digital converter gives it; not yet checked.
//! - **Bin**: one counter of a histogram and the time it stands for.
//! - **Exposure (N)**: laser cycles since the histogram was cleared.
//! - **Look**: the check of N every X laser cycles, with a decision if
//!   `L1 < N < L2`.
//! - **Peak event**, here *depth event*: a peak that stands clear.
//! - **Dynamic depth**: events of changes of depth only, with a polarity.
//! - **AER**: address-event representation; REQ and ACK are its handshake.

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
mod any_rule;
pub mod background;
mod centred_window;
mod depth;
mod detection;
mod dynamic_depth;
mod estimator;
mod event;
mod flags;
mod gate;
mod histogram;
mod isqrt;
pub mod peak;
mod photon_count;
mod pixel;
mod processing_element;
mod reflectivity;
mod rule;
mod running_mean;
mod threshold;
mod units;
mod window;
mod window_z;

/// The fixed-point numbers of α, bin width and range.
pub use fixed;

pub use aer::{AER_VERSION, AerDecoder, AerEncoder, AerError, AerRecord, AerWord};
pub use any_rule::AnyRule;
pub use centred_window::CentredWindow;
pub use depth::{Depth, RangeScale, RangeScaleError, centre_of_mass};
pub use detection::{Detection, detect};
pub use dynamic_depth::{
    DynamicDepthConfig, DynamicDepthEvent, DynamicDepthPixel, Polarity, Reference,
    ZeroThresholdError,
};
pub use estimator::DepthEstimator;
pub use event::{DepthEvent, EventSlot};
pub use flags::Flags;
pub use gate::{GateError, RangeGate};
pub use histogram::{Count10, Count16, Count24, CounterWidth, Histogram};
pub use isqrt::isqrt;
pub use peak::Peak;
pub use photon_count::PhotonCount;
pub use pixel::{AsyncPixel, ConfigError, Look, PixelConfig, Statistics};
pub use processing_element::{Macropixel, ProcessingElement};
pub use reflectivity::Reflectivity;
pub use rule::{DetectionRule, PaperRule, whole_background};
pub use running_mean::RunningMean;
pub use threshold::Threshold;
pub use units::{BinIndex, BinPosition, Count, LaserCycle, PixelAddress, SubBinOffset};
pub use window::{WindowRule, WindowWidthError};
pub use window_z::{HIGHEST_Z, z_for};
