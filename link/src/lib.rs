//! The link between a dToF sidecar and its host: messages arrive whole, once and
//! in order, or not yet. Its format is `docs/link-format.md`.
//!
//! ```text
//! endpoint       numbers, acknowledges and repeats messages; closes its window when full
//!   ↕
//! frame          COBS and CRC-32: a damaged frame is dropped and counted
//!   ↕
//! bytes          of a serial port or a TCP stream, whatever carries them
//! ```
//!
//! [`message`] has the kinds of messages; [`Configuration`], [`Token`], [`Refusal`],
//! [`Report`], [`SensorRecord`] and [`HistogramPart`] are their bodies. Neither a board
//! nor a host is known here.
//!
//! The example `two_ends` is a host and a device in one process.

#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::expect_used,
    clippy::float_arithmetic,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used
)]

mod adaptive_binning;
mod configuration;
mod dynamic_depth;
pub mod endpoint;
pub mod frame;
mod histogram;
pub mod message;
mod numbered;
mod refusal;
mod report;
mod sensor;
mod token;

pub use self::adaptive_binning::AdaptiveBinning;
pub use self::configuration::{Configuration, Source};
pub use self::dynamic_depth::DynamicDepth;
pub use self::histogram::{HistogramHead, HistogramMessage, HistogramPart, NoHistogram};
pub use self::refusal::Refusal;
pub use self::report::Report;
pub use self::sensor::{FaultRecord, SensorRecord};
pub use self::token::Token;
