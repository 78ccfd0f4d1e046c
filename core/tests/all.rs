//! One program for all tests: what they share is compiled once, and they run side by side.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "small numbers"
)]

mod aer;
mod array;
mod common;
mod depth;
mod detect;
mod events;
mod excluded;
mod gate;
mod histogram;
mod pixel;
mod pixel_processor;
mod proofs;
mod quantities;
mod whole;
