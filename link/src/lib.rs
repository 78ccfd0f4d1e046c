#![doc = include_str!("../README.md")]
//! ## Modules
//!
//! [`message`] has the kinds of messages; [`Configuration`], [`Token`], [`Refusal`],
//! [`Report`], [`StopReason`], [`SensorRecord`] and [`HistogramPart`] are their bodies. [`endpoint`] is
//! one end of the link, [`frame`] the bytes between the ends.

#![no_std]
#![cfg_attr(docsrs, feature(doc_cfg))]
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
mod stop_reason;
mod token;

pub use self::adaptive_binning::AdaptiveBinning;
pub use self::configuration::{Configuration, Source};
pub use self::dynamic_depth::DynamicDepth;
pub use self::histogram::{HistogramHead, HistogramMessage, HistogramPart, NoHistogram};
pub use self::refusal::Refusal;
pub use self::report::Report;
pub use self::sensor::{FaultRecord, SensorRecord};
pub use self::stop_reason::StopReason;
pub use self::token::Token;
